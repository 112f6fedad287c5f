// A try of the network on the emulated bus: does it come up?
import { useState } from "./vendor/hooks.js";
import { html } from "./html.js";
import { tryIt } from "./server.js";

/** @typedef {import("./types").Tried} Tried */

/**
 * @param {{ content: string, hasErrors: boolean, tried: Tried | { error: string } | null,
 *   setTried: (tried: Tried | { error: string }) => void }} props
 */
export function Trial({ content, hasErrors, tried, setTried }) {
  const [runs, setRuns] = useState(false);
  const start = async () => {
    setRuns(true);
    setTried(await tryIt());
    setRuns(false);
  };
  return html`<section class="trial" aria-label="Emulated bus">
    <h2>Does it come up?</h2>
    <p class="help">
      The emulated bus runs until all connections stay in Data, at most one second; nothing is sent to a real
      one. It shows nothing about your devices, cables and safety project: those are tried at the machine.
    </p>
    <button disabled=${runs || hasErrors} onClick=${start}>
      ${runs ? "Runs …" : hasErrors ? "Try it: correct the errors first" : "Try it"}
    </button>
    ${tried?.error && html`<p class="error" role="alert">${tried.error}</p>`}
    ${tried && "events" in tried && html`<${Result} tried=${tried} isOld=${tried.content !== content} />`}
  </section>`;
}

/** @param {{ tried: Tried, isOld: boolean }} props */
function Result({ tried, isOld }) {
  const there = tried.connections.filter((c) => !c.absent);
  const up = there.filter((c) => c.in_data).length;
  return html`
    <p role="status">
      <b>${tried.passed ? "✔" : "✖"} ${up} of ${there.length} in Data</b>
      ${isOld && " – of an earlier text; try it again"}
    </p>
    <details>
      <summary>Each connection; the drawing shows them also</summary>
      <table>
        <thead>
          <tr><th scope="col">connection</th><th scope="col">state</th><th scope="col">Data after</th>
            <th scope="col">resets</th></tr>
        </thead>
        <tbody>
          ${tried.connections.map(
            (c) => html`<tr key=${c.name}>
              <th scope="row">${c.name}</th>
              <td>${c.absent ? "–" : c.in_data ? "✔" : "✖"} ${c.state}</td>
              <td>${c.absent ? "–" : c.time_to_data_ms === null ? "never" : `${c.time_to_data_ms} ms`}</td>
              <td>${c.absent ? "–" : c.resets}</td>
            </tr>`,
          )}
        </tbody>
      </table>
    </details>
    ${tried.connections.some((c) => c.chosen.length) &&
    html`<p class="help">
      Chosen for this try, since the file does not state it: ${" "}
      ${tried.connections.filter((c) => c.chosen.length).map((c) => `${c.name}: ${c.chosen.join(", ")}`).join("; ")}
    </p>`}
    <details>
      <summary>What happened, in order (${tried.events.length})</summary>
      <ol class="events" tabindex="0" aria-label="Events of the try">
        ${tried.events.map(
          (e, n) => html`<li key=${n}><code>${e.time_ms} ms</code> ${e.source}: ${e.text}</li>`,
        )}
      </ol>
      ${tried.events_left_out > 0 && html`<p>${tried.events_left_out} more: fsoe-net run</p>`}
    </details>
  `;
}
