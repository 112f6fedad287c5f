// The live page: a running bus, an emulated run that was started here, or a recorded one.
import { useCallback, useEffect, useMemo, useRef, useState } from "./vendor/hooks.js";
import { html, worst } from "./html.js";
import { Cycle, Events } from "./live_bus.js";
import { Buttons } from "./live_buttons.js";
import { Control } from "./live_control.js";
import { busReports, Effects, effectsOf, reportsOf } from "./live_effects.js";
import { Machine } from "./live_machine_draw.js";
import { Panel } from "./live_panel.js";
import { Past } from "./live_past.js";
import { Scope } from "./live_scope.js";
import { follow, get, live } from "./live_server.js";
import { STRIP_HELP, Strips } from "./live_strips.js";
import { TimeBar, Tracks, useTime } from "./live_time.js";

/** @typedef {import("./types").LiveSources} LiveSources */
/** @typedef {import("./types").LiveSelected} LiveSelected */

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

  const past = PASTS[source || "file"];
  // The picture is asked for when the run, the plan or the state of the bus is another one.
  const parts = past.view?.subdevices.map((s) => s.name).join("\n");
  useEffect(() => {
    if (!run || !parts) return;
    get(`/machine?source=${source}`).then((answer) => {
      if (answer.machine) past.picture = answer.machine;
      redraw((n) => n + 1);
    });
  }, [source, run, past.run, parts, past.view?.state]);

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
  const { picture } = past;
  const [chosen, choose] = useState(/** @type {LiveSelected} */ (null));
  const { order, said, error } = useOrder();
  const oldest = past.events.length ? Math.min(0, past.events[0].time_ms) : 0;
  const time = useTime(view.now_ms, oldest, source === "file");
  // While the window is held, the signals of that time stay.
  const held = useRef(/** @type {(number | null)[][] | null} */ (null));
  held.current = time.isHeld ? (held.current ?? past.rows) : null;
  const names = source === "emulated" ? (sources?.names ?? null) : null;
  const acts = names && !view.ended ? order : null;
  const connection = chosen && "connection" in chosen ? chosen.connection : "";
  const chooseConnection = (/** @type {string} */ name) => choose(name ? { connection: name } : null);
  // The cursor of the time axis moves often, and changes nothing in the picture.
  const machine = useMemo(
    () => picture && html`<${Machine} picture=${picture} view=${view} chosen=${chosen} choose=${choose} cable=${acts?.cable ?? null} />`,
    [picture, view, chosen, acts],
  );
  return html`
    <div class="row">
      <strong class="verdict ${view.good && view.current ? "good" : "error"}" role="status">
        ${view.good && view.current ? "✔" : "✖"} ${view.title}: ${view.state}${view.good ? "" : ", with problems"}
      </strong>
      ${view.pace !== null && html`<span>${paceText(view.pace)}</span>`}
      ${source !== "file" && html`<a class="button" href=${`/api/live/document?source=${source}`} download>Save the record</a>`}
      ${source === "emulated" && !view.ended && html`<button onClick=${end}>End the run</button>`}
    </div>
    ${view.away && html`<p class="error" role="alert">${view.away}${view.ended ? "" : "; the last known state is shown"}</p>`}
    ${source === "emulated" && view.content !== state.content && html`<p class="stale">This is a run of an earlier text. Start it again to see the present one.</p>`}
    ${view.notes.map((note) => html`<p class="note" key=${note}>${note}</p>`)}
    <div class="columns">
      <div>
        ${machine}
        ${names && acts && picture && html`<${Buttons} names=${names} picture=${picture} view=${view} order=${acts} />`}
        ${source === "master" && typeof view.control === "number" && html`<${Control} view=${view} />`}
        <section class="times" aria-label="Over time">
          <${TimeBar} time=${time} />
          <${Tracks} time=${time}>
            <${Strips} past=${past} from=${time.from} to=${time.to} chosen=${connection} choose=${chooseConnection} />
            ${source !== "file" && html`<${Scope} past=${past} rows=${held.current ?? past.rows} source=${source} run=${past.run} time=${time} />`}
          </${Tracks}>
          <p class="help">${STRIP_HELP}</p>
          <${Cycle} statistics=${view.statistics} />
        </section>
      </div>
      <div class="effect">
        ${picture && html`<${Panel} chosen=${chosen} choose=${choose} picture=${picture} view=${view} names=${names} order=${acts} />`}
        <h2>Cause and effect</h2>
        ${acts && html`<p class="expect" role="status">${said || TRY}</p>`}
        ${error && html`<p class="error" role="alert">${error}</p>`}
        <${Effects} effects=${[...(view.machine && picture ? effectsOf(picture, view, past.strips) : reportsOf(view)), ...busReports(view)]} good=${GOOD} />
        <${Events} events=${past.events} leftOut=${past.left_out} time=${time} chosen=${connection} choose=${chooseConnection} />
      </div>
    </div>`;
}

const TRY = "Press the red e-stop and watch what follows. Press a cable (✂) to cut it, or a SubDevice to disconnect it. Nothing here reaches a real bus.";
const GOOD = "All connections exchange data, and nothing is out of order.";

/** Acts on the emulated run, one after the other as they were pressed; what to expect; a refusal. */
function useOrder() {
  const [said, setSaid] = useState("");
  const [error, setError] = useState("");
  const last = useRef(/** @type {Promise<unknown>} */ (Promise.resolve()));
  const order = useMemo(() => {
    const send = (/** @type {string} */ act, /** @type {Record<string, unknown>} */ body, /** @type {string} */ expect) => {
      last.current = last.current.then(async () => {
        const answer = await live(act, body);
        setError(answer.error);
        if (!answer.error) setSaid(expect);
      });
    };
    /** @type {import("./types").Order} */
    const acts = {
      command: (lines, expect) => send("command", { lines }, expect),
      hold: (ms, expect) => send("hold", { ms }, expect),
      cable: (number, whole) => send("cable", { number, whole }, whole
        ? "The cable is repaired: the SubDevices after it answer again, and their connections restart by themselves."
        : "The cable is cut: all SubDevices after it are gone at once. In a ring, frames take the other way."),
      axes: (run) => send("axes", { run }, run
        ? "The standard program enables the drives and turns them. It stops when a safety function takes the torque off, and starts again only here."
        : "The standard program disables the drives: they coast to a stop."),
    };
    return acts;
  }, []);
  return { order, said, error };
}

/** @param {number} pace */
function paceText(pace) {
  const percent = Math.round(pace * 100);
  if (percent >= 97) return "as fast as the clock";
  return `▲ ${percent} % of the speed of the clock: this computer is too slow for this network`;
}
