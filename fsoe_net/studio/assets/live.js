// The live page: a running bus, an emulated run that was started here, or a recorded one.
import { useCallback, useEffect, useState } from "./vendor/hooks.js";
import { html, worst } from "./html.js";
import { Cycle, Events, SubDevices } from "./live_bus.js";
import { Buttons } from "./live_buttons.js";
import { Control } from "./live_control.js";
import { Past, clock } from "./live_past.js";
import { Scope } from "./live_scope.js";
import { follow, get, live } from "./live_server.js";
import { Strips } from "./live_strips.js";

/** @typedef {import("./types").LiveSources} LiveSources */

const WINDOWS = [["2", "2 s"], ["10", "10 s"], ["60", "1 min"], ["600", "10 min"], ["0", "all"]];
const SCOPE_S = 10;

/** What was seen stays, also while another view is shown. @type {Record<string, Past>} */
const PASTS = { master: new Past(), emulated: new Past(), file: new Past() };

/** @param {{ state: import("./types").State }} props */
export function Live({ state }) {
  const [sources, setSources] = useState(/** @type {LiveSources | null} */ (null));
  const [source, setSource] = useState("");
  const [error, setError] = useState("");
  const [, redraw] = useState(0);
  const list = useCallback(async () => {
    const found = await get("");
    if (found.error) return setError(found.error);
    setSources(found);
    setSource((now) => now || (found.run ? "emulated" : found.master ? "master" : PASTS.file.view ? "file" : ""));
  }, []);
  useEffect(() => void list(), []);
  const run = source === "emulated" ? sources?.run : source === "master" ? "live" : null;
  useEffect(() => {
    if (!run) return;
    // Kept per source, so that a change of the view loses nothing.
    const past = PASTS[source];
    let drawn = 0;
    const end = follow(
      source,
      () => `run=${past.run}&since=${past.nextEvent}`,
      (picture) => {
        // Another run has been started, possibly by another page.
        if (picture.source === "emulated" && picture.run !== past.run) list();
        past.take(picture);
        // Updates can arrive faster than the screen is drawn.
        if (!drawn) drawn = requestAnimationFrame(() => {
          drawn = 0;
          redraw((n) => n + 1);
        });
      },
      (there) => setError(there ? "" : "fsoe-net studio does not answer; the last known state is shown"),
    );
    return () => {
      end();
      cancelAnimationFrame(drawn);
    };
  }, [source, run]);

  const start = async () => {
    const answer = await live("start");
    setError(answer.error);
    if (answer.error) return;
    setSource("emulated");
    list();
  };
  const open = async (/** @type {File | undefined} */ file) => {
    if (!file) return;
    const answer = await live("open", { text: await file.text() });
    setError(answer.error && `${file.name}: ${answer.error}`);
    if (answer.error) return;
    PASTS.file = new Past();
    PASTS.file.take({ ...answer.view, run: file.name });
    setSource("file");
    redraw((n) => n + 1); // also where a file was shown already
  };
  const past = PASTS[source || "file"];
  const hasErrors = !state.is_network || worst(state.findings) === "error";
  return html`<main class="live">
    <div class="row sources" role="group" aria-label="What is shown">
      ${sources?.master &&
      html`<button aria-pressed=${source === "master"} onClick=${() => setSource("master")}>Bus: ${sources.master}</button>`}
      ${sources?.run &&
      html`<button aria-pressed=${source === "emulated"} onClick=${() => setSource("emulated")}>Emulated run</button>`}
      ${PASTS.file.view &&
      html`<button aria-pressed=${source === "file"} onClick=${() => setSource("file")}>Recorded: ${PASTS.file.run}</button>`}
      ${sources &&
      html`<button class="start" disabled=${hasErrors} onClick=${start}>
        ${hasErrors ? "Emulated run: correct the errors first" : sources.run ? "Restart the emulated run" : "Start an emulated run"}
      </button>`}
      <label class="file">Open a recorded run
        <input type="file" accept=".json,application/json"
          onChange=${(/** @type {any} */ e) => {
            open(e.target.files[0]);
            e.target.value = ""; // so that the same name can be opened again
          }} /></label>
    </div>
    ${error && html`<p class="error" role="alert">${error}</p>`}
    ${past.view
      ? html`<${Shown} key=${`${source} ${past.run}`} past=${past} source=${source} state=${state} sources=${sources} end=${() => live("end")} />`
      : html`<div class="help">
          <p>${run ? "Waits for the first picture …" : "Start an emulated run: it moves in pace with the clock, and its buttons show what FSoE does when an e-stop is pressed, a SubDevice is pulled, a cable breaks. Nothing is sent to a real bus."}</p>
          ${!sources?.master && html`<p>A running bus is shown by <code>fsoe-net studio --interface IF</code>, a recorded run by the file that <code>fsoe-net run --format json</code> wrote.</p>`}
        </div>`}
  </main>`;
}

