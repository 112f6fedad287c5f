// A symbol for each kind of SubDevice, see fsoe_net/model/kinds.py; drawn in 24 × 24 units.
import { html } from "./html.js";

/** @type {Record<import("./types").SubDeviceKind, [string, string]>} */
const KINDS = {
  coupler: ["coupler", "M5 4h14v16H5zM9 8h6v3H9zM9 14h6v3H9z"],
  terminal: ["terminal", "M8 3h8v18H8zM12 6.5v2M12 11v2M12 15.5v2"],
  drive: ["drive", "M3 7h12v10H3zM15 10h6v4h-6zM6 7V5M12 7V5M6 19v-2M12 19v-2"],
  logic: ["safety logic", "M12 3l8 3v6c0 5-3.5 7.5-8 9-4.5-1.5-8-4-8-9V6zM8.5 12l2.5 2.5 4.5-5"],
};

/** The kind of a SubDevice in words. @param {import("./types").SubDeviceKind} kind */
export const kindText = (kind) => KINDS[kind][0];

/**
 * The symbol of a kind, to be placed in a drawing; `x` and `y` are its upper left corner.
 * @param {{ kind: import("./types").SubDeviceKind, x?: number, y?: number, size?: number }} props
 */
export function Symbol({ kind, x = 0, y = 0, size = 24 }) {
  return html`<svg class="symbol" x=${x} y=${y} width=${size} height=${size} viewBox="0 0 24 24"
    aria-hidden="true"><path d=${KINDS[kind][1]} fill="none" stroke="currentColor" stroke-width="1.6" stroke-linejoin="round" stroke-linecap="round" /></svg>`;
}
