// The machine as a picture: SubDevices, cables, FSoE connections, lamps, axes; see live_machine.js.
import { useEffect, useMemo, useRef, useState } from "./vendor/hooks.js";
import { html } from "./html.js";
import { fitted, isRoomy } from "./live_machine.js";
import { MARKS } from "./live_strips.js";
import { kindText, Symbol } from "./symbols.js";

/** @typedef {import("./types").LivePicture} LivePicture */
/** @typedef {import("./types").LiveNode} LiveNode */
/** @typedef {import("./types").LiveView} LiveView */
/** @typedef {import("./types").LiveConnection} LiveConnection */
/** @typedef {import("./types").LiveSelected} LiveSelected */
/** @typedef {import("./live_machine.js").Box} Box */
/** @typedef {[number, number, string]} Axis */

const CHAR_PX = 7.4;
const SMALL_PX = 6.6; // of a character of small text
const RING_R = 9;

/** @param {string} text @param {number} width @param {number} px of a character */
function fit(text, width, px) {
  const most = Math.max(1, Math.floor(width / px));
  return text.length <= most ? text : `${text.slice(0, most - 1)}…`;
}

/** @param {() => void} act Of something that is drawn and acts as a button. */
const asButton = (act) => ({
  role: "button",
  tabindex: 0,
  onClick: act,
  onKeyDown: (/** @type {KeyboardEvent} */ event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    if (!event.repeat) act();
  },
});

/**
 * Values of the lamps and axes by node, in the order in which the server sends them.
 * @param {LivePicture} picture
 * @param {LiveView} view
 * @returns {{ lamps: number[], axes: Axis[] }[]}
 */
function valuesOf(picture, view) {
  let [lamp, axis] = [0, 0];
  return picture.nodes.map((node) => {
    const count = node.inputs.length + node.outputs.length;
    const lamps = view.machine?.values.slice(lamp, lamp + count) ?? [];
    const axes = view.machine?.axes.slice(axis, axis + node.axes.length) ?? [];
    lamp += count;
    axis += node.axes.length;
    return { lamps, axes };
  });
}

/**
 * @param {{ picture: LivePicture, view: LiveView, chosen: LiveSelected, choose: (what: LiveSelected) => void,
 *   cable: ((number: number, whole: boolean) => void) | null }} props `cable` cuts or repairs; null: nothing does
 */
export function Machine({ picture, view, chosen, choose, cable }) {
  const box = useRef(/** @type {HTMLElement | null} */ (null));
  const [width, setWidth] = useState(0);
  useEffect(() => {
    const watcher = new ResizeObserver(() => setWidth(box.current?.clientWidth ?? 0));
    if (box.current) watcher.observe(box.current);
    return () => watcher.disconnect();
  }, []);
  const ends = view.connections.map((c) => `${c.name}|${c.main}|${c.sub}`).join("\n");
  const drawing = useMemo(() => (width ? fitted(picture, view.connections, width) : null), [picture, ends, width]);
  const values = valuesOf(picture, view);
  const subdevices = new Map(view.subdevices.map((s) => [s.name, s]));
  const connections = new Map(view.connections.map((c) => [c.name, c]));
  const logics = new Map(view.machine?.logics.map((logic) => [logic.name, logic.on]));
  const roomy = isRoomy(picture);
  const places = drawing?.places;
  return html`<div class="machine" ref=${box}>
    ${drawing && places && html`<svg width=${width} height=${places.height * drawing.zoom} viewBox=${`0 0 ${places.width} ${places.height}`} role="group" aria-label="The machine">
      ${places.cables.map((c) => html`<${CableLine} key=${`cable ${c.number}`} cable=${c} picture=${picture}
        isCut=${view.machine?.cut.includes(c.number) ?? false} act=${cable} />`)}
      ${places.arcs.map((arc) => html`<${ArcLine} key=${arc.name} arc=${arc} connection=${connections.get(arc.name)}
        chosen=${chosen !== null && "connection" in chosen && chosen.connection === arc.name} choose=${choose} />`)}
      ${places.ends.map((end) => html`<${MainDevice} key=${`bus ${end.bus}`} end=${end} name=${picture.buses[end.bus] ?? ""} />`)}
      ${picture.nodes.map((node, n) => html`<${SubDevice} key=${`${n} ${node.name}`} node=${node} box=${places.nodes[n]}
        sub=${subdevices.get(node.name)} lamps=${values[n].lamps} axes=${values[n].axes} isOn=${logics.get(node.name)} roomy=${roomy}
        chosen=${chosen !== null && "subdevice" in chosen && chosen.subdevice === node.name} choose=${choose} />`)}
    </svg>`}
  </div>`;
}

