// The one time axis of the live page: window, cursor, zoom and pan, for strips, signals and events.
import { useEffect, useLayoutEffect, useRef, useState } from "./vendor/hooks.js";
import { colour } from "./colours.js";
import { html } from "./html.js";
import { clock } from "./live_past.js";

const LEAST_MS = 20;
const WINDOWS = [["2", "2 s"], ["10", "10 s"], ["60", "1 min"], ["600", "10 min"], ["0", "all"]];
const STEPS = [1, 2, 5];
const TICK_PX = 90;

/**
 * Times are in ms of the run; `cursor` is null without one, `isHeld`: the window does not follow,
 * `refresh` draws again.
 * @typedef {{ from: number, to: number, span: number, cursor: number | null, isHeld: boolean, oldest: number, now: number,
 *   hold: (to: number) => void, follow: () => void, show: (span: number | null) => void, isAll: boolean,
 *   point: (at: number | null) => void, zoom: (factor: number, at: number) => void, pan: (ms: number) => void,
 *   refresh: () => void }} Time
 */

/**
 * @param {number} now the newest time
 * @param {number} oldest
 * @param {boolean} isWhole the window begins with all
 * @returns {Time}
 */
export function useTime(now, oldest, isWhole) {
  const [chosen, setSpan] = useState(/** @type {number | null} */ (isWhole ? null : 10_000));
  const [end, setEnd] = useState(/** @type {number | null} */ (null));
  const [, count] = useState(0);
  const [cursor, point] = useState(/** @type {number | null} */ (null));
  const whole = Math.max(1000, now - oldest);
  const span = chosen ?? whole;
  const to = end ?? now;
  // A window that reaches the newest time follows it.
  const hold = (/** @type {number} */ at) => setEnd(at >= now ? null : Math.max(at, Math.min(now, oldest + span)));
  const zoom = (/** @type {number} */ factor, /** @type {number} */ at) => {
    const next = Math.min(whole, Math.max(LEAST_MS, span * factor));
    setSpan(next);
    if (end !== null) hold(at + ((to - at) * next) / span);
  };
  return {
    from: to - span, to, span, cursor, isHeld: end !== null, oldest, now, isAll: chosen === null,
    // Pause: the window stays, also if it shows the newest time.
    hold: (at) => (at >= now ? setEnd(now) : hold(at)),
    follow: () => setEnd(null),
    show: setSpan, point, zoom,
    pan: (ms) => hold(to + ms),
    refresh: () => count((n) => n + 1),
  };
}

/** @param {{ time: Time }} props */
export function TimeBar({ time }) {
  const { span, to, isHeld, isAll, oldest, now } = time;
  const value = isAll ? "0" : String(span / 1000);
  const known = WINDOWS.some(([seconds]) => seconds === value);
  return html`<div class="row" role="group" aria-label="Time">
    <h2>Time</h2>
    <button aria-pressed=${isHeld} onClick=${() => (isHeld ? time.follow() : time.hold(now))}>${isHeld ? "Follow again" : "Pause"}</button>
    <label>Show <select value=${value} onChange=${(/** @type {any} */ e) => time.show(e.target.value === "0" ? null : 1000 * Number(e.target.value))}>
      ${!known && html`<option value=${value}>${clock(span)}</option>`}
      ${WINDOWS.map(([seconds, text]) => html`<option value=${seconds}>${text}</option>`)}
    </select></label>
    <label class="scroll">up to <input type="range" min=${oldest} max=${now} step="10" value=${to}
      aria-valuetext=${clock(to)} onInput=${(/** @type {any} */ e) => time.hold(Number(e.target.value))} /></label>
    <output>${clock(to)}</output>
  </div>`;
}

/** Tracks share the place of their drawings: the first canvas has it. @param {any} box */
const placeOf = (box) => box.querySelector("canvas")?.getBoundingClientRect() ?? null;

