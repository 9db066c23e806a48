// What mouse and fingers do in the views goes to the server as steps, in their order. Presses and releases go at once, as all else
// that the page asks for does, so that over a slow network nothing overtakes a click. Only what goes on and on waits for an answer,
// to go together: moves, two fingers that spread, and the wheel, so that slices come as fast as the network lets them.
(() => {
  const GOES_ON = ["hover", "move", "spread", "wheel"];
  let view = "";
  let steps = [];
  let unanswered = 0;

  function send() {
    if (!steps.length) return;
    const answer = window.requests.ask("use_view", [view, steps]);
    steps = [];
    unanswered += 1;
    answer.catch(() => {}).then(() => {
      unanswered -= 1;
      send();
    });
  }

  // A step in a view: what, where in shares of the view, with which keys, and more.
  window.viewStep = (name, ...step) => {
    if (name !== view) send();
    view = name;
    const [what, , keys, notches] = step;
    const last = steps[steps.length - 1];
    if (last && last[0] === what && String(last[2]) === String(keys)) {
      if (what === "wheel") step[3] = notches + last[3];
      if (["hover", "wheel"].includes(what)) steps.pop();
    }
    steps.push(step);
    if (!unanswered || !GOES_ON.includes(what)) send();
  };

  // What waits goes before whatever else is asked for.
  for (const name of ["pointerdown", "keydown", "click"]) window.addEventListener(name, send, { capture: true });
})();
