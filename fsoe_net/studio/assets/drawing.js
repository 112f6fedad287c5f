// The bus as a line, and its FSoE connections between slots: MainInstances left, SubInstances right.
import { useEffect, useLayoutEffect, useRef, useState } from "./vendor/hooks.js";
import { Board } from "./board.js";
import { Bus } from "./bus.js";
import { html, Mark, ROLES, worst } from "./html.js";
import { curves, Line } from "./lines.js";
import { kindText, Symbol } from "./symbols.js";

/** @typedef {import("./types").State} State */
/** @typedef {import("./types").SubDevice} SubDevice */
/** @typedef {import("./types").Port} Port */
/** @typedef {import("./types").Selected} Selected */
/**
 * Why two ends cannot be connected; empty: they can.
 * @param {Port} from
 * @param {Port} to
 */
export function obstacle(from, to) {
  // The order is from the most general reason to the most specific one.
  if (from.subdevice === to.subdevice) return "the same SubDevice";
  if (to.pair.connection !== null) return "in use already";
  if (!from.pair.matched || !to.pair.matched) return "its two frames do not belong together";
  if (from.pair.sends_bytes !== to.pair.takes_bytes)
    return `sends ${from.pair.sends_bytes} bytes, ${to.pair.takes_bytes} are taken there`;
  if (from.pair.takes_bytes !== to.pair.sends_bytes)
    return `takes ${from.pair.takes_bytes} bytes, ${to.pair.sends_bytes} come from there`;
  return "";
}

/** @param {SubDevice} sub */
// Without a role in the file, a SubDevice with several slots is taken as safety logic.
const isLeft = (sub) =>
  sub.role
    ? sub.role !== "sub"
    : sub.likely === "main" || (sub.likely === "" && sub.pairs.length > 1);

/**
 * @param {{ state: State, stale: boolean, selected: Selected,
 *   tried: import("./types").TriedConnection[], choose: (what: Selected) => void,
 *   act: (name: string, body: object) => void }} props
 */
export function Drawing({ state, stale, selected, tried, choose, act }) {
  const [from, setFrom] = useState(/** @type {Port | null} */ (null));
  const [lines, setLines] = useState(/** @type {ReturnType<typeof curves>} */ ([]));
  const board = useRef(/** @type {HTMLElement | null} */ (null));

  useEffect(() => {
    const onKey = (/** @type {KeyboardEvent} */ event) => event.key === "Escape" && setFrom(null);
    document.addEventListener("keydown", onKey);
    return () => document.removeEventListener("keydown", onKey);
  }, []);

  const place = () => {
    if (board.current) setLines(curves(board.current, state.connections));
  };
  // After layout and before paint: lines drawn later would jump.
  useLayoutEffect(place, [state]);
  useEffect(() => {
    const watcher = new ResizeObserver(place);
    // A card can change its height without a change of the state, for example when fonts arrive.
    if (board.current) watcher.observe(board.current);
    return () => watcher.disconnect();
  }, [state]);

  const connect = (/** @type {Port} */ to) => {
    if (from === null || obstacle(from, to)) return;
    setFrom(null);
    act("change", {
      change: "connect",
      main: from.subdevice,
      slot: from.pair.slot,
      sub: to.subdevice,
      sub_slot: to.pair.slot,
    });
  };
  const byName = grouped(state.findings, (finding) => finding.subdevices);
  const byNumber = grouped(state.findings, (finding) => finding.connections);
  const results = new Map(tried.map((row) => [row.name, row]));
  const chosenName = selected && "subdevice" in selected ? selected.subdevice : null;
  const chosenLine = selected && "connection" in selected ? selected.connection : null;
  const cards = (/** @type {SubDevice[]} */ subs) =>
    subs.map(
      (sub) => html`<${Card} key=${sub.name} sub=${sub} findings=${byName.get(sub.name) ?? []} from=${from}
        setFrom=${setFrom} connect=${connect} chosen=${sub.name === chosenName} choose=${choose} />`,
    );
  const withPairs = state.subdevices.filter((s) => s.pairs.length > 0);
  const help = from
    ? `Connect ${from.subdevice}, slot ${from.pair.slot}: choose a highlighted slot. Escape cancels.`
    : "Drag from a free slot of safety logic to a SubInstance, or click one after the other.";
  return html`<${Board} label="Drawing of the network" help=${help}>
    <${Bus} state=${state} findings=${byName} selected=${selected} choose=${choose} act=${act} />
    <div class="board ${stale ? "stale" : ""}" ref=${board}>
      <svg class="lines" role="group" aria-label="FSoE connections">
        ${state.connections.map(
          (c, number) =>
            // A connection may name a slot that does not exist; then there is no line.
            lines[number] &&
            html`<${Line} key=${number} curve=${lines[number]} connection=${c} number=${number}
              findings=${byNumber.get(number) ?? []} tried=${results.get(c.name)}
              chosen=${number === chosenLine} choose=${choose} />`,
        )}
      </svg>
      <div class="column">
        <h2>MainInstances</h2>
        ${cards(withPairs.filter(isLeft))}
      </div>
      <div class="column right">
        <h2>SubInstances</h2>
        ${cards(withPairs.filter((s) => !isLeft(s)))}
      </div>
    </div>
  </${Board}>`;
}

