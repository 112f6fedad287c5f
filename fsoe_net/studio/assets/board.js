// A drawing that is larger than its frame: zoom, pan, fit.
import { useEffect, useLayoutEffect, useRef, useState } from "./vendor/hooks.js";
import { html } from "./html.js";

const LEAST = 0.25;
const MOST = 2;
const STEP = 1.2;

/** Parts that a press acts on; the rest is ground, which is dragged. */
const PARTS = "button, [role=button], .card, summary, a";

/** @param {{ label: string, help: unknown, children: unknown }} props */
export function Board({ label, help, children }) {
  const [zoom, setZoom] = useState(1);
  const frame = useRef(/** @type {HTMLElement | null} */ (null));
  const sheet = useRef(/** @type {HTMLElement | null} */ (null));
  /** The point of the frame that stays where it is, and the zoom before. */
  const held = useRef({ x: 0, y: 0, zoom: 1 });
  const drag = useRef(/** @type {{ x: number, y: number } | null} */ (null));

  const zoomTo = (/** @type {number} */ next, x = 0, y = 0) => {
    held.current = { x, y, zoom };
    setZoom(Math.min(MOST, Math.max(LEAST, next)));
  };
  const fit = () => {
    const [view, whole] = [frame.current, sheet.current];
    if (view && whole) zoomTo(Math.min(1, view.clientHeight / whole.offsetHeight));
  };
  useLayoutEffect(() => {
    const view = frame.current;
    if (!view) return;
    const { x, y, zoom: before } = held.current;
    view.scrollLeft = ((view.scrollLeft + x) / before) * zoom - x;
    view.scrollTop = ((view.scrollTop + y) / before) * zoom - y;
  }, [zoom]);
  useEffect(() => {
    const view = frame.current;
    const onWheel = (/** @type {WheelEvent} */ event) => {
      if (!view || !(event.ctrlKey || event.metaKey)) return; // without it: the frame scrolls
      event.preventDefault();
      const box = view.getBoundingClientRect();
      zoomTo(zoom * (event.deltaY < 0 ? STEP : 1 / STEP), event.clientX - box.left, event.clientY - box.top);
    };
    view?.addEventListener("wheel", onWheel, { passive: false });
    return () => view?.removeEventListener("wheel", onWheel);
  }, [zoom]);

  /** @type {Record<string, () => void>} */
  const keys = { "+": () => zoomTo(zoom * STEP), "-": () => zoomTo(zoom / STEP), 0: () => zoomTo(1) };
  const onKey = (/** @type {KeyboardEvent} */ event) => {
    // With Ctrl the browser zooms the page.
    if (event.ctrlKey || event.metaKey || event.altKey || !Object.hasOwn(keys, event.key)) return;
    event.preventDefault();
    keys[event.key]();
  };
  const begin = (/** @type {PointerEvent} */ event) => {
    if (event.button !== 0 || !(event.target instanceof Element) || event.target.closest(PARTS)) return;
    drag.current = { x: event.clientX, y: event.clientY };
    frame.current?.setPointerCapture(event.pointerId);
  };
  const move = (/** @type {PointerEvent} */ event) => {
    if (!drag.current || !frame.current) return;
    frame.current.scrollBy(drag.current.x - event.clientX, drag.current.y - event.clientY);
    drag.current = { x: event.clientX, y: event.clientY };
  };
  const end = () => {
    drag.current = null;
  };
  return html`
    <div class="row zoom">
      <button aria-label="Zoom out" title="Key -" onClick=${keys["-"]}>−</button>
      <button aria-label=${`Zoom ${Math.round(100 * zoom)} %, back to 100 %`} title="Key 0"
        onClick=${keys[0]}>${Math.round(100 * zoom)} %</button>
      <button aria-label="Zoom in" title="Key +" onClick=${keys["+"]}>+</button>
      <button onClick=${fit}>Fit</button>
    </div>
    <p class="help" role="status">${help}</p>
    <div class="frame" ref=${frame} tabindex="0" role="group" aria-label=${label} onKeyDown=${onKey}
      onPointerDown=${begin} onPointerMove=${move} onPointerUp=${end} onPointerCancel=${end}>
      <div class="sheet" ref=${sheet} style=${{ width: `${100 / zoom}%`, transform: `scale(${zoom})` }}>${children}</div>
    </div>
  `;
}
