// The network: drawing, what is selected, findings, text.
import { useCallback, useRef, useState } from "./vendor/hooks.js";
import { Adding } from "./adding.js";
import { Begin, Things } from "./begin.js";
import { Drawing } from "./drawing.js";
import { Export } from "./export.js";
import { Findings } from "./findings.js";
import { dropped } from "./given.js";
import { html, worst } from "./html.js";
import { Inspector } from "./inspector.js";
import { Splitter } from "./pane.js";
import { Text } from "./text.js";
import { Trial } from "./trial.js";

/** @typedef {import("./types").State} State */
/** @typedef {import("./types").Selected} Selected */
/** @typedef {import("./types").Act} Act */

/** @param {{ state: State, act: Act }} props */
export function Network({ state, act: request }) {
  const [selected, setSelected] = useState(/** @type {Selected} */ (null));
  const [line, setLine] = useState({ line: 0, column: 1, focus: false });
  const [panel, setPanel] = useState(/** @type {"" | "add" | "export"} */ (""));
  const [tour, setTour] = useState(false);
  const [given, setGiven] = useState(/** @type {import("./types").Given[]} */ ([]));
  const [dropping, setDropping] = useState(false);
  const [tried, setTried] = useState(/** @type {import("./types").Tried | { error: string } | null} */ (null));
  // A result of an earlier text is not that of the lines that are drawn now.
  const results = tried && "connections" in tried && tried.content === state.content ? tried.connections : [];
  /** Shown by the drawing while the text is not a valid network. */
  const drawn = useRef(state);
  if (state.is_network) drawn.current = state;
  const shown = drawn.current;

  const act = useCallback(
    /** @type {Act} */ async (name, body = {}) => {
      const answer = await request(name, body);
      // A new connection is selected, because its facts are to be entered next.
      if ("change" in body && body.change === "connect" && "version" in answer && !answer.error)
        setSelected({ connection: drawnLast(answer) });
      return answer;
    },
    [request],
  );
  const show = (/** @type {number} */ at, column = 1, focus = true) =>
    at > 0 && setLine({ line: at, column, focus });
  const choose = (/** @type {Selected} */ what) => {
    setSelected(what);
    const part = partOf(shown, what);
    // The text follows the drawing but does not take the keyboard.
    if (part) show(part.line, 1, false);
  };
  const open = (/** @type {"" | "add" | "export"} */ name) => {
    setGiven([]);
    setPanel(panel === name ? "" : name);
  };
  const hasFiles = (/** @type {DragEvent} */ event) => event.dataTransfer?.types.includes("Files");
  const over = (/** @type {DragEvent} */ event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    setDropping(true);
  };
  const drop = async (/** @type {DragEvent} */ event) => {
    setDropping(false);
    // Text that is dragged within the page is not a file.
    if (!event.dataTransfer || !hasFiles(event)) return;
    event.preventDefault();
    setGiven(await dropped(event.dataTransfer));
    setPanel("add");
  };
  const begins = state.is_new && state.is_network && state.subdevices.length === 0;
  return html`
    <main class=${`panes ${dropping ? "dropping" : ""}`} onDragOver=${over} onDrop=${drop}
      onDragLeave=${(/** @type {DragEvent} */ event) => event.relatedTarget === null && setDropping(false)}>
      <section aria-label="Network" class="network">
        <div class="row">
          <button aria-expanded=${panel === "add"} onClick=${() => open("add")}>Add SubDevices</button>
          <button aria-expanded=${panel === "export"} onClick=${() => open("export")}>Export</button>
          ${dropping && html`<b role="status">Drop the files to read them</b>`}
        </div>
        ${begins &&
        html`<${Begin} path=${state.path} add=${() => open("add")}
          example=${async () => setTour(!(await act("example")).error)} />`}
        ${tour && !begins && html`<${Things} close=${() => setTour(false)} />`}
        ${!state.is_network &&
        html`<p class="stale" role="status">
          The text is not a valid network at present; this is the last valid one. See the findings.
        </p>`}
        <${Drawing} state=${shown} stale=${!state.is_network} selected=${selected}
          tried=${results} choose=${choose} act=${act} />
      </section>
      <${Splitter} name="side" label="Width of the right side" usual=${34} isUpright=${true} />
      <aside>
        ${panel === "add" &&
        html`<${Adding} state=${state} act=${act} given=${given} choose=${choose}
          close=${() => setPanel("")} />`}
        ${panel === "export" &&
        html`<${Export} version=${state.version} saved=${state.saved} close=${() => setPanel("")} />`}
        <${Trial} content=${state.content} tried=${tried} setTried=${setTried}
          hasErrors=${!state.is_network || worst(state.findings) === "error"} />
        <${Inspector} state=${shown} selected=${selected} act=${act} choose=${choose} />
        <${Findings} findings=${state.findings} show=${show} act=${act} />
      </aside>
      <${Splitter} name="text" label="Height of the text" usual=${34} isUpright=${false} />
      <${Text} state=${state} line=${line} act=${act}
        onCursor=${(/** @type {number} */ at) => setSelected(partAt(shown, at) ?? selected)} />
    </main>
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
