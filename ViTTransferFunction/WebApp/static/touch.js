// Fingers on the views. One does what a mouse does with its left button, as soon as it is clear that it stays alone: once it has
// moved, or is lifted. Two move the picture and enlarge it. The views themselves would press the button for each finger at once.
(() => {
  const STILL_PX = 8;
  const NO_KEYS = [false, false, false];

  // Fingers on one view, until all are lifted: where they are, and what they do, which is "nothing yet", "press", "spread" or
  // "nothing any more".
  const fingers = new Map();
  let view = null;
  let doing = "nothing yet";
  let start = null;

  function place({ x, y }) {
    const box = view.getBoundingClientRect();
    return [(x - box.left) / box.width, (y - box.top) / box.height];
  }
  const step = (what, at, ...more) => window.viewStep(view.dataset.view, what, place(at), NO_KEYS, ...more);
  const middle = ([one, other]) => ({ x: (one.x + other.x) / 2, y: (one.y + other.y) / 2 });
  const distance = ([one, other]) => Math.max(1, Math.hypot(one.x - other.x, one.y - other.y));

  function press() {
    doing = "press";
    step("move", start);
    step("press", start, "left");
  }

  function down(event, at) {
    if (document.activeElement) document.activeElement.blur();
    fingers.set(event.pointerId, at);
    if (fingers.size === 1) [doing, start] = ["nothing yet", at];
    else if (doing !== "press") doing = fingers.size === 2 ? "spread" : "nothing any more";
  }

  function move(event, at) {
    const before = [...fingers.values()];
    fingers.set(event.pointerId, at);
    const after = [...fingers.values()];
    if (doing === "nothing yet" && distance([start, at]) > STILL_PX) press();
    if (doing === "press" && event.pointerId === fingers.keys().next().value) step("move", at);
    if (doing === "spread") step("spread", middle(before), place(middle(after)), distance(after) / distance(before));
  }

  function lift(event, at) {
    const isFirst = event.pointerId === fingers.keys().next().value;
    fingers.delete(event.pointerId);
    if (doing === "nothing yet" && event.type === "pointerup") press();
    if (doing === "press" && isFirst) {
      step("release", at, "left");
      step("leave", at);
    }
    if (doing !== "press" || isFirst) doing = "nothing any more";
    if (!fingers.size) view = null;
  }

  for (const [name, react] of [["pointerdown", down], ["pointermove", move], ["pointerup", lift], ["pointercancel", lift]])
    window.addEventListener(name, (event) => {
      if (event.pointerType !== "touch") return;
      const area = event.target.closest && event.target.closest("[data-view]");
      if (name === "pointerdown") {
        if (!area || (view && area !== view) || event.target.closest(".slice-row, .view-buttons")) return;
        view = area;
      } else if (!fingers.has(event.pointerId)) return;
      event.preventDefault();
      event.stopPropagation();
      react(event, { x: event.clientX, y: event.clientY });
    }, { capture: true, passive: false });
})();
