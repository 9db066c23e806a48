// The keyboard, and files that are chosen or dropped. Everything else is in the page's template.
(() => {
  const state = (name) => window.trame && window.trame.state && window.trame.state.get(name);
  const set = (name, value) => window.trame.state.set(name, value);
  const act = (...request) => window.requests.ask("act", request);

  // Whether the page may not be used, since the server is not heard, or serves another one.
  const isCutOff = () => document.querySelector("#app").inert;

  // Keys by which Firefox searches the page for what is typed next: tools, say.
  const SEARCH_KEYS = ["/", "'"];

  // Keys, by the table that all front ends share. The key on which Macs have "delete" is elsewhere one that takes a letter back.
  const PLAIN = { Escape: "Esc", Delete: "Del", ArrowUp: "Up", ArrowDown: "Down" };
  if (navigator.platform.startsWith("Mac")) PLAIN.Backspace = "Del";

  // Many keyboards have [ and ] on AltGr, which some browsers of Windows report as Ctrl with Alt, or, on a Mac, on Option,
  // which is Alt.
  const isSignByAlt = (event) => event.altKey && /^[^\p{L}\p{N}\s]$/u.test(event.key);

  function keyOf(event) {
    const key = PLAIN[event.key] || (event.key.length === 1 ? event.key.toUpperCase() : event.key);
    const isLetter = /^[A-Z]$/.test(key);
    return (event.altKey && !isSignByAlt(event) ? "Alt+" : "") + (event.shiftKey && isLetter ? "Shift+" : "") + key;
  }

  function isTyping(element) {
    return element && (element.tagName === "SELECT" || element.tagName === "TEXTAREA" ||
      (element.tagName === "INPUT" && ["text", "number"].includes(element.type) && !element.readOnly));
  }

  // What other programs have on Ctrl, or Cmd: a browser would undo in a field, or save its page.
  function withControl(event) {
    const key = (event.shiftKey ? "Shift+" : "") + event.key.toLowerCase();
    const action = { z: "undo", "Shift+z": "redo", y: "redo", s: "save" }[key];
    if (event.altKey || !action || (action !== "save" && isTyping(event.target))) return;
    event.preventDefault();
    if (document.querySelector(".backdrop") || (action === "save" && event.repeat)) return;
    if (action !== "save") return act(action);
    const save = document.querySelector("[data-save]:not(.disabled)");
    if (save) save.click();
  }

  // A row that moves up is taken out of its table and put in again, which takes the keyboard from it.
  let moved = null;
  new MutationObserver(() => {
    if (moved && moved.isConnected && document.activeElement === document.body) moved.focus();
  }).observe(document.documentElement, { childList: true, subtree: true });
  window.addEventListener("pointerdown", () => { moved = null; }, { capture: true });

  window.addEventListener("keydown", (event) => {
    if (!window.requests || isCutOff()) return;
    if ((event.ctrlKey || event.metaKey) && !isSignByAlt(event)) return withControl(event);
    const key = keyOf(event);
    const inDialog = document.querySelector(".backdrop");
    if (key === "Esc" && (inDialog || state("asking_help"))) {
      if (inDialog) inDialog.querySelector("[data-cancel]").click();
      else set("asking_help", false);
      return;
    }
    if (isTyping(event.target) || inDialog) return;
    if (SEARCH_KEYS.includes(key)) event.preventDefault();
    const shortcut = (state("keys") || []).find((entry) => entry.key === key);
    if (!shortcut) return;
    if (event.repeat && !shortcut.while_held) return event.preventDefault();
    const row = event.target.closest && event.target.closest("[data-class-row]");
    if (state("table_keys").includes(shortcut.action)) {
      if (!row) return;
      // The focus may be on another row than the selected one.
      act("select", row.dataset.classRow);
      if (shortcut.action === "rename") {
        const name = row.querySelector("[data-name]");
        name.readOnly = false;
        name.select();
      } else {
        moved = row;
        act(shortcut.action);
      }
    } else if (shortcut.action === "help") set("asking_help", !state("asking_help"));
    else act(shortcut.action);
    event.preventDefault();
  });

  // The views themselves would send letters and digits twice, as keys, which Slicer's views go by, and as characters. For these, VTK has
  // meanings of its own, of which nothing tells: 3 has a view drawn in red and blue, for glasses, until it is pressed again there.
  window.addEventListener("keypress", (event) => {
    if (event.target.closest("[data-view]")) event.stopPropagation();
  }, { capture: true });

  // The selected structure comes into sight in its table, and nothing else moves: users who go from one to the next may be
  // looking at settings further down.
  let inSight = "";
  new MutationObserver(() => {
    const row = document.querySelector("[data-class-row][aria-current='true']");
    const selected = row ? row.dataset.classRow : "";
    if (selected === inSight) return;
    inSight = selected;
    if (!row) return;
    const [box, table] = [row, row.parentElement].map((element) => element.getBoundingClientRect());
    row.parentElement.scrollTop += Math.min(0, box.top - table.top) + Math.max(0, box.bottom - table.bottom);
  }).observe(document.documentElement, { attributeFilter: ["aria-current"], childList: true, subtree: true });

  // What is unfolded comes into sight: the last parts of a small screen's panel would be unfolded below its end. Some of it comes
  // from the server, a moment later; the user who goes on meanwhile is left alone.
  const unfolded = new ResizeObserver(([entry]) => entry.target.scrollIntoView({ block: "nearest" }));
  for (const use of ["pointerdown", "keydown", "wheel"])
    window.addEventListener(use, () => unfolded.disconnect(), { capture: true, passive: true });
  document.addEventListener("click", (event) => {
    const summary = event.target.closest && event.target.closest("summary");
    if (summary && !summary.parentElement.open) unfolded.observe(summary.parentElement);
  });

  // Browsers would drag the picture or the address of what a shaking hand presses, and take that for no click.
  window.addEventListener("dragstart", (event) => {
    if (event.target.closest && event.target.closest("img, a")) event.preventDefault();
  });

  // A dialog has the keyboard while it is there, and gives it back.
  let dialog = null;
  let before = null;
  new MutationObserver(() => {
    const shown = document.querySelector(".dialog");
    if (shown === dialog) return;
    if (!dialog) before = document.activeElement;
    dialog = shown;
    for (const part of document.querySelectorAll(".panel, .views, .help")) part.inert = Boolean(shown);
    if (shown) shown.querySelector("button, input").focus();
    else if (before && before.isConnected) before.focus();
  }).observe(document.documentElement, { childList: true, subtree: true });

  // Closing the page ends the app.
  window.addEventListener("beforeunload", (event) => {
    if (state("unsaved") && !isCutOff()) event.preventDefault();
  });
  window.addEventListener("pagehide", () => {
    fetch("leave", { method: "POST", keepalive: true }).catch(() => {});
  });

  // Files.
  // `folder`: the name of the one that they were in, if any.
  function send(files, folder = "") {
    if (!files.length) return;
    const form = new FormData();
    for (const file of files) form.append("files", file, file.name);
    const request = new XMLHttpRequest();
    request.open("POST", `upload?folder=${encodeURIComponent(folder)}`);
    request.onerror = () => act("notSent");
    request.upload.onprogress = (event) => set("sent", event.lengthComputable ? event.loaded / event.total : 0);
    request.onloadend = () => set("sent", null);
    set("asking_open", false);
    set("sent", 0);
    request.send(form);
  }

  // Dropped while there is something to lose: kept until the user has answered.
  let dropped = [[]];
  document.addEventListener("click", (event) => {
    if (!event.target.matches("[data-open-dropped]")) return;
    set("asking_dropped", false);
    send(...dropped);
  });

  document.addEventListener("change", (event) => {
    if (!event.target.matches || !event.target.matches("[data-upload]")) return;
    const files = [...event.target.files];
    send(files, files.length ? files[0].webkitRelativePath.split("/")[0] : "");
    event.target.value = "";
  });

  async function filesIn(entry) {
    if (entry.isFile) return [await new Promise((resolve, reject) => entry.file(resolve, reject))];
    const reader = entry.createReader();
    const files = [];
    for (;;) {
      const entries = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
      if (!entries.length) return files;
      for (const inner of entries) files.push(...(await filesIn(inner)));
    }
  }

  const bringsFiles = (event) => event.dataTransfer && [...event.dataTransfer.types].includes("Files");
  window.addEventListener("dragover", (event) => {
    if (!bringsFiles(event)) return;
    event.preventDefault();
    if (!state("dragging")) set("dragging", true);
  });
  // What the mouse is over is entered before it leaves what it was over before; Safari does not say where it goes.
  let over = null;
  window.addEventListener("dragenter", (event) => { over = event.target; });
  window.addEventListener("dragleave", (event) => {
    if (event.target === over) set("dragging", false);
  });
  window.addEventListener("drop", async (event) => {
    if (!bringsFiles(event)) return;
    event.preventDefault();
    set("dragging", false);
    const entries = [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry()).filter(Boolean);
    const files = [];
    try {
      for (const entry of entries) files.push(...(await filesIn(entry)));
    } catch (error) {
      // A part of a series would look like another one.
      return act("notReadable", String(error.message));
    }
    if (!files.length) return act("nothingDropped");
    // Points are added to what is open.
    const arePoints = files.length === 1 && files[0].name.toLowerCase().endsWith(".json");
    dropped = [files, entries.length === 1 && entries[0].isDirectory ? entries[0].name : ""];
    if (!state("unsaved") || arePoints) return send(...dropped);
    set("asking_dropped", true);
  });
})();
