// Each connection as a strip of its states over time, with a mark for every Reset.
import { useLayoutEffect, useMemo, useRef } from "./vendor/hooks.js";
import { colour } from "./colours.js";
import { html } from "./html.js";
import { DATA, FAILSAFE, LEVELS, PROCESS, lastBefore } from "./live_past.js";
import { penOf } from "./live_time.js";

/** @typedef {import("./types").LiveConnection} LiveConnection */
/** @typedef {import("./live_past.js").Past} Past */
/** @typedef {import("./live_past.js").Strip} Strip */

const HEIGHT = 30;
const TOP = 9; // above the states: the marks

/** A mark and a colour for each level of health. @type {Record<import("./types").HealthLevel, [string, string]>} */
export const MARKS = {
  good: ["✔", "good"],
  unknown: ["–", "dim"],
  warning: ["◐", "warning"],
  error: ["✖", "error"],
};

/**
 * @param {{ past: Past, from: number, to: number, chosen: string, choose: (name: string) => void }} props
 */
export function Strips({ past, from, to, chosen, choose }) {
  const list = useRef(/** @type {HTMLElement | null} */ (null));
  const connections = past.view?.connections ?? [];
  // Without dependencies: the strips move with time, whatever has changed.
  useLayoutEffect(() => void (list.current && draw(list.current, past, from, to)));
  const there = connections.filter((c) => !c.absent);
  const up = there.filter((c) => c.in_data).length;
  const count = `${up === there.length ? "✔" : "✖"} ${up} of ${there.length} in Data`;
  return html`<section class="strips" aria-label="Connections over time">
    <h3>Connections <small role="status">${there.length ? count : "None are known yet."}</small></h3>
    <ol ref=${list}>
      ${connections.map((c) => html`<${Row} key=${c.name} connection=${c} chosen=${chosen === c.name} choose=${choose} />`)}
    </ol>
  </section>`;
}

/** @param {{ connection: LiveConnection, chosen: boolean, choose: (name: string) => void }} props */
function Row({ connection: { name, state, absent, level }, chosen, choose }) {
  // Kept while it is the same: most of many connections are.
  return useMemo(() => {
    const [shape, colour] = absent ? MARKS.unknown : MARKS[level];
    return html`<li class="track ${chosen ? "chosen" : ""}">
      <span class="legend"><button class="name" aria-pressed=${chosen} onClick=${() => choose(chosen ? "" : name)}>${name}</button>
      <span class="state ${colour}">${shape} ${absent ? "absent, as it may be" : state}</span></span>
      <canvas role="img" aria-label=${`States of ${name} over time`}></canvas>
    </li>`;
  }, [name, state, absent, level, chosen]);
}

/** What the levels of a strip are. */
export const STRIP_HELP = `From low to high: ${LEVELS.map((l) => l.replace("Data · ", "")).join(", ")}. ▼ is a Reset.`;

/** Times and counters of a connection. @param {LiveConnection} c */
export function figures(c) {
  const cycle = `FSoE cycle ${c.last_ms.toFixed(1)} ms, longest ${c.max_ms.toFixed(1)}`;
  const share = c.share === null || c.watchdog_ms === null ? "" : ` = ${(100 * c.share).toFixed(0)} % of ${c.watchdog_ms} ms`;
  const rest = [[c.wrong, "with wrong CRC"], [c.gaps, "gaps"], [c.held, "cycles held"]]
    .filter(([count]) => count)
    .map(([count, what]) => `, ${count} ${what}`);
  const id = c.connection_id === null ? "" : `ConnID ${c.connection_id} · `;
  return `${id}${c.max_ms ? cycle + share : "no FSoE cycle yet"} · ${c.resets} ${c.resets === 1 ? "Reset" : "Resets"}${rest.join("")}`;
}