/** @param {{ end: Box, name: string }} props */
function MainDevice({ end, name }) {
  return html`<g class="maindevice">
    <rect x=${end.x} y=${end.y} width=${end.width} height=${end.height} rx="6" />
    <text x=${end.x + 8} y=${end.y + 26}>Main</text><text x=${end.x + 8} y=${end.y + 42}>Device</text>
    ${name && html`<text class="small" x=${end.x + 8} y=${end.y + 58}><title>${name}</title>${fit(name, end.width - 12, SMALL_PX)}</text>`}
  </g>`;
}

/** Both ends of a cable. @param {LivePicture} picture @param {number} number */
export function cableText(picture, number) {
  const isRing = number >= picture.nodes.length;
  const last = isRing ? picture.rings[number - picture.nodes.length] : number;
  const before = isRing ? null : picture.nodes[number].parent;
  const called = (/** @type {number | null} */ n) =>
    n === null ? "the MainDevice" : picture.nodes[n].name || picture.nodes[n].type || `SubDevice ${n}`;
  return `${called(before)} and ${called(last)}`;
}

/**
 * @param {{ cable: import("./live_machine.js").Cable, picture: LivePicture, isCut: boolean,
 *   act: ((number: number, whole: boolean) => void) | null }} props
 */
function CableLine({ cable, picture, isCut, act }) {
  return useMemo(() => cableLine(cable, picture, isCut, act), [cable, picture, isCut, act]);
}

/**
 * @param {import("./live_machine.js").Cable} cable
 * @param {LivePicture} picture
 * @param {boolean} isCut
 * @param {((number: number, whole: boolean) => void) | null} act
 */
function cableLine(cable, picture, isCut, act) {
  const { number, path, x, y } = cable;
  const text = `Cable between ${cableText(picture, number)}: ${isCut ? "cut" : "whole"}`;
  const label = act ? `${text}; press to ${isCut ? "repair" : "cut"} it` : text;
  const button = act && { ...asButton(() => act(number, isCut)), "aria-label": label };
  return html`<g class="cable ${isCut ? "cut" : ""} ${act ? "acts" : ""}" ...${button}>
    <title>${label}</title>
    ${act && html`<path class="wide" d=${path} />`}<path class="thin" d=${path} />
    ${isCut
      ? html`<circle cx=${x} cy=${y} r="10" /><path class="sign" d=${`M${x - 5} ${y - 5}l10 10M${x + 5} ${y - 5}l-10 10`} />`
      : act && html`<text class="scissors" x=${x} y=${y - 6} text-anchor="middle" aria-hidden="true">✂</text>`}
  </g>`;
}

/** The class of a connection by its state. @param {LiveConnection} c */
function stateClass(c) {
  if (c.absent) return "absent";
  if (!c.in_data) return "down";
  return c.level === "good" ? "process" : "failsafe";
}

/** @param {LiveConnection} c */
export const connectionText = (c) => (c.absent ? "absent, as it may be" : c.state);

/**
 * @param {{ arc: import("./live_machine.js").Arc, connection: LiveConnection | undefined, chosen: boolean,
 *   choose: (what: LiveSelected) => void }} props
 */
