// What the page asks for goes to the server with a number, in its order, and is kept until it is answered: over another connection
// it is sent again, and the server does nothing twice.
(() => {
  const NOT_CONNECTED = -32099;  // wslink's code.
  const page = Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");

  let number = 0;
  let held = false;
  const unanswered = new Map();

  function send(request) {
    request.since = Date.now();
    const session = window.trame.client.getConnection().getSession();
    const settle = (done) => (value) => {
      unanswered.delete(request.number);
      done(value);
    };
    session.call("trame.trigger", ["ask", [page, request.number, ...request.what], {}])
      .then(settle(request.resolve), (error) => error.code !== NOT_CONNECTED && settle(request.reject)(error));
  }

  function ask(...what) {
    return new Promise((resolve, reject) => {
      number += 1;
      const request = { number, what, resolve, reject, since: Date.now() };
      unanswered.set(number, request);
      if (!held) send(request);
    });
  }

  window.requests = {
    page,
    NOT_CONNECTED,
    // By name, with arguments; gives the answer.
    ask,
    // Since when an answer is awaited; null if none is.
    awaited: () => (unanswered.size ? unanswered.values().next().value.since : null),
    // Send nothing until `goOn`.
    hold: () => { held = true; },
    goOn: () => {
      held = false;
      unanswered.forEach(send);
    },
  };

  // The page's template asks by this. trame's own would be lost with the connection, and would keep changed settings from being
  // sent until the answer.
  window.trame.trigger = (name, given = []) => ask(name, given);
  ask("arrive");
})();
