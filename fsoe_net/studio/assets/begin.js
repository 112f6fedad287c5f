// Where there is no file yet: how to begin, and five things to try with the example.
import { html } from "./html.js";

/** @param {{ path: string, add: () => void, example: () => void }} props */
export function Begin({ path, add, example }) {
  return html`<section class="begin" aria-label="Begin">
    <h2>A new network</h2>
    <p>${path} does not exist yet. Nothing is written before you press Save.</p>
    <div class="row">
      <button onClick=${add}>Add SubDevices</button>
      <button onClick=${example}>Use the e-stop example</button>
    </div>
    <p class="help">
      Add them from the device library, or from files that you have: drop an ESI, a scan, an ENI on
      this page.
    </p>
  </section>`;
}

const THINGS = [
  ["Press “Try it”:", " the connection comes to Data on the emulated bus."],
  ["Select the line between the two boxes,", " and set the FSoE watchdog to 20: the findings explain why that is too short. Undo restores the old value."],
  ["Remove the connection and draw it again,", " from slot to slot: it is not confirmed before you have compared it with the safety project."],
  ["Write “size: 5” in the text", " for the first “size: 6”: see the finding next to its part, and follow its hint."],
  ["Open “Export”", " and choose “eni”: the page lists what that format cannot hold."],
];

/** @param {{ close: () => void }} props */
export function Things({ close }) {
  return html`<section class="begin" aria-label="Five things to try">
    <h2>The e-stop example: five things to try</h2>
    <ol>
      ${THINGS.map(([what, then], n) => html`<li key=${n}><b>${what}</b>${then}</li>`)}
    </ol>
    <button onClick=${close}>Close</button>
  </section>`;
}
