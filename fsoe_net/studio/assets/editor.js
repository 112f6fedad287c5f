// CodeMirror with the network file: colours, folding, search, findings at their places.
import { defaultKeymap, indentWithTab } from "./vendor/codemirror-commands.js";
import { yaml } from "./vendor/codemirror-lang-yaml.js";
import { bracketMatching, foldGutter, foldKeymap, HighlightStyle, syntaxHighlighting } from "./vendor/codemirror-language.js";
import { lintGutter, nextDiagnostic, setDiagnostics } from "./vendor/codemirror-lint.js";
import { search, searchKeymap } from "./vendor/codemirror-search.js";
import { Annotation, EditorState } from "./vendor/codemirror-state.js";
import { drawSelection, EditorView, highlightActiveLine, keymap, lineNumbers } from "./vendor/codemirror-view.js";
import { tags } from "./vendor/lezer-highlight.js";
import { SEVERITIES } from "./html.js";

/** @typedef {import("./types").Finding} Finding */
/** @typedef {import("./types").Editor} Editor */

/** Marks what the page does itself, and no person types or selects. */
const ofPage = Annotation.define();

const colours = HighlightStyle.define([
  { tag: [tags.propertyName, tags.definition(tags.propertyName)], color: "var(--main)" },
  { tag: [tags.string, tags.attributeValue], color: "var(--sub)" },
  { tag: tags.comment, color: "var(--dim)", fontStyle: "italic" },
  { tag: [tags.labelName, tags.typeName, tags.keyword], color: "var(--warning)" },
]);

// Pictures of CodeMirror are data URLs, which the policy of the server forbids: shapes instead.
const shapes = Object.entries(SEVERITIES).flatMap(([severity, [shape]]) => [
  [`.cm-lint-marker-${severity}`, { content: "normal", color: `var(--${severity})` }],
  [`.cm-lint-marker-${severity}::before`, { content: `"${shape}"` }],
  [`.cm-lintRange-${severity}`, { backgroundImage: "none", textDecoration: `underline wavy var(--${severity})` }],
  [`.cm-diagnostic-${severity}`, { borderLeftColor: `var(--${severity})` }],
]);
const theme = EditorView.theme({
  "&": { height: "100%", color: "var(--ink)", backgroundColor: "var(--paper)" },
  "&.cm-focused": { outline: "3px solid var(--main)", outlineOffset: "-3px" },
  ".cm-scroller": { font: '13px/18px ui-monospace, "Liberation Mono", monospace' },
  ".cm-cursor": { borderLeftColor: "var(--ink)" },
  ".cm-gutters": { color: "var(--dim)", backgroundColor: "var(--raised)", border: "0" },
  ".cm-activeLine": { backgroundColor: "color-mix(in srgb, var(--main) 8%, transparent)" },
  "&.cm-focused > .cm-scroller > .cm-selectionLayer .cm-selectionBackground, .cm-selectionBackground": {
    background: "color-mix(in srgb, var(--main) 30%, transparent)",
  },
  ".cm-searchMatch": { backgroundColor: "transparent", outline: "1px solid var(--warning)" },
  ".cm-searchMatch-selected": { backgroundColor: "var(--lit)" },
  ".cm-panels, .cm-tooltip, .cm-foldPlaceholder": {
    color: "var(--ink)", backgroundColor: "var(--raised)", borderColor: "var(--edge)",
  },
  ".cm-panel.cm-search [name=close]": { color: "var(--ink)", fontSize: "18px", minWidth: "24px", minHeight: "24px" },
  ".cm-panel.cm-search label": { fontSize: "13px", display: "inline-block", minHeight: "24px" },
  ".cm-panel.cm-search input[type=checkbox]": { width: "18px", height: "18px" },
  ".cm-textfield, .cm-button": {
    font: "inherit", color: "inherit", background: "var(--paper)", border: "1px solid var(--edge)", borderRadius: "4px",
    minHeight: "26px",
  },
  ".cm-button:focus-visible, .cm-textfield:focus-visible": { outline: "3px solid var(--main)" },
  ".cm-foldGutter span": { cursor: "pointer", padding: "0 3px" },
  ".cm-foldPlaceholder": { padding: "0 6px" },
  ".cm-diagnostic": { whiteSpace: "pre-wrap", maxWidth: "60ch" },
  ...Object.fromEntries(shapes),
});

