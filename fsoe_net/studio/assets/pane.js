// A bar between two parts of the page that a person moves; the browser keeps the size.
import { useLayoutEffect, useRef, useState } from "./vendor/hooks.js";
import { html } from "./html.js";

const LEAST = 10; // percent
const MOST = 80;
const STEP = 2;

/** @param {number} percent */
const limited = (percent) => Math.min(MOST, Math.max(LEAST, Math.round(percent)));

/** @param {string} key @param {number} usual */
function keptSize(key, usual) {
  const kept = Number(localStorage.getItem(key) ?? NaN);
  return Number.isFinite(kept) ? limited(kept) : usual;
}

/**
 * The size of the part after the bar, as percent of the whole, is the property `--NAME` of the whole.
 * @param {{ name: string, label: string, usual: number, isUpright: boolean }} props
 */
export function Splitter({ name, label, usual, isUpright }) {
  const key = `fsoe-net-pane-${name}`;
  const [percent, setPercent] = useState(keptSize(key, usual));
  const bar = useRef(/** @type {HTMLElement | null} */ (null));
  useLayoutEffect(() => {
    bar.current?.parentElement?.style.setProperty(`--${name}`, `${percent}%`);
  }, [percent]);
  const set = (/** @type {number} */ next) => {
    setPercent(limited(next));
    localStorage.setItem(key, String(limited(next)));
  };
  const move = (/** @type {PointerEvent} */ event) => {
    const whole = bar.current?.parentElement?.getBoundingClientRect();
    if (!whole || !bar.current?.hasPointerCapture(event.pointerId)) return;
    const left = isUpright ? (whole.right - event.clientX) / whole.width : (whole.bottom - event.clientY) / whole.height;
    set(100 * left);
  };
  /** @type {Record<string, number>} */
  const keys = { ArrowLeft: percent + STEP, ArrowUp: percent + STEP, ArrowRight: percent - STEP, ArrowDown: percent - STEP, Home: MOST, End: LEAST };
  const onKey = (/** @type {KeyboardEvent} */ event) => {
    if (!Object.hasOwn(keys, event.key)) return;
    event.preventDefault();
    set(keys[event.key]);
  };
  return html`<div class="splitter ${name}" role="separator" tabindex="0" ref=${bar} aria-label=${label}
    aria-orientation=${isUpright ? "vertical" : "horizontal"} aria-valuenow=${percent} aria-valuemin=${LEAST}
    aria-valuemax=${MOST} title="Drag, or use the arrow keys; double click: usual size"
    onKeyDown=${onKey} onDblClick=${() => set(usual)} onPointerMove=${move}
    onPointerDown=${(/** @type {PointerEvent} */ event) => bar.current?.setPointerCapture(event.pointerId)}></div>`;
}