/**
 * Findings by what they are about: a network of 300 SubDevices looks up each one.
 * @template Key
 * @param {import("./types").Finding[]} findings
 * @param {(finding: import("./types").Finding) => Key[]} keys
 */
function grouped(findings, keys) {
  /** @type {Map<Key, import("./types").Finding[]>} */
  const found = new Map();
  for (const finding of findings)
    for (const key of keys(finding)) found.set(key, [...(found.get(key) ?? []), finding]);
  return found;
}

/** @param {any} props */
function Card({ sub, findings, from, setFrom, connect, chosen, choose }) {
  const severity = worst(findings);
  const line = [
    sub.type,
    `${sub.alias ? `alias ${sub.alias} + ` : "position "}${sub.position}`,
    sub.group && `may be absent: ${sub.group}`,
    sub.about,
  ].filter(Boolean);
  return html`<div class="card ${sub.role || "none"} ${severity} ${chosen ? "chosen" : ""}">
    <button class="name" aria-pressed=${chosen} onClick=${() => choose({ subdevice: sub.name })}>
      <${Symbol} kind=${sub.kind} /><span class="unseen">${kindText(sub.kind)}</span>
      <span class="called"><b>${sub.name}</b> <${Mark} severity=${severity} />
        <small title=${sub.about}>
          <span class="unseen">${ROLES[sub.role]}, </span>${line.join(" · ")}
        </small>
      </span>
    </button>
    <ol class="ports">
      ${sub.pairs.map(
        (/** @type {any} */ pair) => html`<${Slot} key=${pair.slot} port=${{ subdevice: sub.name, pair }} isOnly=${sub.pairs.length === 1}
          from=${from} setFrom=${setFrom} connect=${connect} choose=${choose} />`,
      )}
    </ol>
  </div>`;
}

/**
 * @param {{ port: Port, isOnly: boolean, from: Port | null, setFrom: (port: Port | null) => void,
 *   connect: (port: Port) => void, choose: (what: Selected) => void }} props
 */
function Slot({ port, isOnly, from, setFrom, connect, choose }) {
  const { pair } = port;
  const used = pair.connection !== null;
  const own = from !== null && from.subdevice === port.subdevice && from.pair.slot === pair.slot;
  const why = from === null || own ? "" : obstacle(from, port);
  const fits = from !== null && !own && !why;
  const begin = () => !used && pair.matched && setFrom(port);
  const press = () => {
    if (own) setFrom(null);
    else if (from !== null) connect(port);
    else if (pair.connection !== null) choose({ connection: pair.connection });
    else begin();
  };
  const bytes = `${pair.sends_bytes} bytes out, ${pair.takes_bytes} in`;
  const how = why || (fits ? "fits" : used ? "connected" : "free");
  return html`<li>
    <button class="port ${used ? "used" : "free"} ${fits ? "fits" : ""} ${own ? "own" : ""}"
      data-port=${`${port.subdevice}/${pair.slot}`} draggable=${!used}
      title=${`slot ${pair.slot}: ${bytes}; ${how}`}
      aria-label=${`${port.subdevice}, slot ${pair.slot}, ${bytes}, ${how}`}
      onClick=${press}
      onDragStart=${(/** @type {DragEvent} */ event) => {
        event.dataTransfer?.setData("text/plain", port.subdevice);
        setTimeout(begin); // a browser ends a drag whose element changes at its begin
      }}
      onDragEnd=${() => setTimeout(() => setFrom(null))}
      onDragOver=${(/** @type {DragEvent} */ event) => fits && event.preventDefault()}
      onDrop=${(/** @type {DragEvent} */ event) => {
        event.preventDefault();
        connect(port);
      }}></button>
    ${!isOnly && html`<span class="slot">${pair.slot}</span>`}
    ${(why || !isOnly) && html`<small>${why || `${pair.sends_bytes} ⇄ ${pair.takes_bytes} bytes`}</small>`}
  </li>`;
}
