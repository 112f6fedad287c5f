// What is selected, with the values that a person sets.
import { useEffect, useRef, useState } from "./vendor/hooks.js";
import { onBus } from "./bus.js";
import { html, ROLES } from "./html.js";

/** @typedef {import("./types").State} State */
/** @typedef {import("./types").Fact} Fact */

/** @type {Record<Fact, [string, string]>} */
const FACTS = {
  address: ["FSoE address", "as it is set at the device"],
  connection_id: ["ConnID", "as in the safety project; never twice in a network"],
  watchdog_ms: ["FSoE watchdog, ms", "as in the safety project"],
};

/**
 * The limits of the watchdog by the timing budget.
 * @param {import("./types").Connection} connection
 */
function limits({ least_ms: least, greatest_ms: greatest }) {
  if (least === null && greatest === null) return "; the timing budget sets no limits";
  const from = least === null ? "" : ` at least ${least} ms`;
  const to = greatest === null ? "" : ` at most ${greatest} ms`;
  return `; by the timing budget${from}${from && to ? "," : ""}${to}`;
}

/** @param {any} props */
export function Inspector({ state, selected, act, choose }) {
  const chosen = selected;
  const connection = chosen && "connection" in chosen ? state.connections[chosen.connection] : null;
  const sub =
    chosen && "subdevice" in chosen
      ? state.subdevices.find((/** @type {any} */ s) => s.name === chosen.subdevice)
      : null;
  return html`<section class="inspector" aria-label="Selected">
    ${connection
      ? html`<${OfConnection} state=${state} connection=${connection}
          number=${chosen.connection} act=${act} choose=${choose} />`
      : sub
        ? html`<${OfSubDevice} sub=${sub} state=${state} act=${act} choose=${choose} />`
        : html`<${OfNetwork} state=${state} act=${act} />`}
  </section>`;
}

/**
 * The two copies to the byte: where a frame lies in the process data of both ends.
 * @param {{ copies: import("./types").Connection["copies"] }} props
 */
function Copies({ copies }) {
  return html`<details class="copies">
    <summary>Frames and copies, to the byte</summary>
    ${copies.map(
      (copy, n) => html`<h3>${n ? "back from" : "to"} the SubInstance</h3>
        <${Bytes} way="inputs" end=${copy.source} size=${copy.size_bytes} />
        <${Bytes} way="outputs" end=${copy.destination} size=${copy.size_bytes} />`,
    )}
  </details>`;
}

/** @param {{ way: string, end: import("./types").CopyEnd, size: number }} props */
function Bytes({ way, end, size }) {
  if (end.byte === null || end.of_bytes === null)
    return html`<p>${end.subdevice}, ${end.entry}: its place is not known offline</p>`;
  const first = end.byte;
  const text = `${end.subdevice}, ${way}, sync manager ${end.sm}: bytes ${first} to ${first + size - 1} of ${end.of_bytes}`;
  return html`<p>${text}, from ${end.entry}</p>
    <svg viewBox=${`0 0 ${end.of_bytes} 1`} preserveAspectRatio="none" role="img" aria-label=${text}>
      <rect class="all" width=${end.of_bytes} height="1" />
      <rect class="frame" x=${first} width=${size} height="1" />
    </svg>`;
}

/** @param {any} props */
function OfConnection({ state, connection, number, act, choose }) {
  const change = (/** @type {object} */ body) => act("change", { ...body, connection: number });
  return html`
    <h2>${connection.main} → ${connection.sub}</h2>
    <p>
      Net ${connection.net}; ${connection.to_sub_bytes} bytes to the SubInstance,
      ${" "}${connection.to_main_bytes} back, each bus cycle.
    </p>
    ${connection.unconfirmed !== null &&
    html`<p class="open">
      <b>Not confirmed.</b> ${connection.unconfirmed}
      <button onClick=${() => change({ change: "confirm" })}>
        I have compared it with the safety project
      </button>
    </p>`}
    ${Object.keys(FACTS).map(
      (key) => html`<${Field} key=${`${number} ${key}`} label=${FACTS[/** @type {Fact} */ (key)][0]}
        help=${FACTS[/** @type {Fact} */ (key)][1] + (key === "watchdog_ms" ? limits(connection) : "")}
        value=${connection[key]} most=${state.limits[key]}
        proposed=${state.proposals[key]}
        set=${(/** @type {number | null} */ value) => change({ change: "set", key, value })} />`,
    )}
    <${Copies} copies=${connection.copies} />
    <button class="danger" onClick=${() => {
      change({ change: "disconnect" });
      choose(null);
    }}>Remove this connection</button>
  `;
}

