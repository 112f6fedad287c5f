// What one can do to an emulated bus, and what to expect: that is how people learn FSoE.
import { useRef, useState } from "./vendor/hooks.js";
import { html } from "./html.js";
import { live } from "./live_server.js";

/** @typedef {import("./types").LiveNames} LiveNames */
/** @typedef {import("./types").LiveView} LiveView */

/** @param {{ names: LiveNames, view: LiveView }} props */
export function Buttons({ names, view }) {
  const [said, setSaid] = useState("");
  const [error, setError] = useState("");
  const [line, setLine] = useState("");
  const [sub, setSub] = useState(names.inputs[0]?.subdevice ?? names.subdevices[0]?.name ?? "");
  const [connection, setConnection] = useState(names.connections[0] ?? "");
  /** Presses go one after the other, as they were made. */
  const last = useRef(/** @type {Promise<unknown>} */ (Promise.resolve()));
  const send = (/** @type {string} */ act, /** @type {Record<string, unknown>} */ body, /** @type {string} */ expect) => {
    last.current = last.current.then(async () => {
      const answer = await live(act, body);
      setError(answer.error);
      if (!answer.error) setSaid(expect);
    });
  };
  const order = (/** @type {string[]} */ lines, /** @type {string} */ expect) => send("command", { lines }, expect);
  const button = (/** @type {string} */ text, /** @type {string[]} */ lines, /** @type {string} */ expect) =>
    html`<button title=${expect} onClick=${() => order(lines, `${text}: ${expect}`)}>${text}</button>`;
  const stops = [...new Set(names.inputs.filter((i) => i.watched).map((i) => i.subdevice))];
  // The page follows what the bus reports, not which button was pressed last.
  const away = view.subdevices.find((s) => s.name === sub)?.al === "none";
  return html`<section class="buttons" aria-label="Disturb the emulated bus">
    <h2>Disturb the bus</h2>
    <p class="expect" role="status">${said || "The text of each button describes what to expect. Nothing here reaches a real bus."}</p>
    ${error && html`<p class="error" role="alert">${error}</p>`}
    ${stops.map((name) => {
      const inputs = names.inputs.filter((i) => i.watched && i.subdevice === name);
      const all = (/** @type {number} */ value) => inputs.map((i) => `set ${i.name} ${value}`);
      return html`<div class="row" key=${name}>
        ${button(`Press the e-stop at ${name}`, all(0), "its safe inputs go to 0, the logic takes the outputs off. The connection stays in Data: nothing is wrong with it.")}
        ${button(`Release the e-stop at ${name}`, all(1), "the safe inputs are 1 again; the outputs stay off until reset is pressed.")}
      </div>`;
    })}
    <div class="row"><${Reset} order=${order} /></div>
    <div class="row">
      <label>SubDevice <select value=${sub} onChange=${(/** @type {any} */ e) => setSub(e.target.value)}>
        ${names.subdevices.map((s) => html`<option value=${s.name}>${s.name}</option>`)}
      </select></label>
      ${away
        ? button("Reconnect it", [`heal ${sub}`], "it answers again; its connections restart, through Session, Connection and Parameter to Data.")
        : button("Disconnect it", [`break ${sub}`], "it is gone: the FSoE watchdogs of its connections expire, the connections are reset, outputs go off.")}
      ${button("Break the cable after it", following(names, sub).map((n) => `break ${n}`), "all SubDevices after it are gone at once.")}
      ${button("Repair the cable", following(names, sub).map((n) => `heal ${n}`), "they answer again; connections restart.")}
      ${names.subdevices.find((s) => s.name === sub)?.powered &&
      button("Power cycle", [`power-cycle ${sub}`], "its FSoE ends restart; the other end receives a wrong answer, and resets.")}
    </div>
    <div class="row">
      <label>Connection <select value=${connection} onChange=${(/** @type {any} */ e) => setConnection(e.target.value)}>
        ${names.connections.map((name) => html`<option value=${name}>${name}</option>`)}
      </select></label>
      ${button("Local reset", [`local-reset ${connection}`], "its MainInstance resets it, for a local reason; it comes back to Data by itself.")}
    </div>
    <${Hold} view=${view} hold=${(/** @type {number} */ ms, /** @type {string} */ expect) => send("hold", { ms }, expect)} />
    ${names.groups.map((group) => html`<div class="row" key=${group}>
      ${button(`Plug ${group} in`, [`plug ${group}`], "its SubDevices come, and their connections start.")}
      ${button(`Pull ${group}`, [`pull ${group}`], "it leaves by design: its connections are absent, the others stay in Data.")}
    </div>`)}
    <details>
      <summary>Safe inputs one by one, and any command</summary>
      ${names.inputs.map((i) => html`<div class="row" key=${i.name}>
        <code>${i.name}</code> ${i.label}
        ${button("0", [`set ${i.name} 0`], `${i.name} is 0.`)}
        ${button(String(i.most), [`set ${i.name} ${i.most}`], `${i.name} is ${i.most}.`)}
      </div>`)}
      <form class="row" onSubmit=${(/** @type {Event} */ event) => {
        event.preventDefault();
        order([line], `done: ${line}`);
      }}>
        <label>A command as <code>fsoe-net emulate</code> takes it
          <input value=${line} onInput=${(/** @type {any} */ e) => setLine(e.target.value)} /></label>
        <button>Do it</button>
      </form>
    </details>
  </section>`;
}