function ArcLine({ arc, connection: c, chosen, choose }) {
  return useMemo(() => c && arcLine(arc, c, chosen, choose), [arc, c?.state, c?.level, c?.absent, c?.max_ms, chosen]);
}

/**
 * @param {import("./live_machine.js").Arc} arc
 * @param {LiveConnection} c
 * @param {boolean} chosen
 * @param {(what: LiveSelected) => void} choose
 */
function arcLine(arc, c, chosen, choose) {
  const { path, x, y } = arc;
  const share = c.share === null ? null : Math.round(100 * c.share);
  const facts = c.connection_id === null ? c.name : `ConnID ${c.connection_id}`;
  const used = share === null ? "" : `, longest FSoE cycle ${c.max_ms.toFixed(1)} ms, ${share} % of the watchdog`;
  const text = `FSoE connection ${c.name}: ${connectionText(c)}, ${facts}${used}`;
  const [shape] = c.absent ? MARKS.unknown : MARKS[c.level];
  return html`<g class="arc ${stateClass(c)} ${chosen ? "chosen" : ""}" aria-pressed=${chosen} aria-label=${text}
      ...${asButton(() => choose(chosen ? null : { connection: c.name }))}>
    <title>${text}</title>
    <path class="wide" d=${path} /><path class="thin" d=${path} />
    <circle class="back" cx=${x} cy=${y} r=${RING_R} />
    ${share !== null &&
    html`<circle class="share ${share > 83 ? "high" : ""}" cx=${x} cy=${y} r=${RING_R} pathLength="100" stroke-dasharray=${`${Math.min(share, 100)} 100`} transform=${`rotate(-90 ${x} ${y})`} />`}
    <text class="shape" x=${x} y=${y + 4} text-anchor="middle">${shape}</text>
    ${arc.facts > 0 && html`<text class="small" x=${x + 14} y=${y + 4}>${facts}${arc.facts > 1 && share !== null ? ` · ${c.max_ms.toFixed(0)} of ${c.watchdog_ms} ms` : ""}</text>`}
  </g>`;
}

/**
 * @param {{ node: LiveNode, box: Box, sub: import("./types").LiveSubDevice | undefined, lamps: number[], axes: Axis[],
 *   isOn: boolean | undefined, roomy: boolean, chosen: boolean, choose: (what: LiveSelected) => void }} props
 */
function SubDevice({ node, box, sub, lamps, axes, isOn, roomy, chosen, choose }) {
  const key = [sub?.al, sub?.known, sub?.level, isOn, roomy, chosen, ...lamps, ...axes.flat()].join();
  // Most SubDevices are as before: the same part of the page is given back, and not compared.
  return useMemo(() => {
    const [shape, colour] = MARKS[sub?.level ?? "unknown"];
    const gone = sub?.known && sub.al === "none";
    const al = sub?.known ? sub.al : "not known";
    const own = gone ? "no answer" : al;
    const state = node.name ? own : "not in the file";
    const { x, y, width, height } = box;
    const name = node.name || node.type || "SubDevice";
    const kind = kindText(node.kind);
    const type = [kind, node.type].filter(Boolean).join(" · ");
    // The symbol shows the kind: where only one fits, it is the type.
    const shortType = type.length * SMALL_PX > width - 46 ? node.type || kind : type;
    const lamp = lampTexts(node, lamps);
    if (isOn !== undefined) lamp.push(`outputs ${isOn ? "on" : "off"}`);
    const text = `${name}, ${type}: ${state}${lamp.length ? `; ${lamp.join(", ")}` : ""}`;
    const button = node.name && asButton(() => choose(chosen ? null : { subdevice: node.name }));
    return html`<g class="device ${node.kind} ${gone ? "gone" : ""} ${node.name ? "" : "foreign"} ${chosen ? "chosen" : ""}"
        aria-pressed=${button ? chosen : undefined} aria-label=${text} role="img" ...${button}>
      <title>${name}: ${type}${node.about ? `, ${node.about}` : ""}</title>
      <rect x=${x} y=${y} width=${width} height=${height} rx="6" />
      <${Symbol} kind=${node.kind} x=${x + 8} y=${y + 8} size="26" />
      <text class="name" x=${x + 40} y=${y + 20}>${fit(name, width - 46, CHAR_PX)}</text>
      <text class="small" x=${x + 40} y=${y + 36}>${fit(shortType, width - 46, SMALL_PX)}</text>
      <text class="al ${colour}" x=${x + 10} y=${y + 56}>${shape} ${state}</text>
      ${isOn !== undefined && html`<g class="lamp out ${isOn ? "lit" : ""}">
        <circle cx=${x + 19} cy=${y + 78} r="9" /><text x=${x + 34} y=${y + 82}>outputs ${isOn ? "on" : "off"}</text>
      </g>`}
      <${Lamps} node=${node} values=${lamps} x=${x + 10} y=${y + 62} width=${width - 20} roomy=${roomy} />
      ${axes.map((axis, n) => html`<${AxisDial} key=${n} axis=${axis} x=${x + 36 + n * 62} y=${y + height - 34} width=${width} />`)}
    </g>`;
  }, [node, box, key, choose]);
}

