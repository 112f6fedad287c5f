// Values of several signals at every cycle of the last ten seconds, each in a track of its own.
import { useEffect, useLayoutEffect, useMemo, useRef, useState } from "./vendor/hooks.js";
import { colour } from "./colours.js";
import { html } from "./html.js";
import { lastBefore } from "./live_past.js";
import { get, live } from "./live_server.js";
import { penOf } from "./live_time.js";

/** @typedef {import("./live_past.js").Past} Past */
/** @typedef {(number | null)[][]} Rows */
/** @typedef {{ low: number, high: number }} Range */

const HEIGHT = 30;

/** @param {(number | null)[]} row */
const timeOf = (row) => Number(row[0]);

/**
 * @param {{ past: Past, rows: Rows, source: string, run: string, time: import("./live_time.js").Time }} props
 */
export function Scope({ past, rows, source, run, time }) {
  const list = useRef(/** @type {HTMLElement | null} */ (null));
  const [known, setKnown] = useState(/** @type {import("./types").SignalChoice[]} */ ([]));
  const [error, setError] = useState("");
  const { signals } = past;
  const { from, to, cursor } = time;
  const choose = async (/** @type {string[]} */ names) => setError((await live("scope", { source, signals: names })).error);
  const ask = async () => {
    const answer = await get(`/signals?source=${source}`);
    setError(answer.error);
    setKnown(answer.signals ?? []);
  };
  useEffect(() => void ask(), [source, run]);
  const [first, last] = [Math.max(0, lastBefore(rows, from, timeOf)), lastBefore(rows, to, timeOf)];
  const ranges = signals.map((_, n) => rangeOf(rows, n + 1, first, last));
  useLayoutEffect(() => {
    list.current?.querySelectorAll("canvas").forEach((canvas, n) => {
      const pen = ranges[n] && penOf(canvas, HEIGHT);
      if (pen) drawSignal(pen, { rows, column: n + 1, first, last, range: ranges[n] }, from, to);
    });
  });
  const shown = lastBefore(rows, cursor ?? to, timeOf);
  const labels = new Map(known.map((s) => [s.name, s.label]));
  // A large network has thousands of signals, and the list changes with the choice only.
  const options = useMemo(() => {
    const free = known.filter((s) => !signals.includes(s.name));
    return [...new Set(free.map((s) => s.kind))].map((kind) => html`<optgroup label=${kind}>
      ${free.filter((s) => s.kind === kind).map((s) => html`<option value=${s.name}>${s.label ? `${s.label} (${s.name})` : s.name}</option>`)}
    </optgroup>`);
  }, [known, past.choice]);
  return html`<section class="scope" aria-label="Scope">
    <h3>Signals <small>every cycle of the last 10 s${past.skipped > 0 && `; ${past.skipped} cycles are missing`}</small>
      <label>Add a signal <select value="" onFocus=${() => known.length || ask()}
        onChange=${(/** @type {any} */ e) => e.target.value && choose([...signals, e.target.value])}>
        <option value="">choose …</option>
        ${options}
      </select></label></h3>
    ${(error || past.fault) && html`<p class="error" role="alert">${error || past.fault}</p>`}
    <ol ref=${list}>
      ${signals.map((name, n) => html`<li class="track" key=${name}>
        <span class="legend">
          <button class="away" aria-label=${`Take ${name} away`} onClick=${() => choose(signals.filter((s) => s !== name))}>✕</button>
          <span class="name" title=${name}>${labels.get(name) || name}${labels.get(name) && html` <small>${name}</small>`}</span>
          <output class="value">${shown < 0 ? "–" : valueText(rows[shown][n + 1])}</output>
        </span>
        <canvas role="img" aria-label=${`Values of ${labels.get(name) || name}, ${rangeText(ranges[n])}`}></canvas>
      </li>`)}
    </ol>
  </section>`;
}

/** @param {number | null | undefined} value */
const valueText = (value) => (value === null || value === undefined ? "–" : String(Number(value.toPrecision(6))));

/** @param {Range} range */
const rangeText = ({ low, high }) => (low > high ? "none yet" : `from ${valueText(low)} to ${valueText(high)}`);

/** The least and the most of a signal. @param {Rows} rows @param {number} column @param {number} first @param {number} last */
export function rangeOf(rows, column, first, last) {
  const range = { low: Infinity, high: -Infinity };
  for (let n = first; n <= last; n++) {
    const value = rows[n][column];
    if (value === null) continue;
    if (value < range.low) range.low = value;
    if (value > range.high) range.high = value;
  }
  return range;
}

/**
 * Points of a stepped line: time and value where the value changes; a gap has the value null.
 * Between two steps of `every` ms only the first, least, most and last value are kept.
 * @param {Rows} rows
 * @param {number} column
 * @param {number} first
 * @param {number} last
 * @param {number} every
 * @returns {[number, number | null][]}
 */
export function stepsOf(rows, column, first, last, every) {
  /** @type {[number, number | null][]} */
  const found = [];
  for (let begin = first; begin <= last; ) {
    const at = timeOf(rows[begin]);
    const group = [begin];
    let end = begin;
    let [low, high] = [begin, begin];
    for (; end <= last && timeOf(rows[end]) < at + every; end++) {
      const value = rows[end][column];
      if (value === null) group.push(end); // a gap must not look like a value
      else if (value < (rows[low][column] ?? Infinity)) low = end;
      else if (value > (rows[high][column] ?? -Infinity)) high = end;
    }
    end = Math.max(end, begin + 1);
    for (const n of [...new Set([...group, low, high, end - 1])].sort((one, two) => one - two)) {
      const value = rows[n][column];
      if (!found.length || found[found.length - 1][1] !== value) found.push([timeOf(rows[n]), value]);
    }
    begin = end;
  }
  return found;
}

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {{ rows: Rows, column: number, first: number, last: number, range: Range }} signal
 * @param {number} from
 * @param {number} to
 */
function drawSignal(pen, { rows, column, first, last, range: { low, high } }, from, to) {
  const width = pen.canvas.clientWidth;
  const x = (/** @type {number} */ time) => ((time - from) / (to - from)) * width;
  const foot = HEIGHT - 4;
  // A value that never changes is low at 0, and high otherwise.
  const flat = low === 0 ? foot : 5;
  const y = (/** @type {number} */ value) => (high > low ? foot - ((value - low) / (high - low)) * (foot - 5) : flat);
  pen.strokeStyle = colour("edge");
  pen.lineWidth = 0.5;
  pen.strokeRect(0, foot + 2, width, 0);
  pen.strokeStyle = colour("main");
  pen.lineWidth = 1.5;
  pen.beginPath();
  let before = /** @type {number | null} */ (null);
  for (const [time, value] of stepsOf(rows, column, first, last, (to - from) / Math.max(1, width))) {
    if (before !== null) pen.lineTo(x(time), y(before));
    if (value !== null) (before === null ? pen.moveTo : pen.lineTo).call(pen, x(time), y(value));
    before = value;
  }
  if (before !== null && last >= 0) pen.lineTo(Math.min(width, x(timeOf(rows[last]))), y(before));
  pen.stroke();
}
