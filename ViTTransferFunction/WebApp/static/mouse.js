// The mouse in the views, or a pen. The views themselves would send each press and release only after the answer to what was
// before.
(() => {
  const BUTTONS = [[1, "left"], [2, "right"], [4, "middle"]];

  // Buttons that are held since one was pressed in a view, and that view.
  let held = 0;
  let view = null;
  // Where the mouse rests, as the server knows it: a press there needs no move before it, which the view would draw first.
  let rest = "";

  const isControl = (target) => target.closest(".slice-row, .view-buttons");
  const viewAt = ({ target }) => (target.closest && !isControl(target) ? target.closest("[data-view]") : null);

  function placeIn(area, event) {
    const box = area.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  }

  function step(area, what, event, ...more) {
    // On a Mac, Ctrl makes a left button the right one; what is Ctrl elsewhere is Cmd there.
    const keys = [event.ctrlKey || event.metaKey, event.shiftKey, event.altKey];
    window.viewStep(area.dataset.view, what, placeIn(area, event), keys, ...more);
  }

  function hold(event, buttons) {
    for (const [bit, button] of BUTTONS)
      if ((held ^ buttons) & bit) step(view, buttons & bit ? "press" : "release", event, button);
    held = buttons;
    if (!held) view = null;
  }

  function down(event) {
    if (!view) {
      view = viewAt(event);
      // It is the view's also where it leaves it.
      event.target.setPointerCapture(event.pointerId);
    }
    move(event);
  }

  function move(event) {
    const area = view || viewAt(event);
    const here = [area.dataset.view, event.clientX, event.clientY].join();
    if (here !== rest) step(area, held ? "move" : "hover", event);
    rest = here;
    if (view) hold(event, event.buttons);
  }

  const lift = (event) => hold(event, event.type === "pointerup" ? event.buttons : 0);

  for (const [name, react] of [["pointerdown", down], ["pointermove", move], ["pointerup", lift], ["pointercancel", lift]])
    window.addEventListener(name, (event) => {
      if (event.pointerType === "touch" || !(view || (react !== lift && viewAt(event)))) return;
      event.stopPropagation();
      react(event);
    }, { capture: true });

  window.addEventListener("mouseout", (event) => {
    const area = event.target.closest && event.target.closest("[data-view]");
    if (!area || area.contains(event.relatedTarget) || event.buttons) return;
    step(area, "leave", event);
    rest = "";
  }, { capture: true });

  // Keys choose tools, and the wheel other slices, in which the mouse is not known to be.
  window.addEventListener("keydown", () => { rest = ""; }, { capture: true });

  // How far a wheel turns by a notch, at least, of a mouse whose events are notches. Touchpads send many events of few pixels each.
  const NOTCH_PX = 30;
  const LINE_PX = 16;
  // After which a turn is a new one. Its first event counts whatever its size: mice of Macs turn slowly by few pixels a notch.
  const PAUSE_MS = 200;
  let turn = { when: -Infinity, way: 0, px: 0 };

  // 1 away from the user, -1 towards them, or 0 if it was not turned that far yet.
  function notchOf(event) {
    // Browsers turn sideways while Shift is held.
    const px = (event.deltaMode ? LINE_PX : 1) * (event.deltaY || (event.shiftKey && event.deltaX));
    if (!px) return 0;
    const way = Math.sign(px);
    const isNew = way !== turn.way || event.timeStamp - turn.when > PAUSE_MS;
    turn = { when: event.timeStamp, way, px: isNew ? NOTCH_PX : turn.px + Math.abs(px) };
    if (turn.px < NOTCH_PX) return 0;
    turn.px = 0;
    return -way;
  }

  // Two fingers on a touchpad that spread enlarge, as on a screen. Browsers send them as turns of the wheel with Ctrl, which would
  // change the structure: whether that key is held, all other events know.
  const PX_PER_E = 100;
  let control = false;
  for (const name of ["keydown", "keyup", "pointerdown", "pointermove"])
    window.addEventListener(name, (event) => { control = event.ctrlKey; }, { capture: true });

  function spread(area, event, factor) {
    const place = placeIn(area, event);
    window.viewStep(area.dataset.view, "spread", place, [false, false, false], place, factor);
    rest = "";
  }

  // Safari has events of its own for them, and would enlarge the page. It has these for fingers on a screen too, which are `touch.js`'s.
  let scale = 1;
  for (const name of navigator.maxTouchPoints ? [] : ["gesturestart", "gesturechange"])
    window.addEventListener(name, (event) => {
      const area = viewAt(event);
      if (!area) return;
      event.preventDefault();
      if (name === "gesturechange") spread(area, event, event.scale / scale);
      scale = event.scale;
    }, { capture: true, passive: false });

  window.addEventListener("wheel", (event) => {
    const area = viewAt(event);
    if (!area) return;
    event.preventDefault();
    event.stopPropagation();
    if (event.ctrlKey && !control) return spread(area, event, Math.exp(-event.deltaY / PX_PER_E));
    const notch = notchOf(event);
    if (!notch) return;
    step(area, "wheel", event, notch);
    rest = "";
  }, { capture: true, passive: false });
})();
