// A connection that breaks is made anew, without the page being loaded again: the scene is the server's. Until then the page says
// what it waits for, and keeps what was asked for.
(() => {
  // How long the server may leave a request unanswered before the page says so; and how much longer, while it does answer others,
  // before this connection is taken for dead: networks that changed, and computers that slept, do not say so.
  const SILENT_MS = 4000;
  const DEAD_MS = 5000;
  // Whether the server is there is asked so often, so many times in a row, and each time so long.
  const RETRY_MS = 1000;
  const TRIES = 8;
  const PROBE_MS = 5000;
  // How long a new connection may take.
  const PATIENCE_MS = 10000;
  // A clock that ticks each second and misses so much stood still, and the computer with it.
  const SLEPT_MS = 20000;
  // Before the first try: the page may just be about to be closed.
  const FIRST_RETRY_MS = 1000;

  const TEXTS = {
    waiting: ["", "The app does not answer. What you do is kept until it does."],
    lost: ["The connection was lost",
      "This page tries again by itself, and goes on where you were. Nothing is lost as long as the app runs: it may have been " +
      "ended, its computer may sleep, or the network is interrupted."],
    elsewhere: ["Open elsewhere", "This session was opened in another tab or browser since. Everything is still there."],
    anew: ["The app was started anew",
      "It has another address now: open the one that it printed. Points that were not saved are offered there with their scan."],
  };

  let state = "";
  let heard = Date.now();
  let probing = false;
  let leaving = false;
  let wake = () => {};
  const box = document.body.appendChild(document.createElement("div"));
  box.className = "connection";
  box.setAttribute("role", "status");

  function show(next) {
    if (next === state) return;
    state = next;
    const [title, text] = TEXTS[state] || ["", ""];
    box.dataset.state = state;
    box.replaceChildren();
    if (title) box.appendChild(document.createElement("h2")).textContent = title;
    if (text) box.appendChild(document.createElement("p")).textContent = text;
    if (state === "elsewhere") {
      const button = box.appendChild(document.createElement("button"));
      button.textContent = "Go on here";
      button.onclick = () => window.location.reload();
    }
    document.querySelector("#app").inert = !["", "waiting"].includes(state);
  }

  const pause = (time) => new Promise((done) => {
    wake = done;
    setTimeout(done, time);
  });

  // What the server says of this page: "here", "elsewhere", "anew", or "" if it does not answer. Browsers ask over connections that
  // they have, which may be dead as well, so that one question is not enough.
  async function probe() {
    let answer = "";
    for (let tries = 0; !answer && tries < TRIES; tries += 1) {
      fetch(`served?page=${window.requests.page}`, { cache: "no-store", signal: AbortSignal.timeout(PROBE_MS) })
        .then(({ status }) => { answer = { 204: "here", 409: "elsewhere", 403: "anew" }[status] || ""; wake(); }, () => {});
      await pause(RETRY_MS);
    }
    return answer;
  }

  async function connect() {
    // trame gives no socket up that says nothing.
    const impatience = setInterval(() => window.newestSocket.close(), PATIENCE_MS);
    try {
      await window.trame.connect();
      return true;
    } catch {
      return false;
    } finally {
      clearInterval(impatience);
    }
  }

  async function lose() {
    if (state === "lost") return;
    window.requests.hold();
    show("lost");
    await pause(FIRST_RETRY_MS);
    while (!leaving) {
      const answer = await probe();
      if (answer === "elsewhere" || answer === "anew") return show(answer);
      if (answer === "here" && await connect()) break;
      await pause(RETRY_MS);
    }
    window.requests.goOn();
    show("");
  }

  window.trame.addConnectListener(() => {
    const client = window.trame.client;
    const session = client.getConnection().getSession();
    // What trame would show instead of the page.
    window.trame.state.get().trame__template_error = window.trame.state.get("trame__template_main");
    const hear = () => { heard = Date.now(); };
    hear();
    for (const topic of ["trame.state.topic", "trame.rca.topic.stream"]) session.subscribe(topic, hear);
    // Before all scripts are there, `arrival.js` has the page loaded anew.
    client.onConnectionClose(() => client === window.trame.client && window.requests && lose());
  });

  // Since when nothing at all was heard, although an answer is awaited; null if all is well.
  function silence() {
    const awaited = window.requests.awaited();
    const since = awaited === null ? Date.now() : Math.max(heard, awaited);
    return Date.now() - since > SILENT_MS ? since : null;
  }

  async function watch() {
    const since = silence();
    if (state === "waiting" && since === null) show("");
    if (!["", "waiting"].includes(state) || probing || since === null) return;
    show("waiting");
    probing = true;
    const answer = await probe();
    if (answer) await pause(DEAD_MS);
    probing = false;
    if (!answer || silence() !== since || state !== "waiting") return;
    window.trame.client.getConnection().getSession().close();
    lose();
  }

  let ticked = Date.now();
  setInterval(() => {
    if (!window.requests) return;  // Scripts come in any order.
    // The computer slept: whether the connection survived that shows only when something is asked for.
    if (Date.now() - ticked > SLEPT_MS && state === "") window.requests.ask("arrive");
    ticked = Date.now();
    watch();
  }, 1000);

  // Views tell their sizes whether that can be or not.
  window.addEventListener("unhandledrejection", (event) => {
    if (event.reason && window.requests && event.reason.code === window.requests.NOT_CONNECTED) event.preventDefault();
  });
  window.addEventListener("online", () => wake());
  document.addEventListener("visibilitychange", () => document.hidden || wake());
  window.addEventListener("pagehide", () => { leaving = true; });
  window.addEventListener("pageshow", () => { leaving = false; });
})();