/** @param {HTMLElement} list @param {Past} past @param {number} from @param {number} to */
function draw(list, past, from, to) {
  const canvases = list.querySelectorAll("canvas");
  const colours = {
    edge: colour("edge"), ink: colour("ink"), main: colour("main"), error: colour("error"), paper: colour("paper"),
    low: colour("strip-low"), mid: colour("strip-mid"), failsafe: colour("strip-failsafe"), process: colour("strip-process"),
  };
  const connections = past.view?.connections ?? [];
  // All rows have one height: those in sight are known without asking each.
  const { top, height } = list.getBoundingClientRect();
  const each = height / Math.max(1, connections.length);
  for (let n = Math.max(0, Math.floor(-top / each)); n < connections.length && top + n * each < innerHeight; n++) {
    const strip = past.strips.get(connections[n].name);
    const pen = strip && penOf(canvases[n], HEIGHT);
    if (pen) drawStrip(pen, strip, canvases[n].clientWidth, from, Math.max(to, from + 1), past.view?.now_ms ?? to, colours);
  }
}

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {Strip} strip
 * @param {number} width
 * @param {number} from
 * @param {number} to
 * @param {number} now
 * @param {Record<string, string>} colours
 */
function drawStrip(pen, strip, width, from, to, now, colours) {
  // The wire is what was seen; states of the ends are known for emulated runs only.
  const states = strip.wire.length ? strip.wire : strip.ends;
  const at = (/** @type {number} */ time) => ((time - from) / (to - from)) * width;
  const floor = HEIGHT - 2;
  pen.font = "11px system-ui, sans-serif";
  pen.textBaseline = "middle";
  for (let n = Math.max(0, lastBefore(states, from, (row) => row[0])); n < states.length && states[n][0] < to; n++) {
    const [begin, state] = states[n];
    const left = Math.max(0, at(begin));
    const right = Math.min(width, at(n + 1 < states.length ? states[n + 1][0] : now));
    const level = Math.max(0, LEVELS.indexOf(state));
    const high = 2 + ((floor - TOP - 2) * level) / (LEVELS.length - 1);
    const known = { [PROCESS]: colours.process, [DATA]: colours.main }[state];
    pen.fillStyle = known ? known : level > 6 ? colours.failsafe : level > 2 ? colours.mid : colours.low;
    // At least a pixel: a short reset must be visible.
    pen.fillRect(left, floor - high, Math.max(1, right - left), high);
    if (state === FAILSAFE) hatch(pen, left, right, floor, high, colours.paper);
    const word = state.replace("Data · ", "");
    if (level > 6 && right - left > pen.measureText(word).width + 8) {
      pen.fillStyle = colours.paper;
      if (state === FAILSAFE) label(pen, word, left + 4, floor - high / 2, colours);
      else pen.fillText(word, left + 4, floor - high / 2);
    }
  }
  pen.fillStyle = colours.edge;
  pen.fillRect(0, floor, width, 1);
  pen.fillStyle = colours.error;
  for (let n = lastBefore(strip.marks, to, (m) => m.time_ms); n >= 0 && strip.marks[n].time_ms >= from; n--) {
    const x = at(strip.marks[n].time_ms);
    pen.beginPath();
    pen.moveTo(x - 4, 0);
    pen.lineTo(x + 4, 0);
    pen.lineTo(x, TOP - 2);
    pen.fill();
    pen.fillRect(x - 0.5, TOP - 2, 1, floor - TOP + 2);
  }
}

/** A word that can be read on stripes. @param {any} pen @param {string} word @param {number} x @param {number} y @param {Record<string, string>} colours */
function label(pen, word, x, y, colours) {
  const wide = pen.measureText(word).width;
  pen.fillStyle = colours.paper;
  pen.fillRect(x - 2, y - 7, wide + 4, 14);
  pen.fillStyle = colours.ink;
  pen.fillText(word, x, y);
}

/** @param {CanvasRenderingContext2D} pen @param {number} left @param {number} right @param {number} floor @param {number} high @param {string} colour */
function hatch(pen, left, right, floor, high, colour) {
  pen.save();
  pen.beginPath();
  pen.rect(left, floor - high, right - left, high);
  pen.clip();
  pen.strokeStyle = colour;
  pen.lineWidth = 2;
  pen.beginPath();
  for (let x = left - (left % 8) - 24; x < right; x += 8) {
    pen.moveTo(x, floor);
    pen.lineTo(x + high, floor - high);
  }
  pen.stroke();
  pen.restore();
}
