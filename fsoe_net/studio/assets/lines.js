// The FSoE connections of the drawing: a line from slot to slot, with its facts and its last try.
import { html, SEVERITIES, worst } from "./html.js";

/** @typedef {import("./types").Connection} Connection */
/** @typedef {import("./types").TriedConnection} TriedConnection */
/**
 * `roomy`: the facts of the connection fit between its ends.
 * @typedef {{ path: string, x: number, y: number, anchor: "start" | "end", roomy: boolean }} Curve */

const FACTS_PX = 230; // of an address, a ConnID and a watchdog
const BENDS_PX = 40;

/**
 * The path of each connection from port to port, and where its facts are written.
 * @param {HTMLElement} board
 * @param {Connection[]} connections
 * @returns {(Curve | null)[]}
 */
export function curves(board, connections) {
  const origin = board.getBoundingClientRect();
  const zoom = origin.width / board.offsetWidth || 1;
  /** @type {Map<string | undefined, number[]>} */
  const at = new Map();
  for (const port of /** @type {NodeListOf<HTMLElement>} */ (board.querySelectorAll("[data-port]"))) {
    const box = port.getBoundingClientRect();
    const middle = [box.left + box.width / 2 - origin.left, box.top + box.height / 2 - origin.top];
    at.set(port.dataset.port, middle.map((px) => px / zoom));
  }
  return connections.map((c) => {
    const begin = at.get(`${c.main}/${c.slot}`);
    const end = at.get(`${c.sub}/${c.sub_slot}`);
    return begin && end ? curve(begin, end) : null;
  });
}

/**
 * @param {number[]} begin
 * @param {number[]} end
 * @returns {Curve}
 */
function curve([x, y], [toX, toY]) {
  if (toX - x < BENDS_PX) {
    // Both in one column: a loop next to it.
    const path = `M${x} ${y} C${x + 60} ${y} ${toX + 60} ${toY} ${toX} ${toY}`;
    return { path, x: toX + 24, y: toY - 6, anchor: "start", roomy: true };
  }
  const roomy = toX - x > FACTS_PX + BENDS_PX;
  // Lines bend before the place of the facts, so that no other line crosses those.
  const bent = roomy ? toX - FACTS_PX : toX;
  const middle = (x + bent) / 2;
  const path = `M${x} ${y} C${middle} ${y} ${middle} ${toY} ${bent} ${toY} L${toX} ${toY}`;
  return { path, x: toX - 26, y: toY - 5, anchor: "end", roomy };
}

/**
 * The facts of a connection that its files state.
 * @param {Connection} c
 */
const facts = (c) =>
  [
    c.address !== null && `address ${c.address}`,
    c.connection_id !== null && `ConnID ${c.connection_id}`,
    c.watchdog_ms !== null && `${c.watchdog_ms} ms`,
  ].filter(Boolean);

/**
 * What came of the last try, in words; empty: not tried.
 * @param {TriedConnection | undefined} tried
 */
function outcome(tried) {
  if (!tried) return "";
  if (tried.absent) return `– ${tried.state}`;
  if (tried.in_data) return `✔ ${tried.state} after ${tried.time_to_data_ms} ms`;
  return `✖ stopped in ${tried.state}${tried.last_reset && `: ${tried.last_reset}`}`;
}

/** @param {any} props */
export function Line({ curve, connection, number, findings, tried, chosen, choose }) {
  const severity = worst(findings);
  const known = facts(connection);
  const open = connection.unconfirmed === null ? "" : "not confirmed";
  const said = severity && severity !== "info" ? SEVERITIES[severity][1] : "";
  const came = outcome(tried);
  const words = [`${connection.main} to ${connection.sub}`, ...known, open, said, came].filter(Boolean);
  const onKey = (/** @type {KeyboardEvent} */ event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    choose({ connection: number });
  };
  return html`<g class="line ${severity} ${chosen ? "chosen" : ""} ${open ? "open" : ""}"
      role="button" tabindex="0" aria-pressed=${chosen} aria-label=${`Connection ${words.join(", ")}`}
      onClick=${() => choose({ connection: number })} onKeyDown=${onKey}>
    <path class="wide" d=${curve.path} /><path class="thin" d=${curve.path} />
    ${curve.roomy &&
    html`<text x=${curve.x} y=${curve.y} text-anchor=${curve.anchor}>${[open, ...known].filter(Boolean).join(" · ")}</text>`}
    ${curve.roomy && came &&
    html`<text class="came ${tried.absent || tried.in_data ? "" : "error"}" x=${curve.x} y=${curve.y + 19}
      text-anchor=${curve.anchor}><title>${came}</title>${came.length > 36 ? `${came.slice(0, 35)}…` : came}</text>`}
  </g>`;
}
