// Stands in the page itself, before all else. Where a script, or the first connection, breaks off before everything is there, the page
// is loaded anew as soon as the server answers. From then on, `connection.js` sees to connections.
(() => {
  // Whether the server is there is asked so often, and each time so long.
  const RETRY_MS = 1000;
  const PROBE_MS = 5000;
  // What is not there by then will not come any more: networks that changed, and computers that slept, do not say so.
  const PATIENCE_MS = 60000;
  // So often in a row: something else may keep a script away, a filter of the browser say, and the page may do without it.
  const MOST = 5;
  const COUNT = "vittf loaded again";
  const STYLE = "position: fixed; inset: 0; z-index: 2000; display: flex; align-items: center; justify-content: center; " +
    "background: #14171a; color: #dce2e7; font: 15px/1.5 system-ui, sans-serif";

  const isThere = () => Boolean(window.requests && document.querySelector(".connection"));
  let again = false;

  async function loadAgain() {
    const count = Number(sessionStorage.getItem(COUNT));
    if (again || count >= MOST) return;
    again = true;
    const note = document.documentElement.appendChild(document.createElement("div"));
    note.textContent = "The connection was lost. This page comes up by itself as soon as the app answers.";
    note.style.cssText = STYLE;
    note.setAttribute("role", "status");
    for (;;) {
      await new Promise((done) => setTimeout(done, RETRY_MS));
      const { status } = await fetch("served", { cache: "no-store", signal: AbortSignal.timeout(PROBE_MS) }).catch(() => ({}));
      if (status) break;
    }
    // Nothing was done on it that it would have to ask about.
    const page = document.querySelector("#app");
    if (page) page.inert = true;
    sessionStorage.setItem(COUNT, count + 1);
    window.location.reload();
  }

  window.addEventListener("error", ({ target }) => {
    if (target.tagName === "SCRIPT" || target.rel === "stylesheet") loadAgain();
  }, { capture: true });
  window.WebSocket = class extends WebSocket {
    constructor(...given) {
      super(...given);
      window.newestSocket = this;  // For `connection.js`: trame keeps it to itself.
      this.addEventListener("close", () => isThere() || loadAgain());
    }
  };
  setTimeout(() => (isThere() ? sessionStorage.removeItem(COUNT) : loadAgain()), PATIENCE_MS);
})();