/** @param {{ past: Past, source: string, state: import("./types").State, sources: LiveSources | null, end: () => void }} props */
function Shown({ past, source, state, sources, end }) {
  const view = /** @type {import("./types").LiveView} */ (past.view);
  const [window_s, setWindow] = useState(source === "file" ? "0" : "10");
  const [held, setHeld] = useState(/** @type {{ to: number, rows: (number | null)[][] } | null} */ (null));
  const [chosen, choose] = useState("");
  const to = held?.to ?? view.now_ms;
  const oldest = past.events.length ? Math.min(0, past.events[0].time_ms) : 0;
  const from = window_s === "0" ? oldest : to - 1000 * Number(window_s);
  const pause = (/** @type {number} */ at) => setHeld({ to: at, rows: held?.rows ?? past.rows });
  return html`
    <div class="row" role="group" aria-label="Time">
      <strong class="verdict ${view.good && view.current ? "good" : "error"}" role="status">
        ${view.good && view.current ? "✔" : "✖"} ${view.title}: ${view.state}${view.good ? "" : ", with problems"}
      </strong>
      ${view.pace !== null && html`<span>${paceText(view.pace)}</span>`}
      <button aria-pressed=${held !== null} onClick=${() => (held ? setHeld(null) : pause(view.now_ms))}>
        ${held ? "Follow again" : "Pause"}</button>
      <label>Show <select value=${window_s} onChange=${(/** @type {any} */ e) => setWindow(e.target.value)}>
        ${WINDOWS.map(([value, text]) => html`<option value=${value}>${text}</option>`)}
      </select></label>
      <label class="scroll">up to <input type="range" min=${oldest} max=${view.now_ms} step="10" value=${to}
        aria-valuetext=${clock(to)} onInput=${(/** @type {any} */ e) => pause(Number(e.target.value))} /></label>
      <output>${clock(to)}</output>
      ${source !== "file" && html`<a class="button" href=${`/api/live/document?source=${source}`} download>Save the record</a>`}
      ${source === "emulated" && !view.ended && html`<button onClick=${end}>End the run</button>`}
    </div>
    ${view.away && html`<p class="error" role="alert">${view.away}${view.ended ? "" : "; the last known state is shown"}</p>`}
    ${source === "emulated" && view.content !== state.content && html`<p class="stale">This is a run of an earlier text. Start it again to see the present one.</p>`}
    ${!view.away && view.bus?.reasons.map((text) => html`<p class=${view.bus?.level} key=${text}>${text}</p>`)}
    ${view.notes.map((note) => html`<p class="note" key=${note}>${note}</p>`)}
    <div class="columns">
      <div>
        <${Strips} past=${past} from=${from} to=${to} chosen=${chosen} choose=${choose} />
        ${source !== "file" &&
        html`<${Scope} past=${past} rows=${held?.rows ?? past.rows} source=${source} run=${past.run} seconds=${window_s === "2" ? 2 : SCOPE_S} />`}
      </div>
      <div>
        ${source === "emulated" && sources?.names && !view.ended && html`<${Buttons} names=${sources.names} view=${view} />`}
        ${source === "master" && typeof view.control === "number" && html`<${Control} view=${view} />`}
        <${Events} events=${past.events} leftOut=${past.left_out} to=${to} chosen=${chosen} choose=${choose} />
        <${SubDevices} subdevices=${view.subdevices} />
        <${Cycle} statistics=${view.statistics} />
      </div>
    </div>`;
}

/** @param {number} pace */
function paceText(pace) {
  const percent = Math.round(pace * 100);
  if (percent >= 97) return "as fast as the clock";
  return `▲ ${percent} % of the speed of the clock: this computer is too slow for this network`;
}
