// The test record, filled in at the machine, one step at a time.
import { useCallback, useEffect, useRef, useState } from "./vendor/hooks.js";
import { html, SIGNS } from "./html.js";
import { allKept, forget, idOf, keep, keepName, lastName, othersKept, send, waits } from "./kept.js";
import { ask, post } from "./server.js";
import { Entry } from "./entry.js";

/** @typedef {import("./types").State} State */
/** @typedef {import("./types").Kept} Kept */
/** @typedef {import("./types").Part} Part */

const AGAIN_MS = 2000;

/**
 * Steps, then what is read at the SubDevices.
 * @param {import("./types").TestRecord} testRecord
 * @returns {Part[]}
 */
const partsOf = (testRecord) => [
  ...testRecord.steps.map((row) => ({ step: row.name, subdevice: "", title: row.title, fields: row.fields, row })),
  ...testRecord.devices.map((d) => ({
    step: "", subdevice: d.name, title: `read at ${d.title}`, fields: d.fields, row: null,
  })),
];

/**
 * Shape and word of a part.
 * @param {Part} part
 * @param {Kept | undefined} kept
 * @returns {[string, string, string]} and its class
 */
export function stateOf(part, kept) {
  if (kept?.theirs) return [SIGNS.warning, "another person has entered", "warning"];
  if (kept?.problem) return [SIGNS.warning, "not taken", "error"];
  if (kept?.done) return ["◔", "not sent yet", "warning"];
  if (kept) return ["✎", "not finished", ""];
  if (part.row?.is_failed) return [SIGNS.error, "failed", "error"];
  const isOpen = part.row ? part.row.is_open : Object.values(part.fields).includes("");
  return isOpen ? [SIGNS.open, "open", ""] : [SIGNS.clear, part.row ? "done" : "read", "good"];
}

