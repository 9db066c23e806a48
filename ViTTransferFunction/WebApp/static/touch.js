// Fingers on the views. One does what a mouse does with its left button, as soon as it is clear that it stays alone: once it has
// moved, or is lifted. Two move the picture and enlarge it. The views themselves would press the button for each finger at once.
(() => {
  const STILL_PX = 8;

  // Moves before the server has answered go to it together. Nothing else waits, so that what is asked for next does not overtake it.
  let steps = [];
  let unanswered = 0;
  async function send(name, ...done) {
    steps.push(...done);
    if (unanswered && done.every(([what]) => what === "move" || what === "spread")) return;
    const sent = steps;
    steps = [];
    unanswered += 1;
    await window.trame.trigger("touch_view", [name, sent]).catch(() => {});
    unanswered -= 1;
    if (steps.length) send(name);
  }

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
  const middle = ([one, other]) => ({ x: (one.x + other.x) / 2, y: (one.y + other.y) / 2 });
  const distance = ([one, other]) => Math.max(1, Math.hypot(one.x - other.x, one.y - other.y));

  function press() {
    doing = "press";
    send(view.dataset.view, ["move", place(start)], ["press", place(start)]);
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
    if (doing === "press" && event.pointerId === fingers.keys().next().value) send(view.dataset.view, ["move", place(at)]);
    if (doing === "spread")
      send(view.dataset.view, ["spread", place(middle(before)), place(middle(after)), distance(after) / distance(before)]);
  }

  function lift(event, at) {
    const isFirst = event.pointerId === fingers.keys().next().value;
    fingers.delete(event.pointerId);
    if (doing === "nothing yet" && event.type === "pointerup") press();
    if (doing === "press" && isFirst) send(view.dataset.view, ["release", place(at)], ["leave", place(at)]);
    if (doing !== "press" || isFirst) doing = "nothing any more";
    if (!fingers.size) view = null;
  }

  for (const [name, react] of [["pointerdown", down], ["pointermove", move], ["pointerup", lift], ["pointercancel", lift]])
    window.addEventListener(name, (event) => {
      if (event.pointerType !== "touch") return;
      const area = event.target.closest && event.target.closest("[data-view]");
      if (name === "pointerdown") {
        if (!area || (view && area !== view) || event.target.closest("button, input")) return;
        view = area;
      } else if (!fingers.has(event.pointerId)) return;
      event.preventDefault();
      event.stopPropagation();
      react(event, { x: event.clientX, y: event.clientY });
    }, { capture: true, passive: false });
})();
