// The bus of the live page: working counter, times of the cycle, events.
import { useMemo, useState } from "./vendor/hooks.js";
import { html } from "./html.js";
import { clock, lastBefore } from "./live_past.js";

/** @typedef {import("./types").LiveStatistics} LiveStatistics */
/** @typedef {import("./types").LiveEvent} LiveEvent */

const SHOWN = 200;

/** @type {Record<string, string>} */
const TIMES = {
  period: "from cycle to cycle",
  latency: "late wake-up",
  work: "work in a cycle",
  round_trip: "round trip of a frame",
};

/** @param {{ statistics: LiveStatistics | null }} props */
export function Cycle({ statistics }) {
  const [name, setName] = useState("period");
  if (!statistics) return null;
  const s = statistics;
  const names = Object.keys(s.histograms);
  const shown = names.includes(name) ? name : names[0];
  return html`<details class="bus-cycle">
    <summary>Bus cycle: working counter ${s.actual_wkc} of ${s.expected_wkc}</summary>
    <p>
      ${s.cycles} cycles, ${s.wkc_errors} incomplete, ${s.lost_frames} frames lost, ${s.overruns} overruns
    </p>
    ${shown &&
    html`<label>Time <select value=${shown} onChange=${(/** @type {any} */ e) => setName(e.target.value)}>
        ${names.map((key) => html`<option value=${key}>${TIMES[key] ?? key}</option>`)}
      </select></label>
      <${Bars} histogram=${s.histograms[shown]} name=${TIMES[shown] ?? shown} />`}
  </details>`;
}

const us = (/** @type {number} */ ns) => `${(ns / 1000).toFixed(ns < 10_000 ? 1 : 0)} µs`;

/** @param {{ histogram: import("./types").Histogram, name: string }} props */
function Bars({ histogram: h, name }) {
  // Logarithmic: one late cycle among millions must be visible.
  const tops = h.bars.map(([, times]) => Math.log10(times + 1));
  const top = Math.max(...tops, 1);
  const step = 100 / Math.max(1, tops.length);
  const text = `mean ${us(h.mean_ns)}, 99 % below ${us(h.p99_ns)}, longest ${us(h.max_ns)}`;
  return html`<svg class="bars" viewBox="0 0 100 30" preserveAspectRatio="none" role="img"
      aria-label=${`${name}: how often which time, log scale; ${text}`}>
      ${tops.map((t, n) => html`<rect key=${n} x=${n * step} width=${step * 0.9} y=${30 - (29 * t) / top} height=${(29 * t) / top} />`)}
    </svg>
    <p class="ends"><small>${us(h.bars[0][0])}</small><small>how often, log scale</small><small>${us(h.bars[h.bars.length - 1][0])}</small></p>
    <p><small>${text}</small></p>`;
}

/**
 * @param {{ events: LiveEvent[], leftOut: number, time: import("./live_time.js").Time, chosen: string,
 *   choose: (name: string) => void }} props
 */
export function Events({ events, leftOut, time, chosen, choose }) {
  const [resetsOnly, setResetsOnly] = useState(false);
  const { to, cursor } = time;
  const last = lastBefore(events, to, (e) => e.time_ms);
  // From the newest event back: of a long run only the last ones are built, and only when there are others.
  const shown = useMemo(() => {
    /** @type {[number, LiveEvent][]} */
    const rows = [];
    for (let n = last; n >= 0 && rows.length < SHOWN; n--) {
      const e = events[n];
      if ((!chosen || e.source === chosen) && (!resetsOnly || e.kind === "reset")) rows.push([n + leftOut, e]);
    }
    return rows;
  }, [events, last + leftOut, chosen, resetsOnly]);
  // Of several events at one time, all are marked.
  const marked = cursor === null ? null : shown.find(([, e]) => e.time_ms <= cursor)?.[1].time_ms;
  const onKey = (/** @type {KeyboardEvent} */ event) => {
    const at = cursor ?? Infinity;
    const next = {
      ArrowUp: shown.findLast(([, e]) => e.time_ms > at),
      ArrowDown: shown.find(([, e]) => e.time_ms < at),
    }[event.key];
    if (!next) return;
    event.preventDefault(); // the list would scroll
    time.point(next[1].time_ms);
  };
  const rows = useMemo(() => shown.map(([n, e]) => html`<li key=${n} class=${e.kind === "reset" ? "reset" : ""} aria-current=${e.time_ms === marked ? "true" : undefined}
        onMouseEnter=${() => time.point(e.time_ms)} onMouseLeave=${() => time.point(null)}>
      <code>${clock(e.time_ms)}</code> ${e.kind === "reset" ? "▼ " : ""}${e.source}: ${e.text}
    </li>`), [shown, marked]);
  return html`<section class="log" aria-label="Events">
    <p class="row">
      <b>Events, the newest first</b>
      <label><input type="checkbox" checked=${resetsOnly} onChange=${() => setResetsOnly(!resetsOnly)} /> Resets only</label>
      ${chosen && html`<button onClick=${() => choose("")}>of ${chosen}: show all</button>`}
    </p>
    <ol class="events" tabindex="0" aria-label="Events: arrow keys move the cursor of the time axis" onKeyDown=${onKey}>
      ${rows}
    </ol>
    ${leftOut > 0 && html`<p><small>${leftOut} earlier events are no longer kept.</small></p>`}
  </section>`;
}
