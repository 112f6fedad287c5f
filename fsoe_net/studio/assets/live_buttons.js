// What one can do to an emulated machine: e-stops, reset, lost frames; each with what to expect.
import { useRef, useState } from "./vendor/hooks.js";
import { html } from "./html.js";
import { isPressed, lampValues, stopName } from "./live_effects.js";

/** @typedef {import("./types").LiveNames} LiveNames */
/** @typedef {import("./types").LivePicture} LivePicture */
/** @typedef {import("./types").LiveView} LiveView */
/** @typedef {import("./types").Order} Order */

/** @param {{ names: LiveNames, picture: LivePicture, view: LiveView, order: Order }} props */
export function Buttons({ names, picture, view, order }) {
  const values = lampValues(picture, view);
  const logics = view.machine?.logics.map((logic) => logic.name) ?? [];
  return html`<section class="buttons" aria-label="Operate the emulated machine">
    ${(picture.stops ?? []).map((stop) => html`<${Stop} key=${`${stop.logic} ${stop.subdevice}`} stop=${stop}
      pressed=${isPressed(stop, values)} order=${order} />`)}
    ${logics.map((name) => html`<${Reset} key=${name} order=${order} of=${name} />`)}
    ${picture.has_axes && html`<${Axes} turning=${view.machine?.turning ?? false} order=${order} />`}
    <${More} names=${names} view=${view} order=${order} />
  </section>`;
}

/** A mushroom button: it stays pressed until it is pulled out. @param {{ stop: import("./types").LiveStop, pressed: boolean, order: Order }} props */
function Stop({ stop, pressed, order }) {
  const set = (/** @type {number} */ value) => stop.inputs.map((name) => `set ${name} ${value}`);
  const press = () => pressed
    ? order.command(set(1), "Released: the safe inputs are 1 again. The outputs stay off until Reset is pressed.")
    : order.command(set(0), "Pressed: the safe inputs go to 0, the logic switches the outputs off. The connection stays in Data: nothing is wrong with it.");
  return html`<div class="stop ${pressed ? "pressed" : ""}">
    <button class="mushroom" aria-pressed=${pressed} onClick=${press}
      aria-label=${`${pressed ? "Release" : "Press"} ${stopName(stop)}`}><span aria-hidden="true">${pressed ? "⟲" : "STOP"}</span></button>
    <span><b>${stop.title || "e-stop"}</b><small>${stop.subdevice} → ${stop.logic}</small>
      <small>${pressed ? "▼ pressed: press again to release" : "○ released"}</small></span>
  </div>`;
}

/** Reset of a safety logic, as a button is: pressed as long as it is held. @param {{ order: Order, of: string }} props */
function Reset({ order, of }) {
  const held = useRef("");
  // A pointer that only passes does not release what a key holds.
  const press = (/** @type {string} */ by) => {
    // A second press by another finger or key must not release the first one.
    if (held.current) return;
    held.current = by;
    order.command([`press ${of}`], "Reset is pressed: outputs come on where every safe input is good. One that is held before that does not count.");
  };
  const release = (by = held.current) => {
    if (!held.current || held.current !== by) return;
    held.current = "";
    order.command([`release ${of}`], "Reset was pressed and released: outputs are on where every safe input was good.");
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
  return html`<div class="stop">
    <button class="reset" onPointerDown=${() => press("pointer")} onPointerUp=${up} onPointerLeave=${up}
      onPointerCancel=${up} onBlur=${() => release()} onClick=${click}
      onContextMenu=${(/** @type {Event} */ event) => event.preventDefault()} aria-label=${`Reset of ${of} (active while held)`}
      onKeyDown=${onKey(() => press("key"))} onKeyUp=${onKey(() => release("key"))}>Reset</button>
    <span><b>Reset</b><small>of ${of}</small><small>active while held</small></span>
  </div>`;
}

/** Start and stop of the standard program. @param {{ turning: boolean, order: Order }} props */
function Axes({ turning, order }) {
  return html`<div class="stop">
    <button class="start-axes" onClick=${() => order.axes(!turning)} aria-label=${turning ? "Stop the axes" : "Start the axes"}>${turning ? "■" : "▶"}</button>
    <span><b>Axes</b><small>standard program</small><small>${turning ? "● turns them" : "○ stopped"}</small></span>
  </div>`;
}

/** @param {{ names: LiveNames, view: LiveView, order: Order }} props */
function More({ names, view, order }) {
  const [line, setLine] = useState("");
  return html`<details class="more">
    <summary>More to try</summary>
    <${Hold} view=${view} hold=${order.hold} />
    ${names.groups.map((group) => html`<div class="row" key=${group}>
      <button onClick=${() => order.command([`plug ${group}`], `Plugged in: ${group}. Its SubDevices come, and their connections start.`)}>Plug ${group} in</button>
      <button onClick=${() => order.command([`pull ${group}`], `Pulled: ${group}. It leaves by design: its connections are absent, the others stay in Data.`)}>Pull ${group}</button>
    </div>`)}
    <form class="row" onSubmit=${(/** @type {Event} */ event) => {
      event.preventDefault();
      order.command([line], `Done: ${line}`);
    }}>
      <label>A command as <code>fsoe-net emulate</code> takes it
        <input value=${line} onInput=${(/** @type {any} */ e) => setLine(e.target.value)} /></label>
      <button>Do it</button>
    </form>
  </details>`;
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
