// The network in other formats, as downloads; what a format cannot hold is said before.
import { useEffect, useState } from "./vendor/hooks.js";
import { html } from "./html.js";
import { preview, targets as fetchTargets } from "./server.js";

/** @typedef {import("./types").Export} Made */

/** @param {{ version: number, saved: boolean, close: () => void }} props */
export function Export({ version, saved, close }) {
  const [targets, setTargets] = useState(/** @type {import("./types").Targets["targets"]} */ ([]));
  const [target, setTarget] = useState("");
  const [made, setMade] = useState(/** @type {Made | { error: string } | null} */ (null));
  useEffect(() => {
    fetchTargets().then((answer) => "targets" in answer && setTargets(answer.targets));
  }, []);
  useEffect(() => {
    let isLast = true;
    setMade(null);
    if (target) preview(target, version).then((answer) => isLast && setMade(answer));
    return () => {
      isLast = false;
    };
  }, [target, version]);
  return html`<section class="exporting" aria-label="Export">
    <h2>Export</h2>
    <button class="close" onClick=${close}>Close</button>
    <label>
      Format <select value=${target} onChange=${(/** @type {any} */ event) => setTarget(event.target.value)}>
        <option value="">choose one</option>
        ${targets.map((t) => html`<option key=${t.name} value=${t.name}>${t.name}: ${t.title}</option>`)}
      </select>
    </label>
    ${!saved && html`<p class="help">It is made of the text as it is in this page, which is not saved.</p>`}
    ${made?.error && html`<p class="error" role="alert">${made.error}</p>`}
    ${made && "files" in made && html`<${Result} made=${made} />`}
  </section>`;
}

/** @param {{ made: Made }} props */
function Result({ made }) {
  const lost = [...made.notes, ...made.findings];
  return html`
    <h3>${lost.length ? "What this format cannot hold, and what was assumed" : "Nothing is lost"}</h3>
    <ul class="lost">
      ${lost.map((text, n) => html`<li key=${n}>${text}</li>`)}
    </ul>
    <p>
      <a class="button" download href=${`/api/export/${made.target}/download?version=${made.version}`}>
        Download ${made.files.length === 1 ? made.files[0].name : `${made.files.length} files as a ZIP`}
      </a>
    </p>
    ${made.files.length > 1 &&
    html`<ul>
      ${made.files.map((file) => html`<li key=${file.name}>${file.name}, ${file.bytes} bytes</li>`)}
    </ul>`}
  `;
}