/** All SubDevices of its bus that come after one. @param {LiveNames} names @param {string} name */
function following(names, name) {
  const at = names.subdevices.findIndex((s) => s.name === name);
  const bus = names.subdevices[at]?.bus;
  return names.subdevices.slice(at + 1).filter((s) => s.bus === bus).map((s) => s.name);
}

/** Frames that are lost or late. @param {{ view: LiveView, hold: (ms: number, expect: string) => void }} props */
function Hold({ view, hold }) {
  const [typed, setTyped] = useState("1000");
  const watchdogs = view.connections.flatMap((c) => c.watchdog_ms ?? []);
  const least = Math.min(...watchdogs);
  const expect = (/** @type {number} */ ms) => {
    const text = `The frames are held for ${ms} ms: `;
    // Three cases: longer than all watchdogs, longer than some, shorter than each.
    if (ms >= Math.max(...watchdogs)) return `${text}longer than each FSoE watchdog. It expires, the connections are reset, outputs go off; they restart when the frames come again.`;
    if (ms >= least) return `${text}connections with a shorter FSoE watchdog (the shortest is ${least} ms) are reset, the others continue.`;
    return `${text}shorter than each FSoE watchdog (the shortest is ${least} ms), so nothing happens but a long FSoE cycle. Where both together exceed the watchdog, it expires.`;
  };
  const press = (/** @type {number} */ ms) => hold(ms, expect(ms));
  return html`<form class="row" onSubmit=${(/** @type {Event} */ event) => {
    event.preventDefault();
    press(Number(typed));
  }}>
    <span>Hold the frames for</span>
    ${[50, 150].map((ms) => html`<button type="button" key=${ms} title=${expect(ms)} aria-label="Hold the frames for ${ms} ms" onClick=${() => press(ms)}>${ms} ms</button>`)}
    <label>or for (ms) <input type="number" min="1" max="10000" required value=${typed}
      onInput=${(/** @type {any} */ e) => setTyped(e.target.value)} /></label>
    <button title=${expect(Number(typed))}>Hold the frames</button>
  </form>`;
}

/** Reset as a button is: pressed as long as it is held. @param {{ order: (lines: string[], expect: string) => void }} props */
function Reset({ order }) {
  const held = useRef("");
  // A pointer that only passes does not release what a key holds.
  const press = (/** @type {string} */ by) => {
    // A second press by another finger or key must not release the first one.
    if (held.current) return;
    held.current = by;
    order(["press"], "Reset is pressed: outputs come on where every safe input is good. One that is held before that does not count.");
  };
  const release = (by = held.current) => {
    if (!held.current || held.current !== by) return;
    held.current = "";
    order(["release"], "Reset was pressed and released: outputs are on where every safe input was good.");
  };
  const up = () => release("pointer");
  // Keys make no click here and a pointer counts its clicks: what is left comes from a screen reader.
  const click = (/** @type {MouseEvent} */ event) => {
    if (event.detail !== 0) return;
    press("click");
    release();
  };
  const onKey = (/** @type {() => void} */ act) => (/** @type {KeyboardEvent} */ event) => {
    // Space would scroll the page; a held key repeats.
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    act();
  };
  return html`<button class="reset" onPointerDown=${() => press("pointer")} onPointerUp=${up} onPointerLeave=${up}
    onPointerCancel=${up} onBlur=${() => release()} onClick=${click}
    onContextMenu=${(/** @type {Event} */ event) => event.preventDefault()}
    onKeyDown=${onKey(() => press("key"))} onKeyUp=${onKey(() => release("key"))}>Reset (active while held)</button>`;
}
