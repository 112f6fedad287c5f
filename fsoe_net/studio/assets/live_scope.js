// Values of several signals at every cycle: ten seconds, each signal in a lane of its own.
import { useEffect, useLayoutEffect, useRef, useState } from "./vendor/hooks.js";
import uPlot from "./vendor/uplot.js";
import { colour } from "./colours.js";
import { html } from "./html.js";
import { get, live } from "./live_server.js";

/** @typedef {import("./live_past.js").Past} Past */
/** @typedef {(number | null)[][]} Rows */

const LANE_PX = 34;
const DASHES = [[], [6, 3], [2, 3], [10, 3, 2, 3]];

/** @param {{ past: Past, rows: Rows, source: string, run: string, seconds: number }} props */
export function Scope({ past, rows, source, run, seconds }) {
  const box = useRef(/** @type {HTMLElement | null} */ (null));
  const plot = useRef(/** @type {any} */ (null));
  const [known, setKnown] = useState(/** @type {import("./types").SignalChoice[]} */ ([]));
  const [error, setError] = useState("");
  const { signals } = past;
  const choose = async (/** @type {string[]} */ names) => setError((await live("scope", { source, signals: names })).error);
  const list = async () => {
    const answer = await get(`/signals?source=${source}`);
    setError(answer.error);
    setKnown(answer.signals ?? []);
  };
  useEffect(() => void list(), [source, run]);

  const last = rows.length ? Number(rows[rows.length - 1][0]) : 0;
  const data = columns(rows, signals.length, last - seconds * 1000, 1000);
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  useLayoutEffect(() => {
    if (!box.current || !signals.length) return;
    plot.current = make(box.current, signals);
    // The plot has a fixed size in pixels and does not follow its box.
    const watcher = new ResizeObserver(() => plot.current?.setSize(sizeOf(box.current, signals.length)));
    watcher.observe(box.current);
    return () => {
      watcher.disconnect();
      plot.current?.destroy();
      plot.current = null;
    };
  // Colours are read when the plot is made; a change of the colour scheme makes it again.
  }, [past.choice, signals.length, run, dark]);
  useLayoutEffect(() => plot.current?.setData(data.lanes));

  const free = known.filter((s) => !signals.includes(s.name));
  const kinds = [...new Set(free.map((s) => s.kind))];
  return html`<section class="scope" aria-label="Scope">
    <h2>Scope</h2>
    <p class="row">
      <label>Add a signal <select value="" onFocus=${() => known.length || list()}
        onChange=${(/** @type {any} */ e) => e.target.value && choose([...signals, e.target.value])}>
        <option value="">choose …</option>
        ${kinds.map((kind) => html`<optgroup label=${kind}>
          ${free.filter((s) => s.kind === kind).map((s) => html`<option value=${s.name}>${s.name}${s.label && ` (${s.label})`}</option>`)}
        </optgroup>`)}
      </select></label>
      <small>every cycle of the last ${seconds} s${past.skipped > 0 && `; ${past.skipped} cycles are missing`}</small>
    </p>
    ${(error || past.fault) && html`<p class="error" role="alert">${error || past.fault}</p>`}
    <div ref=${box} class="plot" role="img" aria-label=${`Values of ${signals.join(", ") || "no signal"}`}></div>
    ${signals.length > 0 &&
    html`<table>
      <thead><tr><th scope="col">signal, from the top</th><th scope="col">last</th><th scope="col">least</th><th scope="col">most</th><th scope="col"><span class="unseen">Take away</span></th></tr></thead>
      <tbody>
        ${signals.map((name, n) => html`<tr key=${name}>
          <th scope="row">${n + 1}. ${name}</th>
          ${data.facts[n].map((v) => html`<td>${v === null ? "–" : Number(v.toPrecision(6))}</td>`)}
          <td><button aria-label=${`Take ${name} away`} onClick=${() => choose(signals.filter((s) => s !== name))}>✕</button></td>
        </tr>`)}
      </tbody>
    </table>`}
  </section>`;
}

