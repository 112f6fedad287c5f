// One SubDevice or FSoE connection of the machine: its facts, and what can be done to it in an emulated run.
import { html } from "./html.js";
import { connectionText, entryOf } from "./live_machine_draw.js";
import { figures, MARKS } from "./live_strips.js";
import { kindText } from "./symbols.js";

/** @typedef {import("./types").LiveNames} LiveNames */
/** @typedef {import("./types").LivePicture} LivePicture */
/** @typedef {import("./types").LiveView} LiveView */
/** @typedef {import("./types").LiveSelected} LiveSelected */
/** @typedef {import("./types").Order} Order */

/**
 * @param {{ chosen: LiveSelected, choose: (what: LiveSelected) => void, picture: LivePicture, view: LiveView,
 *   names: LiveNames | null, order: Order | null }} props `order` is null where nothing can be done
 */
export function Panel({ chosen, choose, picture, view, names, order }) {
  if (!chosen) return null;
  const name = "subdevice" in chosen ? chosen.subdevice : chosen.connection;
  const facts = "subdevice" in chosen
    ? html`<${SubDevice} name=${name} picture=${picture} view=${view} names=${names} order=${order} />`
    : html`<${Connection} name=${name} view=${view} order=${order} />`;
  return html`<section class="panel" aria-label=${`Details of ${name}`}>
    <h2>${name}</h2>
    <button class="close" aria-label=${`Close the details of ${name}`} onClick=${() => choose(null)}>✕</button>
    ${facts}
  </section>`;
}

/** @param {{ name: string, picture: LivePicture, view: LiveView, names: LiveNames | null, order: Order | null }} props */
function SubDevice({ name, picture, view, names, order }) {
  const node = picture.nodes.find((n) => n.name === name);
  const sub = view.subdevices.find((s) => s.name === name);
  if (!node || !sub) return html`<p>It is not on this bus any more.</p>`;
  const [shape, colour] = MARKS[sub.level];
  const worn = [
    sub.returns && `lost and back ${sub.returns === 1 ? "once" : `${sub.returns} times`}`,
    sub.held && `${sub.held} cycles held`,
    sub.rx_errors && `${sub.rx_errors} receive errors`,
    ...sub.reasons,
  ].filter(Boolean);
  return html`<p>${[kindText(node.kind), node.type, node.about].filter(Boolean).join(" · ")}</p>
    <p><span class="state ${colour}">${shape} ${sub.known ? sub.al : "not known"}</span>
      ${sub.links.length > 0 && html` ports ${sub.links.map((l) => `${l.port} ${l.up ? "up" : "open"}${l.lost ? ` (lost ${l.lost})` : ""}`).join(", ")}`}
      ${worn.length > 0 && html`<small class="worn">${worn.join(", ")}</small>`}</p>
    ${order && names && !view.ended && html`<${Acts} name=${name} view=${view} names=${names} order=${order} gone=${sub.al === "none"} />`}`;
}

/** @param {{ name: string, view: LiveView, names: LiveNames, order: Order, gone: boolean }} props */
function Acts({ name, view, names, order, gone }) {
  const separated = view.machine?.separated.includes(name);
  const powered = names.subdevices.find((s) => s.name === name)?.powered;
  const inputs = names.inputs.filter((i) => i.subdevice === name);
  return html`<div class="row">
      ${separated ? html`<span>A cut cable separates it: repair the cable.</span>` : html`<${Plug} name=${name} order=${order} gone=${gone} />`}
      ${powered && html`<button onClick=${() => order.command([`power-cycle ${name}`], `The FSoE ends of ${name} restart; the other end receives a wrong answer, and resets.`)}>Power cycle</button>`}
    </div>
    ${inputs.length > 0 && html`<details>
      <summary>Safe inputs one by one</summary>
      ${inputs.map((i) => html`<div class="row" key=${i.name}>
        <span>${i.label || entryOf(i.name)} <code>${entryOf(i.name)}</code></span>
        ${[0, i.most].map((value) => html`<button key=${value} aria-label=${`Set ${i.label || i.name} to ${value}`}
          onClick=${() => order.command([`set ${i.name} ${value}`], `${i.label || i.name} is ${value}.`)}>${value}</button>`)}
      </div>`)}
    </details>`}`;
}

/** @param {{ name: string, order: Order, gone: boolean }} props */
function Plug({ name, order, gone }) {
  const [text, line, expect] = gone
    ? ["Reconnect it", `heal ${name}`, `${name} answers again; its connections restart, through Session, Connection and Parameter to Data.`]
    : ["Disconnect it", `break ${name}`, `${name} is gone: the FSoE watchdogs of its connections expire, the connections are reset, outputs go off.`];
  return html`<button onClick=${() => order.command([line], expect)}>${text}</button>`;
}

/** @param {{ name: string, view: LiveView, order: Order | null }} props */
function Connection({ name, view, order }) {
  const c = view.connections.find((row) => row.name === name);
  if (!c) return html`<p>It is not on this bus any more.</p>`;
  const [shape, colour] = c.absent ? MARKS.unknown : MARKS[c.level];
  return html`<p>${c.main} (MainInstance) to ${c.sub} (SubInstance)</p>
    <p><span class="state ${colour}">${shape} ${connectionText(c)}</span> <small class="figures">${figures(c)}</small></p>
    ${c.cause && html`<p class="cause">last Reset: ${c.cause}</p>`}
    ${c.reasons.length > 0 && html`<p class="cause ${colour}">${c.reasons.join(", ")}</p>`}
    ${order && !view.ended && html`<button onClick=${() => order.command([`local-reset ${name}`], `The MainInstance resets ${name} for a local reason; it comes back to Data by itself.`)}>Local reset</button>`}`;
}
