// The bus as a line: its SubDevices by their place, moved by mouse or in the panel of the selected one.
import { useState } from "./vendor/hooks.js";
import { html, Mark, ROLES, worst } from "./html.js";

/** @typedef {import("./types").State} State */
/** @typedef {import("./types").SubDevice} SubDevice */
/** @typedef {import("./types").Selected} Selected */

/**
 * SubDevices of a bus by position; one with an alias, whose place is known to itself only, stays
 * behind the one before it in the file.
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
 * @param {{ state: State, selected: Selected, choose: (what: Selected) => void,
 *   act: (name: string, body: object) => void }} props
 */
export function Bus({ state, selected, choose, act }) {
  const names = state.buses.length ? state.buses : [""];
  const [moving, setMoving] = useState(/** @type {SubDevice | null} */ (null));
  const fits = (/** @type {SubDevice} */ sub) =>
    moving !== null && sub !== moving && !sub.alias && sub.bus === moving.bus;
  const drop = (/** @type {SubDevice} */ sub) => {
    if (fits(sub)) act("change", { change: "move", subdevice: moving?.name, to: sub.name });
    setMoving(null);
  };
  return html`${names.map(
    (name, number) => html`<div class="bus" key=${number}>
      <span class="end">${name || "MainDevice"}</span>
      <ol aria-label=${`SubDevices of the bus ${name}`}>
        ${onBus(state, number).map((sub) => {
          const chosen =
            selected !== null && "subdevice" in selected && selected.subdevice === sub.name;
          const severity = worst(state.findings.filter((f) => f.subdevices.includes(sub.name)));
          return html`<li key=${sub.name}>
            <button class="box ${sub.role || "none"} ${severity} ${sub.group && "absent"} ${fits(sub) ? "fits" : ""}"
              aria-pressed=${chosen} draggable=${!sub.alias}
              title=${`${sub.name}: ${ROLES[sub.role]}, ${sub.identity}`}
              onClick=${() => choose({ subdevice: sub.name })}
              onDragStart=${(/** @type {DragEvent} */ event) => {
                event.dataTransfer?.setData("text/plain", sub.name);
                setTimeout(() => setMoving(sub)); // a browser ends a drag whose element changes at its begin
              }}
              onDragEnd=${() => setTimeout(() => setMoving(null))}
              onDragOver=${(/** @type {DragEvent} */ event) => fits(sub) && event.preventDefault()}
              onDrop=${(/** @type {DragEvent} */ event) => {
                event.preventDefault();
                drop(sub);
              }}>
              <span>${sub.alias ? `${sub.alias} +` : ""}${sub.position}</span> ${sub.name} <${Mark} severity=${severity} />
            </button>
          </li>`;
        })}
      </ol>
    </div>`,
  )}`;
}
