// What can be added: one row for each type, with its variants inside.
import { useState } from "./vendor/hooks.js";
import { html } from "./html.js";

/** @typedef {import("./types").Offer} Offer */
/** @typedef {import("./types").State} State */
/** @typedef {[number, number]} Lengths Bytes to the device, from it. */

const MOST_SHOWN = 60;
const ROLES = { main: "MainInstance", sub: "SubInstance", "": "" };
/** @type {import("./types").DeviceFunction[]} */
const FUNCTIONS = ["safe_input", "safe_output", "drive", "safety_logic"];
const USUAL = 6; // bytes of a frame with one byte of safe data
/** Lengths that FSoE has, up to 30 bytes of safe data. */
const LENGTHS = [USUAL, ...Array.from({ length: 15 }, (_, n) => 7 + 4 * n)];

/** A function in words. @param {import("./types").DeviceFunction} name */
const functionText = (name) => name.replace("_", " ");

/** @param {number} value */
const hex = (value) => `0x${value.toString(16).padStart(8, "0")}`;

/** @param {Offer} offer */
const words = (offer) =>
  [
    offer.position === null ? "" : `position ${offer.position}`,
    ROLES[offer.role],
    offer.process_data,
    offer.frames.map(([to, from]) => `${from} ⇄ ${to} bytes`).join(", "),
    offer.revision === null ? "" : `revision ${hex(offer.revision)}`,
    offer.file,
  ]
    .filter(Boolean)
    .join(" · ");

/**
 * Offers of one type of one file, in their order: the usual one is first.
 * @param {Offer[]} offers
 */
function byType(offers) {
  /** @type {Map<string, Offer[]>} */
  const types = new Map();
  for (const offer of offers) {
    const key = JSON.stringify([offer.file, offer.order, offer.position]);
    types.set(key, [...(types.get(key) ?? []), offer]);
  }
  return [...types];
}

/**
 * @param {{ state: State, offers: Offer[], add: (numbers: number[], connections?: Lengths[]) => void }} props
 */
export function Offers({ state, offers, add }) {
  const [wanted, setWanted] = useState("");
  const parts = wanted.toLowerCase().split(/\s+/);
  const found = byType(
    offers.filter((offer) => {
      const text = `${offer.order} ${offer.about} ${offer.functions.map(functionText).join(" ")} ${words(offer)}`.toLowerCase();
      return parts.every((part) => text.includes(part));
    }),
  );
  return html`
    <label>
      Search <input type="search" value=${wanted} placeholder="EL1904, safe input …"
        onInput=${(/** @type {any} */ event) => setWanted(event.target.value)} />
    </label>
    <div class="row" role="group" aria-label="Search by function">
      ${FUNCTIONS.map(functionText).map(
        (name) => html`<button key=${name} aria-pressed=${wanted === name}
          onClick=${() => setWanted(wanted === name ? "" : name)}>${name}</button>`,
      )}
    </div>
    <ol class="offers" aria-label="What can be added">
      ${found.slice(0, MOST_SHOWN).map(([key, [first, ...rest]]) =>
        html`<li key=${key}>
          <${One} offer=${first} state=${state} add=${add} />
          ${rest.length > 0 &&
          html`<details>
            <summary>${rest.length} more ${rest.length === 1 ? "variant" : "variants"} of ${first.order}</summary>
            ${rest.map((offer) => html`<${One} key=${offer.number} offer=${offer} state=${state} add=${add} />`)}
          </details>`}
        </li>`,
      )}
    </ol>
    ${found.length > MOST_SHOWN && html`<p class="help">${found.length - MOST_SHOWN} more: search for a part of the name.</p>`}
    ${offers.length > 0 && found.length === 0 && html`<p role="status">No name and no function contains that text.</p>`}
  `;
}

/** @param {{ offer: Offer, state: State, add: (numbers: number[], connections?: Lengths[]) => void }} props */
function One({ offer, state, add }) {
  if (offer.most_connections) return html`<${Configurable} offer=${offer} state=${state} add=${add} />`;
  return html`<div class="offer">
    <button disabled=${!!offer.obstacle} onClick=${() => add([offer.number])}
      aria-label=${`Add ${offer.order}, ${words(offer)}`}>Add</button>
    <span><b>${offer.order}</b> ${offer.about !== offer.order && offer.about}
      <small>${words(offer)}</small>
      ${offer.obstacle && html`<small>✖ ${offer.obstacle}</small>`}</span>
  </div>`;
}

/**
 * Frames that SubInstances without a connection have, as their safety logic takes them.
 * @param {State} state
 * @returns {Lengths[]}
 */
const openLengths = (state) =>
  state.subdevices
    .filter((sub) => sub.role !== "main" && sub.likely !== "main")
    .flatMap((sub) => sub.pairs)
    .filter((pair) => pair.matched && pair.connection === null)
    .map((pair) => [pair.sends_bytes, pair.takes_bytes]);

/** @param {{ offer: Offer, state: State, add: (numbers: number[], connections?: Lengths[]) => void }} props */
function Configurable({ offer, state, add }) {
  const [chosen, setChosen] = useState(/** @type {Lengths[] | null} */ (null));
  const open = openLengths(state).slice(0, offer.most_connections);
  /** @type {Lengths[]} */
  const rows = chosen ?? (open.length ? open : [[USUAL, USUAL]]);
  const count = (/** @type {number} */ number) =>
    setChosen(Array.from({ length: number }, (_, n) => rows[n] ?? [USUAL, USUAL]));
  const set = (/** @type {number} */ row, /** @type {number} */ way, /** @type {number} */ bytes) =>
    setChosen(rows.map((pair, n) => (n === row ? /** @type {Lengths} */ (pair.map((old, w) => (w === way ? bytes : old))) : pair)));
  const numbers = Array.from({ length: offer.most_connections }, (_, n) => n + 1);
  return html`<div class="offer">
    <button onClick=${() => add([offer.number], rows)}
      aria-label=${`Add ${offer.order} with ${rows.length} connections, ${words(offer)}`}>Add</button>
    <span><b>${offer.order}</b> ${offer.about}, with connections that you choose
      <small>${words(offer)}</small>
      <details>
        <summary>${rows.length} ${rows.length === 1 ? "connection" : "connections"}: ${rows.map(([to, back]) => `${to} ⇄ ${back}`).join(", ")} bytes</summary>
        <label>Connections <${Choice} value=${rows.length} values=${numbers} choose=${count} /></label>
        ${rows.map(
          (pair, row) => html`<div key=${row} class="row" role="group" aria-label=${`Slot ${row}`}>
            Slot ${row}:
            ${["from the SubInstance", "to it"].map(
              (way, n) => html`<label key=${way}>${way} <${Choice} value=${pair[n]} values=${LENGTHS}
                choose=${(/** @type {number} */ bytes) => set(row, n, bytes)} /></label>`,
            )} bytes
          </div>`,
        )}
      </details>
    </span>
  </div>`;
}

/** @param {{ value: number, values: number[], choose: (value: number) => void }} props */
function Choice({ value, values, choose }) {
  const all = values.includes(value) ? values : [...values, value];
  return html`<select value=${value} onChange=${(/** @type {any} */ event) => choose(Number(event.target.value))}>
    ${all.map((one) => html`<option key=${one} value=${one} selected=${one === value}>${one}</option>`)}
  </select>`;
}
