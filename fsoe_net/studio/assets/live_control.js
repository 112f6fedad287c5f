// What a person may do to the bus of fsn-master, with --allow-control: one page at a time, in sight.
import { useEffect, useRef, useState } from "./vendor/hooks.js";
import { Dialog } from "./dialog.js";
import { html } from "./html.js";
import { live } from "./live_server.js";

/** @typedef {import("./types").Held} Held */
/** @typedef {import("./types").Output} Output */
/** @typedef {import("./types").Question} Question */

const KEEP_MS = 500;
const MANY = 8;
const NO_EMERGENCY_STOP = "This is not an emergency stop: that is the device at the machine.";
const SECURE = [
  "First secure the machine by its own procedure. This page neither does nor checks this.",
  "Make sure that no person is in the danger zone or can enter it.",
];
/** Of the bus: what it is called, what follows. @type {Record<string, [string, string[]]>} */
const BUS = {
  start: ["Start the bus", [
    ...SECURE,
    "SubDevices go to OP, FSoE connections reach Data. The machine's own logic decides what happens then.",
  ]],
  stop: ["Stop the bus", [
    NO_EMERGENCY_STOP,
    "Outputs take their stop values and SubDevices leave OP, for all users of this bus.",
    "FSoE devices go to their fail-safe state, each after its FSoE watchdog.",
  ]],
  restart: ["Restart the bus", [
    ...SECURE,
    "The bus stops: outputs take their stop values, FSoE devices go to their fail-safe state. Then it starts with the same plan.",
    NO_EMERGENCY_STOP,
  ]],
};

/** @param {{ view: import("./types").LiveView }} props */
export function Control({ view }) {
  const [held, setHeld] = useState(/** @type {Held | null} */ (null));
  const [outputs, setOutputs] = useState(/** @type {Output[]} */ ([]));
  const [why, setWhy] = useState("");
  const [said, setSaid] = useState("");
  const [error, setError] = useState("");
  const [question, setQuestion] = useState(/** @type {Question | null} */ (null));
  const token = useRef("");
  token.current = held?.token ?? "";

  const lose = (/** @type {string} */ text) => {
    token.current = ""; // at once: an answer may come before this is rendered
    setHeld(null);
    setOutputs([]);
    setQuestion(null);
    setSaid("");
    setError(text);
  };
  useEffect(() => {
    if (!held) return;
    let waits = false;
    const keep = async () => {
      if (document.hidden || waits) return; // in sight, or the lease ends
      waits = true;
      // One request at a time: on a slow line, answers would queue up.
      const answer = await live("keep-control", { token: held.token });
      waits = false;
      if (token.current !== held.token) return; // it was given back or lost meanwhile
      if (answer.error) return lose(answer.error);
      setWhy(answer.why);
      if (!answer.why) setOutputs(answer.outputs); // else what was read last stays
    };
    const timer = setInterval(keep, KEEP_MS);
    document.addEventListener("visibilitychange", keep);
    keep();
    return () => {
      clearInterval(timer);
      document.removeEventListener("visibilitychange", keep);
    };
  }, [held]);
  useEffect(() => () => {
    // A view that is left no longer renews its lease; giving it back is faster than its timeout.
    if (token.current) live("give-control", { token: token.current }); // who looks elsewhere
  }, []);

  const take = async () => {
    const answer = await live("take-control");
    setError(answer.error);
    if (!answer.error) setHeld(answer);
  };
  const give = async () => {
    const answer = await live("give-control", { token: token.current });
    lose(answer.error);
    setSaid("Control is given back; all outputs set here have taken their stop values.");
  };
  const order = async (/** @type {string} */ act, /** @type {object} */ body, /** @type {string} */ done) => {
    const answer = await live(act, { ...body, token: token.current });
    setError(answer.error);
    setSaid(answer.error ? "" : done);
  };
  const bus = (/** @type {string} */ word) => {
    const [title, lines] = BUS[word];
    const then = () => order(`${word}-bus`, {}, `${word} is requested; the events show the result.`);
    setQuestion({ title: `${title}?`, lines, check: "", act: title, then });
  };
  const set = (/** @type {Output} */ { name, restart_relevant, stop_value }, /** @type {string} */ value) => {
    const body = { name, value };
    const act = restart_relevant ? "arm-output" : "set-output";
    // The stop value needs no confirmation: it must always be possible to stop.
    if (!restart_relevant || value === stop_value) return void order(act, body, `${name} is set to ${value}.`);
    setQuestion({
      title: `Before ${name} is set to ${value}`,
      lines: [...SECURE, "This output can restart a machine. The reason for the stop must be known and corrected."],
      check: "I have done all of this now, for this one change",
      act: `Arm and set ${name} to ${value}`,
      then: () => order(act, body, `${name} was armed and set to ${value}.`),
    });
  };
  const seconds = (held?.lease_ms ?? 0) / 1000;
  return html`<section class="control" aria-label="Control the bus">
    <h2>Control this bus</h2>
    <p>▲ ${NO_EMERGENCY_STOP} Each act is in the events, and in the intervention log of fsn-master where it keeps one.</p>
    ${error && html`<p class="error" role="alert">✖ ${error}</p>`}
    <p role="status">${said}</p>
    ${held
      ? html`<p><strong>✔ This page has control</strong>, as ${held.access || "this user"}. Its values hold while it is in
            sight. If it is hidden, closed or stuck, all outputs set here take their stop values after ${seconds} s.</p>
          <div class="row">
            <${Bus} state=${view.state} access=${held.access} bus=${bus} />
            <button onClick=${give}>Give control back</button>
          </div>
          ${why && html`<p>▲ Values were read earlier: ${why}</p>`}
          <${Outputs} outputs=${outputs} set=${set} />`
      : view.control
        ? html`<p>● Another page has control. Here it can be taken when that page gives it back, is closed or hidden.</p>`
        : html`<button onClick=${take}>Take control</button>`}
    ${question && html`<${Dialog} key=${question.title} question=${question} end=${() => setQuestion(null)} />`}
  </section>`;
}