/** @param {LiveNode} node @param {number[]} values */
function lampTexts(node, values) {
  if (!values.length) return [];
  return [...node.inputs, ...node.outputs].map(({ name, label }, n) => `${label || entryOf(name)} ${values[n]}`);
}

/** The object in the name of a safe signal. @param {string} name */
export const entryOf = (name) => name.slice(name.lastIndexOf(".") + 1);

/** @param {{ node: LiveNode, values: number[], x: number, y: number, width: number, roomy: boolean }} props */
function Lamps({ node, values, x, y, width, roomy }) {
  if (!values.length) return null;
  const inputs = node.inputs.length;
  return [...node.inputs, ...node.outputs].map(({ name, label }, n) => {
    const isInput = n < inputs;
    const row = roomy ? n : Number(!isInput && inputs > 0);
    const column = roomy ? 0 : isInput ? n : n - inputs;
    const [cx, cy] = [x + 7 + column * 16, y + 9 + row * 18];
    const lit = values[n] ? "lit" : "";
    // A square is an input, a circle an output; filled is 1.
    return html`<g class="lamp ${isInput ? "in" : "out"} ${lit}" key=${name}>
      <title>${isInput ? "safe input" : "safe output"} ${label || name}: ${values[n]}</title>
      ${isInput
        ? html`<rect x=${cx - 5.5} y=${cy - 5.5} width="11" height="11" rx="2" />`
        : html`<circle cx=${cx} cy=${cy} r="6.5" />`}
      ${roomy && html`<text class="small" x=${cx + 13} y=${cy + 4}>${fit(label || entryOf(name), width - 36, SMALL_PX)}</text>
        <text class="small value" x=${x + width} y=${cy + 4} text-anchor="end">${values[n]}</text>`}
    </g>`;
  });
}

/** A motor: its hand is at the actual position. @param {{ axis: Axis, x: number, y: number, width: number }} props */
function AxisDial({ axis: [turns, rpm, state], x, y, width }) {
  return html`<g class="axis ${Math.abs(rpm) >= 1 ? "turns" : ""}">
    <title>Motor: ${rpm.toFixed(0)} rpm, ${state}</title>
    <circle cx=${x} cy=${y} r="24" />
    <g transform=${`rotate(${(360 * turns).toFixed(1)} ${x} ${y})`}>
      <path d=${`M${x} ${y}V${y - 20}M${x - 6} ${y - 13}l6 -8 6 8`} /><circle class="hub" cx=${x} cy=${y} r="4" />
    </g>
    ${width > 150 && html`<text class="small" x=${x + 32} y=${y - 2}>${rpm.toFixed(0)} rpm</text>
      <text class="small" x=${x + 32} y=${y + 13}>${fit(state, width - 74, SMALL_PX)}</text>`}
  </g>`;
}
