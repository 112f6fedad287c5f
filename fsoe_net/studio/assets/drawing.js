// The bus as a line, and its FSoE connections between slots: MainInstances left, SubInstances right.
import { useEffect, useLayoutEffect, useRef, useState } from "./vendor/hooks.js";
import { Bus } from "./bus.js";
import { html, Mark, ROLES, SEVERITIES, worst } from "./html.js";

/** @typedef {import("./types").State} State */
/** @typedef {import("./types").SubDevice} SubDevice */
/** @typedef {import("./types").Port} Port */
/** @typedef {import("./types").Selected} Selected */
/**
 * `roomy`: the facts of the connection fit between its ends.
 * @typedef {{ path: string, x: number, y: number, anchor: "start" | "end",
 *   roomy: boolean }} Curve */

const FACTS_PX = 230; // of an address, a ConnID and a watchdog

/**
 * Why two ends cannot be connected; empty: they can.
 * @param {Port} from
 * @param {Port} to
 */
export function obstacle(from, to) {
  // The order is from the most general reason to the most specific one.
  if (from.subdevice === to.subdevice) return "the same SubDevice";
  if (to.pair.connection !== null) return "in use already";
  if (!from.pair.matched || !to.pair.matched) return "its two frames do not belong together";
  if (from.pair.sends_bytes !== to.pair.takes_bytes)
    return `sends ${from.pair.sends_bytes} bytes, ${to.pair.takes_bytes} are taken there`;
  if (from.pair.takes_bytes !== to.pair.sends_bytes)
    return `takes ${from.pair.takes_bytes} bytes, ${to.pair.sends_bytes} come from there`;
  return "";
}

/** @param {SubDevice} sub */
// Without a role in the file, a SubDevice with several slots is taken as safety logic.
const isLeft = (sub) =>
  sub.role
    ? sub.role !== "sub"
    : sub.likely === "main" || (sub.likely === "" && sub.pairs.length > 1);

/**
 * @param {{ state: State, stale: boolean, selected: Selected,
 *   choose: (what: Selected) => void, act: (name: string, body: object) => void }} props
 */
export function Drawing({ state, stale, selected, choose, act }) {
  const [from, setFrom] = useState(/** @type {Port | null} */ (null));
  const [lines, setLines] = useState(/** @type {(Curve | null)[]} */ ([]));
  const board = useRef(/** @type {HTMLElement | null} */ (null));

  useEffect(() => {
    const onKey = (/** @type {KeyboardEvent} */ event) => event.key === "Escape" && setFrom(null);
    document.addEventListener("keydown", onKey);
    return () => document.removeEventListener("keydown", onKey);
  }, []);

  const place = () => {
    if (board.current) setLines(curves(board.current, state.connections));
  };
  // After layout and before paint: lines drawn later would jump.
  useLayoutEffect(place, [state]);
  useEffect(() => {
    const watcher = new ResizeObserver(place);
    // A card can change its height without a change of the state, for example when fonts arrive.
    if (board.current) watcher.observe(board.current);
    return () => watcher.disconnect();
  }, [state]);

  const connect = (/** @type {Port} */ to) => {
    if (from === null || obstacle(from, to)) return;
    setFrom(null);
    act("change", {
      change: "connect",
      main: from.subdevice,
      slot: from.pair.slot,
      sub: to.subdevice,
      sub_slot: to.pair.slot,
    });
  };
  const cards = (/** @type {SubDevice[]} */ subs) =>
    subs.map(
      (sub) => html`<${Card} key=${sub.name} sub=${sub} state=${state} from=${from}
        setFrom=${setFrom} connect=${connect} selected=${selected} choose=${choose} />`,
    );
  const withPairs = state.subdevices.filter((s) => s.pairs.length > 0);
  return html`
    <${Bus} state=${state} selected=${selected} choose=${choose} act=${act} />
    <p class="help" role="status">
      ${from
        ? `Connect ${from.subdevice}, slot ${from.pair.slot}: choose a highlighted slot. Escape cancels.`
        : "Drag from a free slot of safety logic to a SubInstance, or click one after the other."}
    </p>
    <div class="board ${stale ? "stale" : ""}" ref=${board}>
      <svg class="lines" role="group" aria-label="FSoE connections">
        ${state.connections.map(
          (c, number) =>
            // A connection may name a slot that does not exist; then there is no line.
            lines[number] &&
            html`<${Line} key=${number} curve=${lines[number]} connection=${c} number=${number}
              findings=${state.findings.filter((f) => f.connections.includes(number))}
              selected=${selected} choose=${choose} />`,
        )}
      </svg>
      <div class="column">
        <h2>MainInstances</h2>
        ${cards(withPairs.filter(isLeft))}
      </div>
      <div class="column right">
        <h2>SubInstances</h2>
        ${cards(withPairs.filter((s) => !isLeft(s)))}
      </div>
    </div>
  `;
}

/**
 * The path of each connection from port to port, and where its facts are written.
 * @param {HTMLElement} board
 * @param {import("./types").Connection[]} connections
 */
