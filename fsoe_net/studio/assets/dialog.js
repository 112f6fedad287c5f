// A question before something is done: Escape and the first button leave everything as it is.
import { useEffect, useRef, useState } from "./vendor/hooks.js";
import { html } from "./html.js";

/** @param {{ question: import("./types").Question, end: () => void }} props */
export function Dialog({ question, end }) {
  const dialog = useRef(/** @type {HTMLDialogElement | null} */ (null));
  const first = useRef(/** @type {HTMLButtonElement | null} */ (null));
  const [checked, setChecked] = useState(false);
  useEffect(() => {
    const shown = dialog.current;
    shown?.showModal();
    first.current?.focus();
    return () => shown?.close(); // also gives the focus back
  }, []);
  const cancel = () => dialog.current?.close();
  return html`<dialog ref=${dialog} aria-labelledby="question" onClose=${end}>
    <h2 id="question">${question.title}</h2>
    <ul>${question.lines.map((line) => html`<li key=${line}>${line}</li>`)}</ul>
    ${question.check &&
    html`<p><label><input type="checkbox" checked=${checked} onChange=${() => setChecked(!checked)} /> ${question.check}</label></p>`}
    <p class="row">
      <button ref=${first} onClick=${cancel}>Cancel</button>
      <button class="save" disabled=${Boolean(question.check) && !checked} onClick=${() => {
        cancel();
        question.then();
      }}>${question.act}</button>
    </p>
  </dialog>`;
}
