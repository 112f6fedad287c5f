// Preact without a build step: templates are strings that htm reads.
import { h } from "./vendor/preact.js";
import htm from "./vendor/htm.js";

export const html = htm.bind(h);

/** The signs of a judgement, as in reports: MARKS in fsoe_net/document/model.py. */
export const SIGNS = { clear: "✔", note: "●", open: "○", warning: "▲", error: "✖" };

/** @type {Record<string, [string, string]>} Sign and word of a severity: never colour alone. */
export const SEVERITIES = { error: [SIGNS.error, "error"], warning: [SIGNS.warning, "warning"], info: [SIGNS.note, "note"] };

/** @type {Record<string, string>} */
export const ROLES = {
  main: "MainInstance",
  sub: "SubInstance",
  both: "Main- and SubInstance",
  "": "no FSoE connection",
};

/**
 * The worst severity of some findings.
 * @param {import("./types").Finding[]} findings
 */
export function worst(findings) {
  return ["error", "warning", "info"].find((s) => findings.some((f) => f.severity === s)) ?? "";
}

/** @param {{ severity: string }} props */
export function Mark({ severity }) {
  if (!severity) return null;
  const [shape, word] = SEVERITIES[severity];
  return html`<span class="mark ${severity}" title=${word}>${shape}<span class="unseen">${word}</span></span>`;
}
