// Documents about the network: report, robot, differences, incidents, intervention log.
import { useEffect, useRef, useState } from "./vendor/hooks.js";
import { html } from "./html.js";
import { ask } from "./server.js";

/** @typedef {import("./types").State} State */
/** @typedef {import("./types").CompanionFile} CompanionFile */
/** @typedef {import("./types").Listed} Listed */

/**
 * What is shown: its address, title, and the content of the network it is made from; null: of none.
 * @typedef {{ address: string, title: string, content: string | null, query: string }} Shown
 */

/** @param {{ state: State }} props */
export function Records({ state }) {
  const [listed, setListed] = useState(/** @type {Listed | null} */ (null));
  const [error, setError] = useState("");
  const [shown, setShown] = useState(/** @type {Shown | null} */ (null));
  const look = async () => {
    const answer = /** @type {Listed | { error: string }} */ (await ask("records"));
    setError(answer.error);
    if ("files" in answer) setListed(answer);
  };
  useEffect(() => {
    look();
  }, []);
  const pane = useRef(/** @type {HTMLElement | null} */ (null));
  useEffect(() => {
    if (shown) pane.current?.scrollIntoView(); // on a narrow page it is below
  }, [shown]);

  /** @type {(title: string, kind: string, query: string, ofText?: boolean) => void} */
  const show = (title, kind, query, ofText = false) => {
    const content = ofText ? state.content : null;
    const address = `/records/${kind}?${query}${ofText ? `&content=${content}` : ""}`;
    setShown({ address, title, content, query: `/records/${kind}?${query}` });
  };
  const files = listed?.files ?? [];
  const of = (/** @type {string[]} */ ...kinds) => files.filter((f) => kinds.includes(f.kind));
  return html`<main class="records">
    <aside aria-label="Records">
      ${error && html`<p class="error" role="alert">${error}</p>`}
      <p class="help">
        Of the folder of the network. ${" "}
        <button onClick=${look}>Look again</button>
      </p>
      <${Report} testRecords=${of("test_record")} records=${of("record")} show=${show} />
      <${Pages} title="Robot" files=${of("robot")}
        none="No robot description (URDF or xacro) next to the network."
        show=${(/** @type {CompanionFile} */ f) => show(`Robot ${f.name}`, "robot", `file=${f.number}`)} />
      <${Difference} files=${of("record", "robot", "other")} show=${show} />
      <${Pages} title="Incidents" files=${of("incident").reverse()}
        none="No incident files: fsn-master --incidents writes them, and so does fsoe-net run."
        show=${(/** @type {CompanionFile} */ f) => show(f.name, "incident", `file=${f.number}`)} />
      <${Pages} title="Intervention log" files=${of("log")}
        none="No log: fsn-master --intervention-log writes one."
        show=${(/** @type {CompanionFile} */ f) => show(`Intervention log ${f.name}`, "log", `file=${f.number}`)} />
      <section aria-label="Sign off">
        <h2>Sign off</h2>
        <p class="help">
          A person signs, with a key, on the command line; this page signs nothing. Type in the folder
          of the network, with your names and key:
        </p>
        <pre tabindex="0" aria-label="Commands">${(listed?.commands ?? []).join("\n")}</pre>
      </section>
    </aside>
    <section class="document" aria-label="Document" ref=${pane}>
      ${shown === null
        ? html`<p class="help">Choose what to see.</p>`
        : html`<p class="bar">
              <b>${shown.title}</b>
              ${shown.content !== null && shown.content !== state.content &&
              html`<span class="old" role="status">▲ of an earlier text
                <button onClick=${() => setShown({ ...shown, content: state.content, address: `${shown.query}&content=${state.content}` })}>
                  Make it again
                </button></span>`}
              <a href=${shown.address} target="_blank" rel="noopener">Open in a tab, to print</a>
            </p>
            <iframe key=${shown.address} src=${shown.address} title=${shown.title} sandbox=""></iframe>`}
    </section>
  </main>`;
}

/** @param {{ files: CompanionFile[], title: string, none: string, show: (file: CompanionFile) => void }} props */
function Pages({ files, title, none, show }) {
  return html`<section aria-label=${title}>
    <h2>${title}${files.length > 0 && ` (${files.length})`}</h2>
    ${files.length === 0 && html`<p class="help">${none}</p>`}
    <ul class="pages">
      ${files.map(
        (file) => html`<li key=${file.number}><button onClick=${() => show(file)}>${file.name}</button></li>`,
      )}
    </ul>
  </section>`;
}

/** @param {any} props */
function Choice({ label, files, none, chosen, choose }) {
  const id = `choice-${label.replace(/\W+/g, "-")}`;
  return html`<p class="choice">
    <label for=${id}>${label}</label>
    <select id=${id} value=${chosen}
      onChange=${(/** @type {any} */ event) => choose(event.target.value)}>
      <option value="">${none}</option>
      ${files.map(
        (/** @type {CompanionFile} */ f) => html`<option key=${f.number} value=${f.number}>${f.name}, ${f.words}</option>`,
      )}
    </select>
  </p>`;
}

/** @param {any} props */
function Report({ testRecords, records, show }) {
  const [testRecord, setTestRecord] = useState("");
  const [accepted, setAccepted] = useState("");
  return html`<section aria-label="Report">
    <h2>Report</h2>
    <p class="help">Of the text as it is in the page, saved or not.</p>
    ${testRecords.length > 0 &&
    html`<${Choice} label="Test record" none="without" files=${testRecords} chosen=${testRecord} choose=${setTestRecord} />`}
    ${records.length > 0 &&
    html`<${Choice} label="Accepted state" none="without" files=${records} chosen=${accepted} choose=${setAccepted} />`}
    <button onClick=${() => show("Report", "report", `test_record=${testRecord}&accepted=${accepted}`, true)}>
      Show the report
    </button>
  </section>`;
}

/** @param {any} props */
function Difference({ files, show }) {
  const [file, setFile] = useState("");
  return html`<section aria-label="Difference">
    <h2>Difference</h2>
    <p class="help">From a file to the text as it is in the page, by meaning.</p>
    <${Choice} label="From" none="the saved network file" files=${files} chosen=${file} choose=${setFile} />
    <button onClick=${() => show("Difference", "difference", `file=${file}`, true)}>Show the difference</button>
  </section>`;
}
