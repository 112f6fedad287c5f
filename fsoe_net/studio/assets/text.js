// The file next to the drawing, live in both directions.
import { useEffect, useLayoutEffect, useRef, useState } from "./vendor/hooks.js";
import { html, SEVERITIES, worst } from "./html.js";

const WAIT_MS = 250;

/** @param {any} props */
export function Text({ state, line, act, onCursor }) {
  const [text, setText] = useState(state.text);
  const area = useRef(/** @type {HTMLTextAreaElement | null} */ (null));
  const gutter = useRef(/** @type {HTMLElement | null} */ (null));
  /** What was typed and not yet answered; null: nothing. */
  const pending = useRef(/** @type {string | null} */ (null));
  const timer = useRef(0);

  useEffect(() => {
    if (pending.current === null) setText(state.text);
  }, [state]);

  const send = async () => {
    const typed = pending.current;
    if (typed === null) return;
    const answer = await act("text", { text: typed });
    // A change that arrives first stays a step of undo; the typed text follows it.
    if ("version" in answer && answer.error && answer.text !== typed) await act("text", { text: typed });
    if (pending.current === typed) pending.current = null;
    else timer.current = window.setTimeout(send, WAIT_MS);
  };
  const type = (/** @type {string} */ typed) => {
    setText(typed);
    const first = pending.current === null;
    pending.current = typed;
    if (first) timer.current = window.setTimeout(send, WAIT_MS);
  };

  useLayoutEffect(() => {
    if (!line.line || !area.current) return;
    const before = state.text.split("\n", line.line - 1).join("\n").length;
    const at = before + (line.line > 1 ? 1 : 0) + line.column - 1;
    const end = state.text.indexOf("\n", at);
    if (line.focus) area.current.focus({ preventScroll: true });
    area.current.setSelectionRange(at, end < 0 ? state.text.length : end);
    const height = area.current.scrollHeight / Math.max(1, state.text.split("\n").length);
    area.current.scrollTop = Math.max(0, (line.line - 4) * height);
  }, [line]);

  const cursor = () => {
    if (!area.current) return;
    onCursor(area.current.value.slice(0, area.current.selectionStart).split("\n").length);
  };
  const scroll = () => {
    if (gutter.current && area.current) gutter.current.scrollTop = area.current.scrollTop;
  };
  const rows = text.split("\n");
  return html`<section class="text" aria-label="File">
    <div class="gutter" ref=${gutter} aria-hidden="true">
      ${rows.map((/** @type {string} */ _, /** @type {number} */ n) => {
        const here = state.findings.filter((/** @type {any} */ f) => f.own && f.line === n + 1);
        const severity = worst(here);
        return html`<div key=${n} class=${severity}>
          ${severity ? SEVERITIES[severity][0] : ""} ${n + 1}
        </div>`;
      })}
    </div>
    <textarea ref=${area} aria-label="The network file, as YAML" spellcheck="false" wrap="off"
      autocomplete="off" value=${text} onInput=${(/** @type {any} */ event) => type(event.target.value)}
      onScroll=${scroll} onClick=${cursor} onKeyUp=${cursor}></textarea>
  </section>`;
}