/** @param {{ time: Time, children: any }} props */
export function Tracks({ time, children }) {
  const box = useRef(/** @type {HTMLElement | null} */ (null));
  const drag = useRef(/** @type {{ x: number } | null} */ (null));
  const [line, setLine] = useState(/** @type {number | null} */ (null));
  const { from, to, span, cursor, refresh } = time;
  // Tracks out of sight are not drawn: a page that is paused draws them when they come into sight.
  useEffect(() => {
    addEventListener("scroll", refresh, true); // of any part, which does not bubble
    addEventListener("resize", refresh);
    return () => {
      removeEventListener("scroll", refresh, true);
      removeEventListener("resize", refresh);
    };
  }, []);
  useLayoutEffect(() => {
    const place = placeOf(box.current);
    const inside = place && cursor !== null && cursor >= from && cursor <= to;
    const left = inside ? place.left - Number(box.current?.getBoundingClientRect().left) : 0;
    setLine(inside ? left + (place.width * (cursor - from)) / span : null);
  });
  /** The time at a pointer; null: it is not on a drawing. @param {MouseEvent} event */
  const timeAt = (event) => {
    const place = placeOf(box.current);
    if (!place || event.clientX < place.left || event.clientX > place.right) return null;
    return from + (span * (event.clientX - place.left)) / place.width;
  };
  const onMove = (/** @type {PointerEvent} */ event) => {
    const at = timeAt(event);
    if (drag.current && at !== null) {
      const place = placeOf(box.current);
      time.pan((-span * (event.clientX - drag.current.x)) / place.width);
      drag.current.x = event.clientX;
    }
    time.point(at);
  };
  const onDown = (/** @type {PointerEvent} */ event) => {
    if (event.button === 0 && timeAt(event) !== null) drag.current = { x: event.clientX };
  };
  const onWheel = (/** @type {WheelEvent} */ event) => {
    const at = timeAt(event);
    if (at === null || event.deltaY === 0) return;
    event.preventDefault(); // over the names, the page scrolls
    time.zoom(event.deltaY > 0 ? 1.25 : 0.8, at);
  };
  const onKey = (/** @type {KeyboardEvent} */ event) => {
    if (event.target !== event.currentTarget) return; // a button in a track has its own keys
    const at = cursor ?? to;
    const cursorTo = (/** @type {number} */ next) => () => time.point(Math.min(to, Math.max(from, next)));
    /** @type {Record<string, () => void>} */
    const acts = {
      "+": () => time.zoom(0.8, at),
      "-": () => time.zoom(1.25, at),
      Home: () => time.hold(time.oldest),
      End: time.follow,
      Escape: () => time.point(null),
      ArrowLeft: event.shiftKey ? cursorTo(at - span / 100) : () => time.pan(-span / 10),
      ArrowRight: event.shiftKey ? cursorTo(at + span / 100) : () => time.pan(span / 10),
    };
    const act = acts[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  };
  const end = () => (drag.current = null);
  return html`<div class="tracks" ref=${box} tabindex="0" role="group" onPointerMove=${onMove} onPointerDown=${onDown}
      onPointerUp=${end} onPointerLeave=${() => (end(), time.point(null))} onWheel=${onWheel} onKeyDown=${onKey}
      aria-label="Time axis. Arrow keys scroll, plus and minus zoom, Shift and arrow keys move the cursor, End follows.">
    <${Axis} from=${from} to=${to} oldest=${time.oldest} />
    ${children}
    ${line !== null && cursor !== null &&
    html`<div class="cursor" style=${{ left: `${line}px` }}><span>${clock(cursor)}</span></div>`}
  </div>`;
}

/** @param {{ from: number, to: number, oldest: number }} props */
function Axis({ from, to, oldest }) {
  const canvas = useRef(/** @type {HTMLCanvasElement | null} */ (null));
  useLayoutEffect(() => {
    const pen = canvas.current && penOf(canvas.current, 18);
    if (!pen) return;
    const width = pen.canvas.clientWidth;
    const step = tickStep(to - from, width);
    const digits = Math.max(0, -Math.floor(Math.log10(step / 1000)));
    pen.fillStyle = colour("dim");
    pen.font = "11px system-ui, sans-serif";
    for (let tick = Math.ceil(Math.max(from, oldest) / step) * step; tick <= to; tick += step) {
      const x = ((tick - from) / (to - from)) * width;
      pen.fillRect(x, 13, 1, 5);
      const text = `${(tick / 1000).toFixed(digits)} s`;
      const half = pen.measureText(text).width / 2;
      if (x > half && x < width - half) pen.fillText(text, x - half, 11);
    }
  });
  return html`<div class="track axis-track"><span class="legend">drag to scroll, wheel to zoom</span><canvas ref=${canvas} aria-hidden="true"></canvas></div>`;
}

/** A round step between two ticks. @param {number} span @param {number} width */
export function tickStep(span, width) {
  const least = (span * TICK_PX) / Math.max(1, width);
  const tens = 10 ** Math.floor(Math.log10(least));
  return tens * (STEPS.find((step) => step * tens >= least) ?? 10);
}

/**
 * The cleared drawing of a track, in CSS pixels; null: it is out of sight.
 * @param {HTMLCanvasElement} canvas
 * @param {number} height
 */
export function penOf(canvas, height) {
  const place = canvas.getBoundingClientRect();
  if (place.bottom < 0 || place.top > innerHeight) return null;
  const ratio = devicePixelRatio;
  // Setting the size clears a canvas and costs time, so that it is set on a change only.
  if (canvas.width !== Math.round(place.width * ratio)) {
    canvas.width = Math.round(place.width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  if (!pen) return null;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, place.width, height);
  return pen;
}
