// SubDevices that can be added: of the device library, and of files that a person gives to the page.
import { useEffect, useRef, useState } from "./vendor/hooks.js";
import { onBus } from "./bus.js";
import { chosen } from "./given.js";
import { html } from "./html.js";
import { Offers } from "./offers.js";
import { offers as fetchOffers, putAway, upload } from "./server.js";

/** @typedef {import("./types").State} State */
/** @typedef {import("./types").Offer} Offer */
/** @typedef {import("./types").Uploads} Uploads */

/**
 * @param {{ state: State, act: import("./types").Act, given: import("./types").Given[], close: () => void,
 *   choose: (what: import("./types").Selected) => void }} props
 */
export function Adding({ state, act, given, close, choose }) {
  const [uploads, setShelf] = useState(/** @type {Uploads | null} */ (null));
  const [error, setError] = useState("");
  const [busy, setBusy] = useState(false);
  const [said, setSaid] = useState(/** @type {string[]} */ ([]));
  const [bus, setBus] = useState(0);
  const top = useRef(/** @type {HTMLElement | null} */ (null));

  const take = (/** @type {Uploads | { error: string }} */ answer) => {
    setError(answer.error);
    if (!("offers" in answer)) return;
    setShelf(answer);
    if (answer.files.length || state.wiring) act("look"); // a scan shows how the cables run
  };
  /** Uploads and removals happen in the order in which a person made them. */
  const last = useRef(/** @type {Promise<void>} */ (Promise.resolve()));
  const inTurn = (/** @type {(() => Promise<Uploads | { error: string }>)[]} */ requests) => {
    last.current = last.current.then(async () => {
      setBusy(true);
      for (const request of requests) take(await request());
      setBusy(false);
    });
  };
  const give = (/** @type {import("./types").Given[]} */ files) =>
    inTurn(files.map((file) => () => upload(file)));
  useEffect(() => {
    top.current?.focus();
    if (!given.length) fetchOffers().then(take);
  }, []);
  useEffect(() => {
    if (given.length) give(given);
  }, [given]);

  const add = async (/** @type {number[]} */ numbers, /** @type {[number, number][]} */ connections = []) => {
    // The server takes the offers by number; it refuses numbers of an earlier list.
    const answer = await act("add", { offers: numbers, connections, bus });
    setError(answer.error);
    if (answer.error || !("version" in answer)) return;
    // The server may change names that are taken, so that the new ones are found by comparison.
    const before = new Set(state.subdevices.map((s) => s.name));
    const made = answer.subdevices.filter((s) => !before.has(s.name));
    setSaid([`Added: ${made.map((s) => s.name).join(", ")}`, ...(answer.said ?? [])]);
    if (made.length) choose({ subdevice: made[made.length - 1].name });
  };
  const propose = async () => {
    const answer = await act("import");
    setError(answer.error);
    if (!answer.error) close();
  };
  const taken = new Set(onBus(state, bus).filter((s) => !s.alias).map((s) => s.position));
  return html`<section class="adding" aria-label="Add SubDevices" aria-busy=${busy}>
    <h2 tabindex="-1" ref=${top}>Add SubDevices</h2>
    <button class="close" onClick=${close}>Close</button>
    <p class="help">
      From the device library below, or from files: ESI, scan, SII image, ENI, and all else that
      fsoe-net init reads. Drop them anywhere on this page. Nothing is written before Save.
    </p>
    ${["Files", "Folder"].map(
      (kind) => html`<label key=${kind}>
        ${kind} <input type="file" multiple webkitdirectory=${kind === "Folder"} disabled=${busy}
          onChange=${(/** @type {any} */ event) => {
            give(chosen(event.target));
            // Cleared, so that the same file can be chosen a second time.
            event.target.value = "";
          }} />
      </label>`,
    )}
    ${busy && html`<p role="status">Reads the file …</p>`}
    ${error && html`<p class="error" role="alert">${error}</p>`}
    ${uploads?.files.length
      ? html`<${Given} uploads=${uploads} taken=${taken} add=${add} propose=${propose} forget=${() => inTurn([putAway])} />`
      : null}
    ${said.length > 0 &&
    html`<div role="status">
      <ul>
        ${said.map((text, n) => html`<li key=${n}>${text}</li>`)}
      </ul>
    </div>`}
    ${state.buses.length > 0 &&
    html`<label>
      Bus <select value=${bus} onChange=${(/** @type {any} */ event) => setBus(Number(event.target.value))}>
        ${state.buses.map((name, n) => html`<option key=${n} value=${n}>${name}</option>`)}
      </select>
    </label>`}
    <${Offers} state=${state} offers=${uploads?.offers ?? []} add=${add} />
    <p class="help">
      Process data of the device library are unverified: compare them with your device, or take its
      ESI or a scan.
    </p>
  </section>`;
}

/** @param {{ uploads: Uploads, taken: Set<number>, add: (numbers: number[]) => void, propose: () => void, forget: () => void }} props */
function Given({ uploads, taken, add, propose, forget }) {
  const { proposal } = uploads;
  // Several offers for one position are alternatives: only a person can choose.
  const ways = (/** @type {Offer} */ offer) =>
    placed.filter((other) => other.position === offer.position && !other.obstacle).length;
  const placed = uploads.offers.filter((offer) => offer.position !== null && !taken.has(offer.position));
  const clear = placed.filter((offer) => !offer.obstacle && !offer.most_connections && ways(offer) === 1);
  const several = new Set(placed.filter((o) => ways(o) > 1).map((o) => o.position)).size;
  return html`<div class="given">
    <p>
      <b>${uploads.files.join(", ")}</b>${" "}
      <button onClick=${forget}>Remove</button>
    </p>
    <ul>
      ${uploads.findings.map(
        (row, n) => html`<li key=${n} class=${row.severity}>
          ${row.severity}: ${row.place}: ${row.message}${row.hint && ` → ${row.hint}`}
        </li>`,
      )}
    </ul>
    ${proposal &&
    html`<p>
        A bus of ${proposal.subdevices} SubDevices; ${proposal.connections} FSoE connections,
        ${" "}${proposal.unconfirmed} of them to be confirmed by you.
      </p>
      <div class="row">
        <button onClick=${propose}>Use it as the network</button>
        <button disabled=${!clear.length} onClick=${() => add(clear.map((offer) => offer.number))}>
          Add its SubDevices that are not here (${clear.length})
        </button>
      </div>
      <p class="help">
        This replaces the text; Undo restores yours.
        ${several > 0 && ` ${several} have several possible process data: choose below.`}
      </p>
      ${[...proposal.open, ...proposal.notes].length > 0 &&
      html`<details>
        <summary>Open, assumed or left out (${proposal.open.length + proposal.notes.length})</summary>
        <ul>
          ${[...proposal.open, ...proposal.notes].map((text, n) => html`<li key=${n}>${text}</li>`)}
        </ul>
      </details>`}`}
  </div>`;
}
