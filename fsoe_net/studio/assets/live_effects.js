// Why the machine is as it is, in sentences: what happened, the reason, what brings it back.
import { html } from "./html.js";
import { cableText, connectionText } from "./live_machine_draw.js";
import { MARKS } from "./live_strips.js";

/** @typedef {import("./types").LiveView} LiveView */
/** @typedef {import("./types").LivePicture} LivePicture */
/** @typedef {import("./types").LiveStop} LiveStop */
/** @typedef {import("./types").HealthLevel} HealthLevel */
/** @typedef {{ level: HealthLevel, what: string, why: string, back: string }} Effect */

const SHOWN = 3; // of one sort; more are counted
const RECENT_MS = 5000; // so long a Reset is explained, also where the connection is back sooner

/** The value of each lamp by the name of its signal. @param {LivePicture} picture @param {LiveView} view */
export function lampValues(picture, view) {
  const names = picture.nodes.flatMap((node) => [
    ...node.inputs.map(({ name }) => `in ${name}`),
    ...node.outputs.map(({ name }) => `out ${name}`),
  ]);
  return new Map(names.map((name, n) => [name, view.machine?.values[n] ?? 0]));
}

/** Whether an e-stop is pressed: one of its inputs is 0. @param {LiveStop} stop @param {Map<string, number>} values */
export const isPressed = (stop, values) => stop.inputs.some((name) => values.get(`in ${name}`) === 0);

/** What a person calls an e-stop. @param {LiveStop} stop */
export const stopName = ({ title, subdevice }) => (title ? `${title} at ${subdevice}` : `the e-stop at ${subdevice}`);

/** @param {string[]} names */
const listed = (names) =>
  names.length > SHOWN ? `${names.slice(0, SHOWN).join(", ")} and ${names.length - SHOWN} more` : names.join(", ");

/**
 * What a person can see of an emulated run, and what to do about it.
 * @param {LivePicture} picture
 * @param {LiveView} view
 * @param {Map<string, import("./live_past.js").Strip>} strips
 * @returns {Effect[]}
 */
export function effectsOf(picture, view, strips) {
  const machine = view.machine;
  if (!machine) return [];
  const values = lampValues(picture, view);
  const pressed = (picture.stops ?? []).filter((stop) => isPressed(stop, values));
  /** @type {Effect[]} */
  const found = pressed.map((stop) => ({
    level: "warning",
    what: `Pressed: ${stopName(stop)}.`,
    why: `Its safe inputs are 0. The safety logic ${stop.logic} reads them through FSoE and switches its outputs off.`,
    back: "Release it, then hold Reset: a release alone must not start a machine.",
  }));
  for (const number of machine.cut) {
    found.push({
      level: "error",
      what: `Cut: the cable between ${cableText(picture, number)}.`,
      why: machine.separated.length
        ? `No frame reaches ${listed(machine.separated)} any more.`
        : "The ring is open, but frames still reach every SubDevice from one of its two ends.",
      back: "Press the cable to repair it.",
    });
  }
  const pulled = view.subdevices.filter((s) => s.level === "error" && !machine.separated.includes(s.name)).map((s) => s.name);
  if (pulled.length) {
    found.push({
      level: "error",
      what: `Disconnected: ${listed(pulled)}.`,
      why: "It takes no frame and answers none. The working counter of the bus is too low.",
      back: "Press it in the picture, then Reconnect it.",
    });
  }
  const down = view.connections.filter((c) => !c.in_data && !c.absent);
  if (down.length) {
    const cause = down[0].cause ? ` Last Reset: ${down[0].cause}.` : "";
    const limit = down[0].watchdog_ms === null ? "" : ` of ${down[0].watchdog_ms} ms`;
    found.push({
      level: "error",
      what: `Not in Data: ${listed(down.map((c) => `${c.name} (${connectionText(c)})`))}.`,
      why: `Each end expects a valid frame within its FSoE watchdog${limit}; without one it goes to its fail-safe state.${cause}`,
      back: "It restarts by itself when frames pass again: Session, Connection, Parameter, Data.",
    });
  }
  const off = machine.logics.filter((logic) => !logic.on).map((logic) => logic.name);
  const back = view.connections.filter((c) => c.in_data && c.resets && view.now_ms - Number(strips.get(c.name)?.marks.at(-1)?.time_ms) < RECENT_MS);
  if (back.length) {
    found.push({
      level: "warning",
      what: `Reset, and back in Data: ${listed(back.map((c) => c.name))}.`,
      why: `The last Reset: ${back[0].cause}. The connection started again by itself.`,
      back: off.length ? "Its outputs stay off until a person holds Reset." : "",
    });
  }
  if (off.length && !pressed.length && !down.length) {
    found.push({
      level: "warning",
      what: `Off: the outputs of ${listed(off)}.`,
      why: "All safe inputs are 1 and every connection is in Data, but outputs switch on only after a deliberate reset.",
      back: "Hold Reset for a moment.",
    });
  }
  return found;
}

/** What the bus as a whole reports. @param {LiveView} view @returns {Effect[]} */
export function busReports({ bus, away }) {
  if (!bus || away || !bus.reasons.length) return [];
  return [{ level: bus.level, what: "Bus", why: bus.reasons.join(", "), back: "" }];
}

/**
 * What SubDevices and connections report, without advice.
 * @param {LiveView} view
 * @returns {Effect[]}
 */
export function reportsOf(view) {
  const parts = [...view.subdevices, ...view.connections].filter((part) => part.reasons.length);
  // Parts with the same reasons are one report: a stopped bus has them all.
  /** @type {Map<string, typeof parts>} */
  const reports = new Map();
  for (const part of parts) {
    const key = `${part.level} ${part.reasons.join(", ")}`;
    reports.set(key, [...(reports.get(key) ?? []), part]);
  }
  return [...reports.values()].map((same) => ({
    level: same[0].level,
    what: listed(same.map((part) => part.name)),
    why: same[0].reasons.join(", "),
    back: "",
  }));
}

/** @param {{ effects: Effect[], good: string }} props `good`: said without any effect */
export function Effects({ effects, good }) {
  if (!effects.length) return html`<p class="calm"><span class="good">✔</span> ${good}</p>`;
  return html`<ul class="effects">
    ${effects.slice(0, 12).map(({ level, what, why, back }) => {
      const [shape, colour] = MARKS[level];
      return html`<li class=${colour} key=${what}>
        <b class=${colour}>${shape} ${what}</b> <span>${why}</span>
        ${back && html`<span class="back">→ ${back}</span>`}
      </li>`;
    })}
    ${effects.length > 12 && html`<li>and ${effects.length - 12} more</li>`}
  </ul>`;
}