/** @param {{ state: string, access: string, bus: (word: string) => void }} props */
function Bus({ state, access, bus }) {
  if (access === "operator") return html`<span>○ Starting and stopping the bus needs the role maintainer.</span>`;
  const down = state === "stopped" || state === "failed";
  return html`${["start", "stop", "restart"].map(
    (word) => html`<button key=${word} disabled=${down !== (word === "start")} onClick=${() => bus(word)}>${BUS[word][0]} …</button>`,
  )}`;
}

/** @param {{ outputs: Output[], set: (output: Output, value: string) => void }} props */
function Outputs({ outputs, set }) {
  const [part, setPart] = useState("");
  const shown = outputs.filter((o) => o.name.includes(part));
  return html`<h3>Outputs outside of copies and FSoE frames</h3>
    ${outputs.length > MANY &&
    html`<p><label>Only with <input type="search" value=${part} onInput=${(/** @type {any} */ e) => setPart(e.target.value)} /> in the name</label></p>`}
    <ul class="outputs">${shown.map((output) => html`<${Row} key=${output.name} output=${output} set=${set} />`)}</ul>
    ${!shown.length && html`<p>None now.</p>`}`;
}

/** @param {{ output: Output, set: (output: Output, value: string) => void }} props */
function Row({ output, set }) {
  const [text, setText] = useState(output.kind === "bool" ? "1" : "");
  const { name, interface: known, kind, value, stop_value, client, mine } = output;
  const others = client !== null && !mine;
  // Another client writes the output: fsn-master would refuse a second writer.
  const who = mine ? "● set here" : others ? `✖ client ${client} writes it` : "○ not written";
  const onText = (/** @type {any} */ e) => setText(e.target.value);
  return html`<li>
    <b>${name}</b> = <span class="state">${value}</span>
    <small>${known && `as ${known}, `}${kind}, raw; stop value ${stop_value}; ${who}${output.restart_relevant ? "; ▲ can restart a machine" : ""}</small>
    <form class="row" onSubmit=${(/** @type {Event} */ event) => {
      event.preventDefault();
      set(output, text.trim());
    }}>
      ${kind === "bool"
        ? html`<select aria-label=${`New value of ${name}`} value=${text} onChange=${onText}><option>0</option><option>1</option></select>`
        : html`<input aria-label=${`New value of ${name}`} autocomplete="off" value=${text} onInput=${onText} />`}
      <button aria-label=${`Set ${name}`} disabled=${others || !text.trim()}>${output.restart_relevant ? "Arm and set …" : "Set"}</button>
      <button type="button" aria-label=${`Stop value of ${name}`} disabled=${!mine || value === stop_value}
        onClick=${() => set(output, stop_value)}>Stop value</button>
    </form>
  </li>`;
}