/**
 * @param {HTMLElement} box
 * @param {string} text
 * @param {{ type: (text: string) => void, line: (line: number) => void, flush: () => void,
 *   step: (name: "undo" | "redo") => void }} to What a person does.
 * @returns {Editor}
 */
export function open(box, text, to) {
  const step = (/** @type {"undo" | "redo"} */ name) => () => (to.step(name), true);
  // False: the page itself saves.
  const keys = [
    { key: "Mod-s", run: () => (to.flush(), false) },
    { key: "Mod-z", run: step("undo") },
    { key: "Mod-y", run: step("redo") },
    { key: "Mod-Shift-z", run: step("redo") },
    { key: "F8", run: nextDiagnostic },
  ];
  // In a shadow root the styles of CodeMirror need no permission for inline styles.
  const root = box.shadowRoot ?? box.attachShadow({ mode: "open" });
  const view = new EditorView({
    root,
    parent: root,
    state: EditorState.create({
      doc: text,
      extensions: [
        // Other characters that end lines elsewhere stay in their line, as in the file.
        EditorState.lineSeparator.of("\n"),
        EditorState.tabSize.of(2),
        lintGutter(), lineNumbers(), foldGutter(), drawSelection(), highlightActiveLine(), bracketMatching(),
        yaml(), syntaxHighlighting(colours), search({ top: true }), theme,
        keymap.of([...keys, ...searchKeymap, ...foldKeymap, ...defaultKeymap, indentWithTab]),
        EditorView.contentAttributes.of({ "aria-label": "The network file, as YAML", spellcheck: "false", tabindex: "0" }),
        EditorView.domEventHandlers({ blur: () => to.flush() }),
        EditorView.updateListener.of((/** @type {any} */ update) => {
          if (update.transactions.some((/** @type {any} */ t) => t.annotation(ofPage))) return;
          if (update.docChanged) to.type(update.state.doc.toString());
          if (update.selectionSet) to.line(update.state.doc.lineAt(update.state.selection.main.head).number);
        }),
      ],
    }),
  });
  return {
    take: (/** @type {string} */ next) => {
      const changes = difference(view.state.doc.toString(), next);
      if (changes) view.dispatch({ changes, annotations: ofPage.of(true) });
    },
    mark: (/** @type {Finding[]} */ findings) =>
      view.dispatch(setDiagnostics(view.state, findings.flatMap((row) => diagnostic(view.state, row)))),
    show: (number, column, focus) => {
      if (number > view.state.doc.lines) return;
      const line = view.state.doc.line(number);
      const from = Math.min(line.from + column - 1, line.to);
      view.dispatch({
        selection: { anchor: from, head: line.to },
        effects: EditorView.scrollIntoView(from, { y: "start", yMargin: 3 * view.defaultLineHeight }),
        annotations: ofPage.of(true),
      });
      if (focus) view.focus();
    },
    end: () => view.destroy(),
  };
}

/**
 * The part in which two texts differ, so that the cursor and folded parts elsewhere stay.
 * @param {string} old
 * @param {string} next
 */
function difference(old, next) {
  if (old === next) return null;
  const most = Math.min(old.length, next.length);
  let from = 0;
  while (from < most && old[from] === next[from]) from++;
  let same = 0;
  while (same < most - from && old[old.length - 1 - same] === next[next.length - 1 - same]) same++;
  return { from, to: old.length - same, insert: next.slice(from, next.length - same) };
}

/**
 * A finding from its column to the end of its line.
 * @param {any} state
 * @param {Finding} finding
 */
function diagnostic(state, { own, line, column, severity, code, message, hint }) {
  if (!own || !line || line > state.doc.lines) return [];
  const row = state.doc.line(line);
  const from = Math.min(row.from + Math.max(column, 1) - 1, row.to);
  return [{ from, to: row.to, severity, message: `${code}: ${message}${hint && `\n→ ${hint}`}` }];
}
