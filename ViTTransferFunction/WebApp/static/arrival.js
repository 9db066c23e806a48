// Stands in the page itself, before all else. A browser that is too old for the page says so. Where a script, or the first connection,
// breaks off before everything is there, the page is loaded anew as soon as the server answers; where that lets the page do nothing, or
// no connection ever holds, the page says why. From then on, `connection.js` sees to connections.
(() => {
  // Whether the server is there is asked so often, and each time so long.
  const RETRY_MS = 1000;
  const PROBE_MS = 5000;
  // What is not there by then will not come any more: networks that changed, and computers that slept, do not say so.
  const PATIENCE_MS = 60000;
  // So often in a row: something else may keep a script away, a filter of the browser say, and the page may do without it.
  const MOST = 5;
  const COUNT = "vittf loaded again";
  const STYLE = "position: fixed; top: 0; right: 0; bottom: 0; left: 0; z-index: 2000; display: flex; align-items: center; " +
    "justify-content: center; padding: 0 2rem; text-align: center; background: #14171a; color: #dce2e7; font: 15px/1.5 system-ui, sans-serif";

  // What came last to browsers of all that the page needs.
  const isModern = () => "inert" in HTMLElement.prototype && "timeout" in (window.AbortSignal || {}) &&
    CSS.supports("container-type", "inline-size");
  const isThere = () => Boolean(window.requests && document.querySelector(".connection"));
  let again = false;

  const note = document.createElement("div");
  note.style.cssText = STYLE;
  note.setAttribute("role", "status");

  function say(text) {
    note.textContent = text;
    document.documentElement.append(note);
  }

  // What the server answers to a page that does something, here what trame does first of all; null while it is not there: a proxy may
  // answer for it.
  async function ask() {
    const question = { method: "POST", cache: "no-store", signal: AbortSignal.timeout(PROBE_MS) };
    const answer = await fetch("paraview/", question).catch(() => null);
    return answer && answer.status < 500 ? answer : null;
  }

  async function reason(refusal) {
    const page = new DOMParser().parseFromString(await refusal.text(), "text/html");
    return (page.querySelector("p") || page.body).textContent;
  }

  async function loadAgain() {
    const count = Number(sessionStorage.getItem(COUNT));
    if (again || count >= MOST) return;
    again = true;
    say("The connection was lost. This page comes up by itself as soon as the app answers.");
    let answer = null;
    while (!answer) {
      await new Promise((done) => setTimeout(done, RETRY_MS));
      answer = await ask();
    }
    if (answer.status === 403) return say(await reason(answer));
    // Nothing was done on it that it would have to ask about.
    const page = document.querySelector("#app");
    if (page) page.inert = true;
    sessionStorage.setItem(COUNT, count + 1);
    window.location.reload();
  }

  function missConnection() {
    if (isThere()) return;
    if (Number(sessionStorage.getItem(COUNT)) < MOST) loadAgain();
    else say("No connection to the app holds. If a proxy lies between, it has to pass websockets on.");
  }

  if (!isModern()) {
    say("This browser is too old for the app, which needs Chrome or Edge 105, Firefox 112, Safari 16, or a newer one.");
    return;
  }
  window.addEventListener("error", ({ target }) => {
    if (target.tagName === "SCRIPT" || target.rel === "stylesheet") loadAgain();
  }, { capture: true });
  // trame has messages come as blobs, and reads several at a time: browsers may then hand a later one out first, and the page would go
  // on showing what was replaced, the letters of the patient's sides for one. What it reads here is there at once, so in its order.
  const readInOrder = (buffer) => ({ slice: (...part) => ({ arrayBuffer: async () => buffer.slice(...part) }) });
  window.WebSocket = class extends WebSocket {
    constructor(...given) {
      super(...given);
      window.newestSocket = this;  // For `connection.js`: trame keeps it to itself.
      this.addEventListener("close", missConnection);
    }
    set binaryType(_) {
      super.binaryType = "arraybuffer";
    }
    set onmessage(react) {
      super.onmessage = react && (({ data }) => react({ data: readInOrder(data) }));
    }
  };
  setTimeout(() => (isThere() ? sessionStorage.removeItem(COUNT) : loadAgain()), PATIENCE_MS);
})();
