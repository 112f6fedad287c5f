// One step of a test record: what to do, what shall happen, what came of it.
import { useState } from "./vendor/hooks.js";
import { html, SIGNS } from "./html.js";

/** @typedef {import("./types").Part} Part */
/** @typedef {import("./types").Kept} Kept */
/** @typedef {import("./types").Fields} Fields */

/** @type {Record<string, [string, string]>} Shape and words of a result. */
const RESULTS = {
  "as expected": [SIGNS.clear, "as expected"],
  "not as expected": [SIGNS.error, "not as expected"],
  "not run": [SIGNS.open, "not run"],
};
/** @type {Record<string, [string, string]>} */
const AT_DEVICE = {
  firmware: ["Firmware", "version, as the device or its tool shows it"],
  serial: ["Serial number", "of the device"],
  safety_project_crc: ["CRC of the safety project", "as the tool of the safety project shows it"],
};

/** The day here, not in UTC. */
const today = () => {
  const now = new Date();
  return new Date(now.getTime() - now.getTimezoneOffset() * 60_000).toISOString().slice(0, 10);
};

/** @param {Fields} fields */
const inWords = (fields) => Object.values(fields).filter((text) => text).join(", ") || "nothing";

/**
 * @param {{ part: Part, kept: Kept | undefined, note: string, name: string,
 *   change: (values: Partial<Kept>) => void, finish: (now: Fields) => void, drop: () => void }} props
 */
export function Entry({ part, kept, note, name, change, finish, drop }) {
  const [missing, setMissing] = useState("");
  const now = kept?.now ?? part.fields;
  const set = (/** @type {Fields} */ values) => {
    setMissing("");
    // A change makes the entry unfinished: it must not be sent half typed.
    change({ now: { ...now, ...values }, done: false, problem: "" });
  };
  const end = () => {
    const entry = { ...now };
    // A decimal comma is what many keyboards and people write.
    if (entry.measured_ms) entry.measured_ms = entry.measured_ms.trim().replace(",", ".");
    const empty = part.row ? ["result", "by", "date"].filter((key) => !entry[key].trim()) : [];
    if (empty.length) setMissing(`Missing: ${empty.join(", ").replace("by", "name")}`);
    else finish(entry);
  };
  return html`
    <h2>${part.title}</h2>
    ${part.row ? html`<${Step} row=${part.row} note=${note} />` : html`<p>Where there is none, write “not applicable: why”.</p>`}
    ${kept?.theirs &&
    html`<div class="open" role="alert">
      <p>▲ Another person has entered meanwhile: <b>${inWords(kept.theirs)}</b></p>
      <button class="big" onClick=${drop}>Keep theirs, discard mine</button>
      <button class="big" onClick=${() => change({ before: kept.theirs ?? {}, theirs: null })}>
        Enter mine${part.row ? "; theirs stays in the remark" : " instead"}
      </button>
    </div>`}
    ${kept?.problem && html`<p class="error" role="alert">✖ ${kept.problem}</p>`}
    ${part.row
      ? html`<fieldset class="results">
            <legend>Result at the machine</legend>
            ${Object.entries(RESULTS).map(
              ([result, [shape, words]]) => html`<label key=${result} class="big">
                <input type="radio" name="result" value=${result} checked=${now.result === result}
                  onChange=${() => set({ result, by: now.by || name, date: now.date || today() })} />
                ${shape} ${words}
              </label>`,
            )}
          </fieldset>
          <${Line} key="measured_ms" label="Measured time, ms" help=${part.row.limit_ms === null ? "where there is one" : `at most ${part.row.limit_ms} ms`}
            now=${now} name="measured_ms" set=${set} mode="decimal" />
          <p class="answer"><label for="entry-remark">Remark</label>
            <textarea id="entry-remark" rows="2" value=${now.remark}
              onInput=${(/** @type {any} */ event) => set({ remark: event.target.value })}></textarea></p>
          <${Line} key="by" label="Name" help="who was there" now=${now} name="by" set=${set} />
          <${Line} key="date" label="Day" help="" now=${now} name="date" set=${set} type="date" />`
      : Object.keys(part.fields).map(
          (field) => html`<${Line} key=${field} label=${AT_DEVICE[field][0]} help=${AT_DEVICE[field][1]}
            now=${now} name=${field} set=${set} />`,
        )}
    ${missing && html`<p class="error" role="alert">${missing}</p>`}
    <p class="steps">
      <button class="big save" disabled=${!kept} onClick=${end}>Enter, and continue</button>
      ${kept && html`<button class="big" onClick=${drop}>Discard my entry</button>`}
    </p>
  `;
}

/** @param {{ row: import("./types").Step, note: string }} props */
function Step({ row, note }) {
  return html`
    <dl>
      <dt>Do</dt><dd class="do">${row.what}</dd>
      <dt>Expect</dt><dd>${row.expected}</dd>
      ${row.limit_ms !== null && html`<dt>At most</dt><dd>${row.limit_ms} ms, ${row.limit_source}</dd>`}
      ${row.emulated && html`<dt>${note}</dt><dd>${row.emulated}</dd>`}
      ${row.live && html`<dt>Live</dt><dd>${row.live}</dd>`}
    </dl>
    <p class="help">Machines may move or stop: guard the area, and make sure that no person is in it.</p>
  `;
}

/** @param {any} props */
function Line({ label, help, now, name, set, mode, type = "text" }) {
  const id = `entry-${name}`;
  return html`<p class="answer">
    <label for=${id}>${label} <small>${help}</small></label>
    <input id=${id} type=${type} inputmode=${mode} autocomplete="off" value=${now[name]}
      onInput=${(/** @type {any} */ event) => set({ [name]: event.target.value })} />
  </p>`;
}
