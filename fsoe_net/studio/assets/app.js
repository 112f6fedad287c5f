// The page: the toolbar, and below it one of its views.
import { render } from "./vendor/preact.js";
import { useCallback, useEffect, useRef, useState } from "./vendor/hooks.js";
import { html, worst } from "./html.js";
import { Network } from "./network.js";
import { GONE, listen, request, state as fetchState } from "./server.js";

/** @typedef {import("./types").State} State */

/**
 * The end of a path: its begin is the same for all files of a person.
 * @param {string} path
 */
const shortPath = (path) => path.replace(/^.*(?=\/[^/]+\/[^/]+$)/, "…");

/** @param {() => Promise<any>} load Of a view that is loaded when it is first shown. */
function later(load) {
  /** @type {any} */
  // Kept outside of the component: a view that was loaded once is shown at once the next time.
  let View = null;
  return function Later(/** @type {any} */ props) {
    const [there, show] = useState(View !== null);
    useEffect(() => {
      const took = (/** @type {any} */ found) => ((View = found), show(true));
      if (!there) load().then(took, () => {}); // a server that is gone is said above
    }, []);
    return there ? html`<${View} ...${props} />` : html`<p class="wait" role="status">Loading …</p>`;
  };
}
const Live = later(() => import("./live.js").then((found) => found.Live));
const TestRecord = later(() => import("./test_record.js").then((found) => found.TestRecord));
const Records = later(() => import("./records.js").then((found) => found.Records));


/** Views by the fragment of their address: name, component. @type {Record<string, [string, any]>} */
const VIEWS = {
  network: ["Network", Network],
  live: ["Live", Live],
  "test-record": ["Test record", TestRecord],
  records: ["Records", Records],
};

const viewOfAddress = () => {
  const name = location.hash.slice(1);
  // Only known names: an address that was typed must not select a property of the object.
  return Object.hasOwn(VIEWS, name) ? name : "network";
};

function Page() {
  const [state, setState] = useState(/** @type {State | null} */ (null));
  const [error, setError] = useState("");
  const [view, setView] = useState(viewOfAddress());
  const present = useRef(/** @type {State | null} */ (null));

  const take = useCallback((/** @type {State | { error: string }} */ answer) => {
    setError(answer.error);
    // Answers can overtake each other; an older state must not replace a newer one.
    if ("version" in answer && answer.version >= (present.current?.version ?? 0)) {
      present.current = answer;
      setState(answer);
    }
  }, []);

  /** Requests go one after the other, each on the version that the one before has made. */
  const last = useRef(/** @type {Promise<unknown>} */ (Promise.resolve()));
  const act = useCallback((/** @type {string} */ name, /** @type {object} */ body = {}) => {
    const done = last.current.then(async () => {
      const answer = await request(name, { ...body, version: present.current?.version ?? 0 });
      take(answer);
      return answer;
    });
    last.current = done;
    return done;
  }, []);

  useEffect(() => {
    const look = async () => take(await fetchState());
    look();
    return listen(
      (version) => version > (present.current?.version ?? 0) && look(),
      // The message of a lost server goes when it is back; another message stays until it is read.
      (there) => setError((now) => (there ? (now === GONE ? "" : now) : GONE)),
    );
  }, []);

  useEffect(() => {
    const onKey = (/** @type {KeyboardEvent} */ event) => {
      if (!(event.ctrlKey || event.metaKey) || event.defaultPrevented) return;
      const key = event.key.toLowerCase(); // with Shift it is a capital
      // The browser would save the page instead of the network.
      if (key === "s") {
        event.preventDefault();
        act("save");
      } else if (event.target instanceof HTMLElement && event.target.matches("textarea, input")) {
        return; // a field takes its own letters back
      } else if (key === "z" || key === "y") {
        event.preventDefault();
        act(key === "y" || event.shiftKey ? "redo" : "undo");
      }
    };
    document.addEventListener("keydown", onKey);
    return () => document.removeEventListener("keydown", onKey);
  }, []);

  useEffect(() => {
    const onAddress = () => setView(viewOfAddress());
    addEventListener("hashchange", onAddress);
    return () => removeEventListener("hashchange", onAddress);
  }, []);

  useEffect(() => {
    document.title = `${state?.saved === false ? "● " : ""}${state?.name || "fsoe-net"} – studio`;
  }, [state]);

  if (state === null) return html`<p class="wait" role="status">${error || "Loading …"}</p>`;
  return html`
    <${Toolbar} state=${state} view=${view} act=${act} />
    ${error && html`<p class="error" role="alert">${error}</p>`}
    ${state.outside &&
    html`<p class="outside" role="alert">
      The file on the disk was changed by another program. Save does not overwrite it.
      <button onClick=${() => act("take")}>Use the text of the file (Undo restores mine)</button>
    </p>`}
    <${VIEWS[view][1]} state=${state} act=${act} />
    <footer>
      Part of the black channel, not certified, never a safety function. This page changes files;${" "}
      ${state.may_control ? "it may start and stop the bus and set outputs there, but no FSoE frame" : "it sends nothing to a bus"}.
    </footer>
  `;
}

/** @param {{ state: State, view: string, act: (name: string) => void }} props */
function Toolbar({ state, view, act }) {
  const verdict = {
    error: "has errors: it compiles to no plan",
    warning: "has warnings",
    info: "no errors",
    "": "no errors",
  }[worst(state.findings)];
  return html`<header>
    <h1>${state.name || "fsoe-net studio"}</h1>
    <nav aria-label="Views">
      ${Object.entries(VIEWS).map(
        ([key, [name]]) =>
          html`<a key=${key} href=${`#${key}`} aria-current=${key === view ? "page" : undefined}>${name}</a>`,
      )}
    </nav>
    <span class="path" title=${state.path}>${shortPath(state.path)}</span>
    <span class="verdict ${worst(state.findings) || "good"}" role="status">
      ${state.is_network ? verdict : "no network yet"} · ${state.saved ? "saved" : "not saved"}
    </span>
    <button disabled=${!state.can_undo} onClick=${() => act("undo")}>Undo</button>
    <button disabled=${!state.can_redo} onClick=${() => act("redo")}>Redo</button>
    <button class="save" disabled=${state.saved} onClick=${() => act("save")}>Save</button>
  </header>`;
}

const page = document.getElementById("page");
if (page) {
  page.textContent = "";
  render(html`<${Page} />`, page);
}