function curves(board, connections) {
  const origin = board.getBoundingClientRect();
  const at = (/** @type {string} */ name, /** @type {number | null} */ slot) => {
    const port = board.querySelector(`[data-port="${CSS.escape(`${name}/${slot}`)}"]`);
    if (!port) return null;
    const box = port.getBoundingClientRect();
    return [box.left + box.width / 2 - origin.left, box.top + box.height / 2 - origin.top];
  };
  return connections.map((c) => {
    const [begin, end] = [at(c.main, c.slot), at(c.sub, c.sub_slot)];
    if (!begin || !end) return null;
    const bend = Math.max(60, Math.abs(end[0] - begin[0]) / 2);
    const back = end[0] - begin[0] < 40 ? 1 : -1; // both in one column: a loop next to it
    const path =
      `M${begin[0]} ${begin[1]} C${begin[0] + bend} ${begin[1]} ` +
      `${end[0] + back * bend} ${end[1]} ${end[0]} ${end[1]}`;
    // At the SubInstance, where no two lines end, and on the side that the line does not come from:
    // in the middle lines cross.
    const [x, y] = [end[0] + back * 24, end[1] + (end[1] > begin[1] + 4 ? 16 : -6)];
    const anchor = /** @type {"start" | "end"} */ (back > 0 ? "start" : "end");
    return { path, x, y, anchor, roomy: back > 0 || end[0] - begin[0] > FACTS_PX };
  });
}

/**
 * The facts of a connection that its files state.
 * @param {import("./types").Connection} c
 */
const facts = (c) =>
  [
    c.address !== null && `address ${c.address}`,
    c.connection_id !== null && `ConnID ${c.connection_id}`,
    c.watchdog_ms !== null && `${c.watchdog_ms} ms`,
  ].filter(Boolean);

/** @param {any} props */
function Line({ curve, connection, number, findings, selected, choose }) {
  const severity = worst(findings);
  const chosen = selected !== null && "connection" in selected && selected.connection === number;
  const known = facts(connection);
  const open = connection.unconfirmed === null ? "" : ", not confirmed";
  const said = severity && severity !== "info" ? `, ${SEVERITIES[severity][1]}` : "";
  const onKey = (/** @type {KeyboardEvent} */ event) => {
    if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      choose({ connection: number });
    }
  };
  return html`<g class="line ${severity} ${chosen ? "chosen" : ""} ${open ? "open" : ""}"
      role="button" tabindex="0" aria-pressed=${chosen}
      aria-label=${`Connection ${[`${connection.main} to ${connection.sub}`, ...known].join(", ")}${open}${said}`}
      onClick=${() => choose({ connection: number })} onKeyDown=${onKey}>
    <path class="wide" d=${curve.path} /><path class="thin" d=${curve.path} />
    ${
      curve.roomy &&
      html`<text x=${curve.x} y=${curve.y} text-anchor=${curve.anchor}>${known.join(" · ")}</text>`
    }
  </g>`;
}

/** @param {any} props */
function Card({ sub, state, from, setFrom, connect, selected, choose }) {
  const findings = state.findings.filter((/** @type {any} */ f) => f.subdevices.includes(sub.name));
  const severity = worst(findings);
  const chosen = selected !== null && "subdevice" in selected && selected.subdevice === sub.name;
  return html`<div class="card ${sub.role || "none"} ${severity} ${chosen ? "chosen" : ""}">
    <button class="name" aria-pressed=${chosen} onClick=${() => choose({ subdevice: sub.name })}>
      <b>${sub.name}</b> <${Mark} severity=${severity} />
      <small>
        ${ROLES[sub.role]} · ${sub.alias ? `alias ${sub.alias} + ` : "position "}${sub.position}
        ${sub.group && ` · may be absent: ${sub.group}`}
      </small>
    </button>
    <ol class="ports">
      ${sub.pairs.map(
        (/** @type {any} */ pair) => html`<${Slot} key=${pair.slot} port=${{ subdevice: sub.name, pair }}
          from=${from} setFrom=${setFrom} connect=${connect} choose=${choose} />`,
      )}
    </ol>
  </div>`;
}

/**
 * @param {{ port: Port, from: Port | null, setFrom: (port: Port | null) => void,
 *   connect: (port: Port) => void, choose: (what: Selected) => void }} props
 */
function Slot({ port, from, setFrom, connect, choose }) {
  const { pair } = port;
  const used = pair.connection !== null;
  const own = from !== null && from.subdevice === port.subdevice && from.pair.slot === pair.slot;
  const why = from === null || own ? "" : obstacle(from, port);
  const fits = from !== null && !own && !why;
  const begin = () => !used && pair.matched && setFrom(port);
  const press = () => {
    if (own) setFrom(null);
    else if (from !== null) connect(port);
    else if (pair.connection !== null) choose({ connection: pair.connection });
    else begin();
  };
  const bytes = `${pair.sends_bytes} bytes out, ${pair.takes_bytes} in`;
  const how = why || (fits ? "fits" : used ? "connected" : "free");
  return html`<li>
    <button class="port ${used ? "used" : "free"} ${fits ? "fits" : ""} ${own ? "own" : ""}"
      data-port=${`${port.subdevice}/${pair.slot}`} draggable=${!used}
      title=${`slot ${pair.slot}: ${bytes}; ${how}`}
      aria-label=${`${port.subdevice}, slot ${pair.slot}, ${bytes}, ${how}`}
      onClick=${press}
      onDragStart=${(/** @type {DragEvent} */ event) => {
        event.dataTransfer?.setData("text/plain", port.subdevice);
        setTimeout(begin); // a browser ends a drag whose element changes at its begin
      }}
      onDragEnd=${() => setTimeout(() => setFrom(null))}
      onDragOver=${(/** @type {DragEvent} */ event) => fits && event.preventDefault()}
      onDrop=${(/** @type {DragEvent} */ event) => {
        event.preventDefault();
        connect(port);
      }}></button>
    <span class="slot">${pair.slot}</span>
    <small>${why && !own ? why : `${pair.sends_bytes} ⇄ ${pair.takes_bytes} bytes`}</small>
  </li>`;
}