/** @param {{ state: State }} props */
export function TestRecord({ state }) {
  const [testRecord, setTestRecord] = useState(/** @type {import("./types").TestRecord | null} */ (null));
  const [error, setError] = useState("");
  const [file, setFile] = useState("");
  const [at, setAt] = useState(0);
  const [kept, setKept] = useState(/** @type {Record<string, Kept>} */ ({}));
  const [isKeeping, setKeeping] = useState(true);
  const [sending, setSending] = useState("");
  const key = testRecord?.key ?? "";

  const asked = useRef(0);
  const look = useCallback(async () => {
    const mine = ++asked.current;
    const answer = await ask(`test-record?file=${file}`);
    if (mine !== asked.current) return; // of another file, or older than what is on its way
    setError(answer.error);
    if ("steps" in answer) {
      setTestRecord(answer);
      setKept(allKept(answer.key));
    }
  }, [file]);
  useEffect(() => {
    look();
  }, [file, state.version]);

  const busy = useRef(false);
  const flush = useCallback(async () => {
    // Without a file there is no place to send to; one transfer at a time.
    if (!testRecord || testRecord.number === null || busy.current) return;
    busy.current = true;
    const before = Object.values(allKept(key)).filter(waits).length;
    const why = before ? await send(key, testRecord.number) : "";
    busy.current = false;
    setSending(why);
    setKept(allKept(key));
    // Read again: the file may have entries of other people.
    if (before && !why) await look();
  }, [testRecord, key, look]);
  const waiting = Object.values(kept).filter(waits).length;
  useEffect(() => {
    if (!waiting) return undefined;
    flush();
    const again = setInterval(flush, AGAIN_MS);
    // Sent at once when the line is back, without the wait for the next attempt.
    addEventListener("online", flush);
    return () => {
      clearInterval(again);
      removeEventListener("online", flush);
    };
  }, [waiting, flush]);
  useEffect(() => {
    const onStorage = () => setKept(allKept(key)); // another tab
    addEventListener("storage", onStorage);
    return () => removeEventListener("storage", onStorage);
  }, [key]);

  if (testRecord === null) return html`<main class="plain"><p role="status">${error || "Loading …"}</p></main>`;
  if (testRecord.number === null)
    return html`<${None} state=${state} error=${error} make=${async () => {
      const answer = await post("test-record/new", {});
      setError(answer.error);
      if ("steps" in answer) setTestRecord(answer);
    }} />`;

  const parts = partsOf(testRecord);
  const number = Math.min(at, parts.length - 1);
  const part = parts[number];
  const change = (/** @type {Partial<Kept>} */ values) => {
    const { step, subdevice } = part;
    const before = kept[idOf(part)] ?? {
      // The content of the file when typing began: the server compares it with the file now.
      step, subdevice, before: part.fields, now: part.fields, done: false, sent: null, problem: "", theirs: null,
    };
    const entry = { ...before, ...values };
    setKeeping(keep(key, entry));
    setKept({ ...kept, [idOf(part)]: entry });
  };
  const others = othersKept(key);
  const done = parts.filter((p) => stateOf(p, kept[idOf(p)])[2] === "good").length;
  return html`<main class="test-record">
    <section class="step" aria-label="Step">
      ${error && html`<p class="error" role="alert">${error}</p>`}
      ${testRecord.notes.map((note) => html`<p class="error" role="alert">✖ ${note}</p>`)}
      ${!isKeeping &&
      html`<p class="error" role="alert">
        This browser keeps nothing (its storage is closed or full): do not close this page before all is sent.
      </p>`}
      <p role="status">
        <b>${done} of ${parts.length} done</b>${waiting > 0 &&
        html` · ◔ ${waiting} not sent yet: kept in this browser, and sent when the server answers${sending && ` (${sending})`}`}
      </p>
      ${part &&
      html`<${Entry} key=${idOf(part)} part=${part} kept=${kept[idOf(part)]} note=${testRecord.note}
        change=${change} name=${lastName()}
        drop=${() => {
          forget(key, part);
          setKept(allKept(key));
        }}
        finish=${(/** @type {import("./types").Fields} */ now) => {
          if (now.by) keepName(now.by);
          change({ now, done: true, problem: "" });
          setAt(Math.min(number + 1, parts.length - 1));
        }} />
      <p class="steps">
        <button class="big" disabled=${number === 0} onClick=${() => setAt(number - 1)}>← Back</button>
        <span>${number + 1} of ${parts.length}</span>
        <button class="big" disabled=${number === parts.length - 1} onClick=${() => setAt(number + 1)}>Next →</button>
      </p>`}
    </section>
    <nav class="list" aria-label="Steps">
      ${testRecord.files.length > 1 &&
      html`<p class="choice"><label for="record-file">Test record</label>
        <select id="record-file" value=${String(testRecord.number)} onChange=${(/** @type {any} */ e) => setFile(e.target.value)}>
          ${testRecord.files.map((f) => html`<option key=${f.number} value=${String(f.number)}>${f.name}</option>`)}
        </select></p>`}
      <ol>
        ${parts.map((p, n) => {
          const [shape, word, cls] = stateOf(p, kept[idOf(p)]);
          return html`<li key=${idOf(p)}>
            <button class="big" aria-current=${n === number ? "step" : undefined} onClick=${() => setAt(n)}>
              <span class="mark ${cls}">${shape}</span> ${p.title} <small>${word}</small>
            </button>
          </li>`;
        })}
      </ol>
      ${others.length > 0 &&
      html`<details>
        <summary>Entries for another test record (${others.length})</summary>
        <p class="help">Of an earlier configuration, or of another network; not sent.</p>
        <ul>
          ${others.map((other) => html`<li>${other.step || other.subdevice}: ${Object.values(other.now).filter(Boolean).join(", ")}</li>`)}
        </ul>
      </details>`}
    </nav>
  </main>`;
}

/** @param {{ state: State, error: string, make: () => void }} props */
function None({ state, error, make }) {
  return html`<main class="plain"><section aria-label="Test record">
    <h2>Test record</h2>
    ${error && html`<p class="error" role="alert">${error}</p>`}
    <p>
      There is no test record in the folder of the network: the list of what a person tries at the
      machine. It belongs to the saved file and is written to test-record.yaml next to it.
    </p>
    <button class="big" disabled=${!state.saved} onClick=${make}>
      ${state.saved ? "Write test-record.yaml" : "Write test-record.yaml: save the network first"}
    </button>
    <p class="help">fsoe-net test-record --virtual fills in what the emulated bus shows.</p>
  </section></main>`;
}