/**
 * What uPlot draws: of very many cycles the least and most of each column, as values in lanes.
 * @param {Rows} rows
 * @param {number} count of signals
 * @param {number} from ms
 * @param {number} most columns
 * @returns {{ lanes: (number | null)[][], facts: (number | null)[][] }}
 */
export function columns(rows, count, from, most) {
  // The rows are in order of time: the search runs from the end of the window.
  let begin = rows.length;
  while (begin > 0 && Number(rows[begin - 1][0]) >= from) begin--;
  const size = Math.max(1, Math.ceil((rows.length - begin) / most));
  const [lows, highs, lasts] = [Array(count).fill(Infinity), Array(count).fill(-Infinity), Array(count).fill(null)];
  /** @type {(number | null)[][]} */
  const lanes = Array.from({ length: count + 1 }, () => []);
  for (let at = begin; at < rows.length; at += size) {
    const end = Math.min(rows.length, at + size);
    lanes[0].push(Number(rows[at][0]) / 1000);
    if (size > 1) lanes[0].push(Number(rows[end - 1][0]) / 1000);
    for (let s = 0; s < count; s++) {
      // Least and most are drawn in the order in which they came, so that an edge keeps its direction.
      let [low, high, rises] = [Infinity, -Infinity, true];
      for (let n = at; n < end; n++) {
        const value = rows[n][s + 1];
        // A gap must not look like a value.
        if (value === null) continue;
        if (value < low) [low, rises] = [value, high === -Infinity];
        if (value > high) high = value;
        lasts[s] = value;
      }
      if (low < lows[s]) lows[s] = low;
      if (high > highs[s]) highs[s] = high;
      const none = low === Infinity;
      if (size === 1) lanes[s + 1].push(none ? null : low);
      else lanes[s + 1].push(none ? null : rises ? low : high, none ? null : rises ? high : low);
    }
  }
  for (let s = 0; s < count; s++) {
    const [foot, span] = [count - 1 - s + 0.1, highs[s] - lows[s]];
    const up = span > 0 ? 0 : lows[s] === 0 ? 0 : 0.8; // one that never changes lies low at 0
    lanes[s + 1] = lanes[s + 1].map((v) => (v === null ? null : foot + (span > 0 ? (0.8 * (v - lows[s])) / span : up)));
  }
  const known = (/** @type {number} */ v) => (Number.isFinite(v) ? v : null);
  return { lanes, facts: lasts.map((v, s) => [v, known(lows[s]), known(highs[s])]) };
}

/** @param {HTMLElement | null} box @param {number} count */
const sizeOf = (box, count) => ({ width: box?.clientWidth || 600, height: 40 + LANE_PX * Math.max(2, count) });

/** @param {HTMLElement} box @param {string[]} signals */
function make(box, signals) {
  const colours = [colour("main"), colour("sub"), colour("warning"), colour("error")];
  const count = signals.length;
  const axis = { stroke: colour("ink"), grid: { stroke: colour("edge"), width: 0.5 }, ticks: { stroke: colour("edge") } };
  const options = {
    ...sizeOf(box, count),
    legend: { show: false },
    cursor: { drag: { x: false, y: false } },
    scales: { x: { time: false }, y: { range: () => [0, count] } },
    axes: [
      { ...axis, values: (/** @type {any} */ _, /** @type {number[]} */ ticks) => ticks.map((t) => `${+t.toFixed(3)} s`) },
      { ...axis, size: 40, splits: () => signals.map((_, n) => count - 0.5 - n), grid: { show: false },
        values: () => signals.map((_, n) => `${n + 1}.`) },
    ],
    series: [{}, ...signals.map((name, n) => ({
      label: name, stroke: colours[n % colours.length], width: 1.5, dash: DASHES[Math.floor(n / colours.length) % DASHES.length],
      paths: uPlot.paths.stepped({ align: 1 }), points: { show: false }, spanGaps: false,
    }))],
  };
  return new uPlot(options, [[], ...signals.map(() => [])], box);
}