/** @param {{ sub: import("./types").SubDevice, state: State, act: import("./types").Act, choose: any }} props */
function OfSubDevice({ sub, state, act, choose }) {
  const change = (/** @type {object} */ body) => act("change", { ...body, subdevice: sub.name });
  const line = onBus(state, sub.bus).filter((s) => !s.alias);
  const place = line.indexOf(sub);
  const own = state.connections.filter((c) => c.main === sub.name || c.sub === sub.name);
  // Device files of a draft have relative names; the path of the SubDevice ends with one.
  const isNew = state.unwritten.some((name) => sub.device.endsWith(name));
  return html`
    <h2>${sub.name}</h2>
    <p>${ROLES[sub.role]}. ${sub.identity}.<br />${sub.device}${isNew && ": Save writes it"}</p>
    ${sub.group && html`<p>In group ${sub.group}: it may be absent.</p>`}
    <${Field} key=${`${sub.name} name`} label="Name" value=${sub.name} isName=${true}
      help="in this file; other files that name it, such as scenarios, are changed by you"
      set=${async (/** @type {string | null} */ name) => {
        // The selection follows the new name only if the server has accepted it.
        if (name !== null && !(await change({ change: "rename", name })).error) choose({ subdevice: name });
      }} />
    <${Field} key=${`${sub.name} position`} label="Position" value=${sub.position} most=${65535}
      help=${sub.alias ? `counted from the SubDevice with alias ${sub.alias}` : "on the bus, from 0"}
      set=${(/** @type {number | null} */ position) =>
        position !== null && change({ change: "place", position })} />
    <${Field} key=${`${sub.name} alias`} label="Alias" value=${sub.alias} most=${65535}
      help="as it is stored in the device; 0: none, the position counts from the begin of the bus"
      set=${(/** @type {number | null} */ alias) => change({ change: "place", alias: alias ?? 0 })} />
    ${place >= 0 &&
    html`<div class="row">
      ${[-1, 1].map(
        (step) => html`<button key=${step} disabled=${!line[place + step]}
          onClick=${() => change({ change: "move", to: line[place + step].name })}>
          ${step < 0 ? "◀ Towards the begin" : "Towards the end ▶"}
        </button>`,
      )}
    </div>`}
    <p class="help">
      To remove it ${own.length ? `also removes ${own.map((c) => `${c.main} → ${c.sub}`).join(", ")} and ` : "removes "}
      all else that is copied to or from it; its device file stays.
    </p>
    <button class="danger" onClick=${() => {
      change({ change: "remove" });
      choose(null);
    }}>Remove this SubDevice</button>
  `;
}

/** @param {{ state: State, act: import("./types").Act }} props */
function OfNetwork({ state, act }) {
  const change = (/** @type {object} */ body) => act("change", { change: "network", ...body });
  return html`
    <p class="help">Select a SubDevice or a connection.</p>
    <${Field} key="name" label="Name of the network" value=${state.name} isName=${true}
      help="for reports, plans and what other programs show"
      set=${(/** @type {string | null} */ name) => name !== null && change({ name })} />
    ${!state.buses.length &&
    html`<${Field} key="cycle" label="Bus cycle, µs" value=${state.cycle_us} most=${4_000_000}
      help="as the MainDevice runs the bus; reaction times are calculated with it"
      set=${(/** @type {number | null} */ cycle_us) => cycle_us !== null && change({ cycle_us })} />`}
  `;
}

/** @param {any} props */
function Field({ label, help, value, most, proposed, isName, set }) {
  const [typed, setTyped] = useState(value ?? "");
  const sent = useRef(/** @type {string | null} */ (null)); // Enter sends, and so does leaving the field
  const known = useRef(value);
  useEffect(() => {
    if (known.current === value) return; // on a busy machine a person may have typed before this runs
    known.current = value;
    setTyped(value ?? "");
    sent.current = null;
  }, [value]);
  const text = String(typed).trim();
  // A value of the file that is out of range stays until a person changes it.
  const isWrong = !isName && text !== "" && !(/^[0-9]+$/.test(text) && Number(text) <= most) && text !== `${value}`;
  const send = () => {
    // Enter sends and then leaving the field would send again.
    if (isWrong || text === sent.current) return;
    sent.current = text;
    if (isName) {
      if (text !== value) text ? set(text) : setTyped(value);
    } else if (text === "") {
      if (value !== null) set(null);
    } else if (Number(text) !== value) set(Number(text));
  };
  const id = `field-${label.replace(/\W+/g, "-")}`;
  return html`<div class="field">
    <label for=${id}>${label}</label>
    <input id=${id} aria-describedby=${`${id}-help`} inputmode=${isName ? "text" : "numeric"} value=${typed}
      aria-invalid=${isWrong}
      placeholder="not stated"
      onInput=${(/** @type {any} */ event) => {
        sent.current = null;
        setTyped(event.target.value);
      }} onBlur=${send}
      onKeyDown=${(/** @type {KeyboardEvent} */ event) => event.key === "Enter" && send()} />
    ${isWrong && html`<p class="error" role="alert">“${text}” is not a whole number from 0 to ${most}; not taken.</p>`}
    ${value === null && proposed !== undefined &&
    html`<button type="button" onClick=${() => set(proposed)}>${proposed}: next free</button>`}
    <small id=${`${id}-help`}>${help}</small>
  </div>`;
}
