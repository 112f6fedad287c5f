// The list of what is wrong, each with its place and the next step.
import { html, SEVERITIES } from "./html.js";

/** @typedef {import("./types").Finding} Finding */

/**
 * @param {{ findings: Finding[], show: (line: number, column?: number) => void,
 *   act: (name: string, body: object) => void }} props
 */
export function Findings({ findings, show, act }) {
  return html`<section class="findings" aria-label="Findings">
    <h2>${findings.length ? `Findings (${findings.length})` : "No findings"}</h2>
    <ol>
      ${bySeverity(findings).map(([finding, number]) => {
        const [shape, word] = SEVERITIES[finding.severity];
        const place = finding.own ? `line ${finding.line}` : `${finding.file}:${finding.line}`;
        return html`<li key=${number} class=${finding.severity}>
          <button class="message" disabled=${!finding.own || !finding.line}
            onClick=${() => show(finding.line, finding.column)}>
            <span class="mark ${finding.severity}">${shape} ${word}</span>
            <code>${finding.code}</code> <small>${place}</small>
            <span>${finding.message}</span>
          </button>
          ${finding.related.map(
            (other) => html`<p class="related">see ${other.place}: ${other.message}</p>`,
          )}
          ${finding.hint && html`<p class="hint">${finding.hint}</p>`}
          ${finding.fixable &&
          html`<button onClick=${() => act("fix", { finding: number })}>Apply the hint</button>`}
        </li>`;
      })}
    </ol>
  </section>`;
}

/**
 * Findings with their numbers, the worst first; alike ones stay in the order of the text.
 * @param {Finding[]} findings
 * @returns {[Finding, number][]}
 */
function bySeverity(findings) {
  const order = Object.keys(SEVERITIES);
  const rank = (/** @type {[Finding, number]} */ [finding]) => order.indexOf(finding.severity);
  return findings
    .map((finding, number) => /** @type {[Finding, number]} */ ([finding, number]))
    .sort((a, b) => rank(a) - rank(b));
}
