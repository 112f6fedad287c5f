// The bus as a line, or as a tree or ring where a scan shows one: SubDevices by their place.
import { useState } from "./vendor/hooks.js";
import { html, Mark, ROLES, worst } from "./html.js";

/** @typedef {import("./types").State} State */
/** @typedef {import("./types").SubDevice} SubDevice */
/** @typedef {import("./types").Selected} Selected */
/** @typedef {import("./types").Wiring} Wiring */
/** @typedef {import("./types").WiredNode} WiredNode */

/**
 * SubDevices of a bus by position; one with an alias, whose place is known to itself only, stays
 * after the previous one in the file.
 * @param {State} state
 * @param {number} bus
 */
export function onBus(state, bus) {
  /** @type {SubDevice[][]} */
  const groups = [[]];
  for (const sub of state.subdevices.filter((s) => s.bus === bus || !state.buses.length)) {
    if (!sub.alias) groups.push([]);
    groups[groups.length - 1].push(sub);
  }
  const [first, ...rest] = groups;
  rest.sort((one, two) => one[0].position - two[0].position);
  return [...first, ...rest.flat()];
}

/**
 * The rows to draw: from the MainDevice along port 1, then each branch.
 * @param {Wiring} wiring
 * @returns {{ from: WiredNode | null, port: number, nodes: WiredNode[] }[]}
 */
function rowsOf(wiring) {
  /** @type {ReturnType<typeof rowsOf>} */
  const rows = [];
  const walk = (/** @type {WiredNode} */ first) => {
    const from = wiring.nodes.find((n) => n.position === first.parent) ?? null;
    const row = { from, port: first.port, nodes: [first] };
    rows.push(row);
    /** @type {WiredNode[]} */
    const branches = [];
    for (let last = first; ; ) {
      const children = wiring.nodes.filter((n) => n.parent === last.position);
      const next = children.find((n) => n.port === 1) ?? children[children.length - 1];
      branches.push(...children.filter((n) => n !== next));
      if (!next) break;
      row.nodes.push(next);
      last = next;
    }
    branches.forEach(walk);
  };
  if (wiring.nodes.length) walk(wiring.nodes[0]);
  return rows;
}

/** @param {number} port */
const portName = (port) => `port ${port} (${"ABCD"[port]})`;

/**
 * @param {{ state: State, findings: Map<string, import("./types").Finding[]>, selected: Selected, choose: (what: Selected) => void,
 *   act: (name: string, body: object) => void }} props
 */
export function Bus({ state, findings, selected, choose, act }) {
  const [moving, setMoving] = useState(/** @type {SubDevice | null} */ (null));
  const box = (/** @type {SubDevice} */ sub, /** @type {any} */ other = null) =>
    html`<li key=${sub.name}><${Box} sub=${sub} findings=${findings.get(sub.name) ?? []} selected=${selected} choose=${choose}
      act=${act} moving=${moving} setMoving=${setMoving} />${other}</li>`;
  const names = state.buses.length ? state.buses : [""];
  return html`${names.map((name, number) => {
    const subs = onBus(state, number);
    const end = name || "MainDevice";
    if (number === 0 && state.wiring?.is_known)
      return html`<${Wired} key=${number} wiring=${state.wiring} subs=${subs} end=${end} box=${box} />`;
    return html`<div class="bus" key=${number}>
      <span class="end">${end}</span>
      <ol aria-label=${`SubDevices of the bus ${name}`}>${subs.map((sub) => box(sub))}</ol>
    </div>`;
  })}
  ${state.wiring && !state.wiring.is_known &&
  html`<p class="help">
    The links in ${state.wiring.file} leave open how the cables run: the bus is drawn as a line.
  </p>`}`;
}

/** @param {{ wiring: Wiring, subs: SubDevice[], end: string, box: (sub: SubDevice, other?: any) => any }} props */
function Wired({ wiring, subs, end, box }) {
  const placed = new Set(wiring.nodes.map((node) => node.subdevice));
  const rest = subs.filter((sub) => !placed.has(sub.name));
  const called = (/** @type {WiredNode} */ node) => node.subdevice || `${node.position} ${node.type}`;
  const rows = rowsOf(wiring);
  const ring = wiring.ring_from;
  const kind = !ring ? (rows.length > 1 ? "tree" : "line") : rows.length > 1 ? "ring with branches" : "ring";
  return html`
    ${rows.map(({ from, port, nodes }, n) => {
      const begin = from ? `└ ${called(from)}, ${portName(port)}` : end;
      const label = from ? `Branch from ${called(from)}, ${portName(port)}` : `SubDevices of the bus, a ${kind}`;
      return html`<div class="bus" key=${n}>
        <span class="end">${begin}</span>
        <ol aria-label=${label}>
          ${nodes.map((node) => {
            const sub = subs.find((s) => s.name === node.subdevice);
            const other = node.is_other && html`<small> ≠ ${node.type} in the scan </small>`;
            return sub
              ? box(sub, other)
              : html`<li key=${node.position}><span class="foreign" title="on the bus, and not in the file">
                  ${node.position} ${node.type}<span class="unseen"> (not in the file)</span></span></li>`;
          })}
          ${ring && nodes.some((node) => node.position === ring[0]) &&
          html`<li key="ring"><span class="end">↺ ${ring[1] === 1 ? "" : `${portName(ring[1])} `}back to the MainDevice</span></li>`}
        </ol>
      </div>`;
    })}
    ${rest.length > 0 &&
    html`<div class="bus">
      <span class="end">not in the scan:</span>
      <ol aria-label="SubDevices that are not in the scan">${rest.map((sub) => box(sub))}</ol>
    </div>`}
    <p class="help">A ${kind}, by the links in ${wiring.file}.</p>
  `;
}

/** @param {any} props */
function Box({ sub, findings, selected, choose, act, moving, setMoving }) {
  const chosen = selected !== null && "subdevice" in selected && selected.subdevice === sub.name;
  const severity = worst(findings);
  const fits = moving !== null && sub.name !== moving.name && !sub.alias && sub.bus === moving.bus;
  return html`<button draggable=${!sub.alias} aria-pressed=${chosen}
    class="box ${sub.role || "none"} ${severity} ${sub.group && "absent"} ${fits ? "fits" : ""}"
    title=${`${sub.name}: ${ROLES[sub.role]}, ${sub.identity}`}
    onClick=${() => choose({ subdevice: sub.name })}
    onDragStart=${(/** @type {DragEvent} */ event) => {
      event.dataTransfer?.setData("text/plain", sub.name);
      setTimeout(() => setMoving(sub)); // a browser ends a drag whose element changes at its begin
    }}
    onDragEnd=${() => setTimeout(() => setMoving(null))}
    onDragOver=${(/** @type {DragEvent} */ event) => fits && event.preventDefault()}
    onDrop=${(/** @type {DragEvent} */ event) => {
      event.preventDefault();
      if (fits) act("change", { change: "move", subdevice: moving.name, to: sub.name });
    }}>
    <span>${sub.alias ? `${sub.alias} +` : ""}${sub.position}</span> ${sub.name} <${Mark} severity=${severity} />
  </button>`;
}
