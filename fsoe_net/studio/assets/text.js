// The file next to the drawing, live in both directions.
import { useEffect, useLayoutEffect, useRef, useState } from "./vendor/hooks.js";
import { html } from "./html.js";

const WAIT_MS = 250;

/** @param {any} props */
export function Text({ state, line, act, onCursor }) {
  const [editor, setEditor] = useState(/** @type {import("./types").Editor | null} */ (null));
  const box = useRef(/** @type {HTMLElement | null} */ (null));
  /** Typed text without an answer yet, and the part of it that was sent; null: nothing. */
  const pending = useRef(/** @type {string | null} */ (null));
  const sent = useRef(/** @type {string | null} */ (null));
  const timer = useRef(0);
  /** The latest one: the editor is created once. */
  const cursor = useRef(onCursor);
  cursor.current = onCursor;

  const flush = async () => {
    clearTimeout(timer.current);
    const typed = pending.current;
    if (typed === sent.current) return;
    sent.current = typed;
    const answer = await act("text", { text: typed });
    // A change that arrives first stays a step of undo; the typed text follows it.
    if ("version" in answer && answer.error && answer.text !== typed) await act("text", { text: typed });
    if (sent.current !== typed) return;
    sent.current = null;
    if (pending.current === typed) pending.current = null;
    else timer.current = window.setTimeout(flush, WAIT_MS);
  };
  const acts = {
    type: (/** @type {string} */ typed) => {
      // Until the answer, the text of the server is older than this one.
      if (pending.current === null) timer.current = window.setTimeout(flush, WAIT_MS);
      pending.current = typed;
    },
    line: (/** @type {number} */ at) => cursor.current(at),
    flush,
    // One history for the text and the drawing: that of the server.
    step: (/** @type {string} */ name) => {
      flush();
      act(name);
    },
  };

  useEffect(() => {
    /** @type {import("./types").Editor | null} */
    let made = null;
    let gone = false;
    const opened = (/** @type {typeof import("./editor.js")} */ { open }) => {
      if (gone || !box.current) return;
      made = open(box.current, state.text, acts);
      setEditor(made);
    };
    import("./editor.js").then(opened, () => {}); // a server that is gone is reported above
    return () => {
      gone = true;
      flush();
      made?.end();
    };
  }, []);
  useLayoutEffect(() => {
    if (pending.current === null) editor?.take(state.text);
    editor?.mark(state.findings);
  }, [state, editor]);
  useLayoutEffect(() => {
    if (line.line) editor?.show(line.line, line.column, line.focus);
  }, [line, editor]);

  return html`<section class="text" aria-label="File">
    ${!editor && html`<p class="wait" role="status">Loading …</p>`}
    <div class="editor" ref=${box} />
  </section>`;
}
