// The page: toolbar, drawing, what is selected, findings, text.
import { render } from "./vendor/preact.js";
import { useCallback, useEffect, useRef, useState } from "./vendor/hooks.js";
import { Drawing } from "./drawing.js";
import { Findings } from "./findings.js";
import { html, worst } from "./html.js";
import { Inspector } from "./inspector.js";
import { GONE, listen, request, state as fetchState } from "./server.js";
import { Text } from "./text.js";
import { Trial } from "./trial.js";

/** @typedef {import("./types").State} State */
/** @typedef {import("./types").Selected} Selected */

function Page() {
  const [state, setState] = useState(/** @type {State | null} */ (null));
  const [error, setError] = useState("");
  const [selected, setSelected] = useState(/** @type {Selected} */ (null));
  const [line, setLine] = useState({ line: 0, column: 1, focus: false });
  const present = useRef(/** @type {State | null} */ (null));
  /** What the drawing shows while the text is no network. */
  const drawn = useRef(/** @type {State | null} */ (null));

  const take = useCallback((/** @type {State | { error: string }} */ answer) => {
    setError(answer.error);
    if ("version" in answer && answer.version >= (present.current?.version ?? 0)) {
      present.current = answer;
      if (answer.is_network) drawn.current = answer;
      setState(answer);
    }
  }, []);

  /** Requests go one after the other, each on the version that the one before has made. */
  const last = useRef(/** @type {Promise<unknown>} */ (Promise.resolve()));
  const act = useCallback((/** @type {string} */ name, /** @type {object} */ body = {}) => {
    const done = last.current.then(async () => {
      const answer = await request(name, { ...body, version: present.current?.version ?? 0 });
      take(answer);
      if ("change" in body && body.change === "connect" && "version" in answer && !answer.error)
        setSelected({ connection: drawnLast(answer) });
      return answer;
    });
    last.current = done;
    return done;
  }, []);

  useEffect(() => {
    const look = async () => take(await fetchState());
    look();
    return listen(
      (version) => version > (present.current?.version ?? 0) && look(),
      (there) => setError((now) => (there ? (now === GONE ? "" : now) : GONE)),
    );
  }, []);

  useEffect(() => {
    const onKey = (/** @type {KeyboardEvent} */ event) => {
      if (!(event.ctrlKey || event.metaKey)) return;
      if (event.key === "s") {
        event.preventDefault();
        act("save");
      } else if (event.target instanceof HTMLElement && event.target.matches("textarea, input")) {
        return; // a field takes its own letters back
      } else if (event.key === "z" || event.key === "y") {
        event.preventDefault();
        act(event.key === "y" || event.shiftKey ? "redo" : "undo");
      }
    };
    document.addEventListener("keydown", onKey);
    return () => document.removeEventListener("keydown", onKey);
  }, []);

  useEffect(() => {
    document.title = `${state?.saved === false ? "● " : ""}${state?.name || "fsoe-net"} – studio`;
  }, [state]);

  if (state === null) return html`<p class="wait" role="status">${error || "Loading …"}</p>`;
  const shown = state.is_network ? state : (drawn.current ?? state);
  const show = (/** @type {number} */ at, column = 1, focus = true) =>
    at > 0 && setLine({ line: at, column, focus });
  const choose = (/** @type {Selected} */ what) => {
    setSelected(what);
    const part = partOf(shown, what);
    if (part) show(part.line, 1, false);
  };
  return html`
    <${Toolbar} state=${state} act=${act} />
    ${error && html`<p class="error" role="alert">${error}</p>`}
    ${state.outside &&
    html`<p class="outside" role="alert">
      Somebody has changed the file on the disk. Nothing is overwritten: Save waits.
      <button onClick=${() => act("take")}>Take the file’s text (Undo brings mine back)</button>
    </p>`}
    <main>
      <section aria-label="Network" class="network">
        ${!state.is_network &&
        html`<p class="stale" role="status">
          The text is no network at present; this is the last one. See the findings.
        </p>`}
        <${Drawing} state=${shown} stale=${!state.is_network} selected=${selected}
          choose=${choose} act=${act} />
      </section>
      <aside>
        <${Inspector} state=${shown} selected=${selected} act=${act} choose=${choose} />
        <${Findings} findings=${state.findings} show=${show} act=${act} />
        <${Trial} version=${state.version}
          hasErrors=${!state.is_network || worst(state.findings) === "error"} />
      </aside>
      <${Text} state=${state} line=${line} act=${act}
        onCursor=${(/** @type {number} */ at) => setSelected(partAt(shown, at) ?? selected)} />
    </main>
    <footer>
      Part of the black channel, not certified, never a safety function. This page changes files;
      it sends nothing to a bus.
    </footer>
  `;
}

/**
 * @param {State} state
 * @param {Selected} what
 */
function partOf(state, what) {
  if (what === null) return undefined;
  if ("connection" in what) return state.connections[what.connection];
  return state.subdevices.find((s) => s.name === what.subdevice);
}

/**
 * The connection that was drawn last: of those that are not confirmed the one furthest down.
 * @param {State} state
 */
function drawnLast(state) {
  const lines = state.connections.map((c) => (c.unconfirmed === null ? 0 : c.line));
  return lines.indexOf(Math.max(...lines));
}

/**
 * The part that begins on a line.
 * @param {State} state
 * @param {number} line
 * @returns {Selected | undefined}
 */
function partAt(state, line) {
  const sub = state.subdevices.find((s) => s.line === line);
  if (sub) return { subdevice: sub.name };
  const number = state.connections.findIndex((c) => c.line === line);
  return number >= 0 ? { connection: number } : undefined;
}

/** @param {{ state: State, act: (name: string) => void }} props */
function Toolbar({ state, act }) {
  const verdict = {
    error: "has errors: it compiles to no plan",
    warning: "has warnings",
    info: "no errors",
    "": "no errors",
  }[worst(state.findings)];
  return html`<header>
    <h1>${state.name || "fsoe-net studio"}</h1>
    <span class="path">${state.path}</span>
    <span class="verdict ${worst(state.findings) || "good"}" role="status">
      ${state.is_network ? verdict : "no network yet"} · ${state.saved ? "saved" : "not saved"}
    </span>
    <button disabled=${!state.can_undo} onClick=${() => act("undo")}>Undo</button>
    <button disabled=${!state.can_redo} onClick=${() => act("redo")}>Redo</button>
    <button class="save" disabled=${state.saved} onClick=${() => act("save")}>Save</button>
  </header>`;
}

const page = document.getElementById("page");
if (page) {
  page.textContent = "";
  render(html`<${Page} />`, page);
}
