// What the page has kept of a source: events, states over time, Resets, values of signals.

/** @typedef {import("./types").LiveView} LiveView */
/** @typedef {import("./types").LiveEvent} LiveEvent */
/** @typedef {import("./types").Picture} Picture */

const KEPT_EVENTS = 50_000;
const KEPT_CHANGES = 20_000; // of a connection
const SCOPE_MS = 10_000;

export const DATA = "Data";
export const FAILSAFE = "Data · FailSafeData";
export const PROCESS = "Data · ProcessData";

/** States from the lowest on, as the height of a strip shows them. */
export const LEVELS = [
  "Silent",
  "Unknown",
  "Reset",
  "Session",
  "Connection",
  "Parameter",
  DATA,
  FAILSAFE,
  PROCESS,
];

/**
 * A connection over time: when it came into which state, and its Resets.
 * @typedef {{ wire: [number, string][], ends: [number, string][], marks: LiveEvent[],
 *   main: string, sub: string }} Strip
 */

export class Past {
  /** @type {LiveView | null} */
  view = null;
  run = "";
  /** The machine, whose facts come once. @type {import("./types").LivePicture | null} */
  picture = null;
  /** Number of the first event that is kept. */
  first = 0;
  left_out = 0;
  /** @type {LiveEvent[]} */
  events = [];
  /** @type {Map<string, Strip>} */
  strips = new Map();
  choice = -1;
  /** @type {string[]} */
  signals = [];
  fault = "";
  skipped = 0;
  /** @type {(number | null)[][]} */
  rows = [];
  /** Number of the first row that is not known yet. */
  nextRow = 0;

  get nextEvent() {
    return this.first + this.events.length;
  }

  /** @param {Picture} update */
  take(update) {
    const { events, first, left_out, scope, picture: parts, ...view } = update;
    // Another run: its times and event numbers begin at 0.
    if (view.run !== this.run || view.source !== this.view?.source) {
      Object.assign(this, new Past(), { run: view.run });
    }
    this.view = view;
    this.picture = parts ?? this.picture;
    this.left_out = Math.max(left_out, this.left_out);
    // Events between were missed: the list continues after the gap.
    if (first > this.nextEvent) {
      this.first = first;
      this.events = [];
    }
    // A message can repeat events that the page has.
    for (const event of events.slice(Math.max(0, this.nextEvent - first))) {
      this.events.push(event);
      this.note(event);
    }
    // In steps of 1000: to remove one event at a time would move the whole array each time.
    if (this.events.length > KEPT_EVENTS + 1000) {
      const gone = this.events.length - KEPT_EVENTS;
      this.events.splice(0, gone);
      this.first += gone;
      this.left_out += gone;
    }
    if (scope) this.takeScope(scope);
  }

  /** @param {import("./types").ScopePart} scope */
  takeScope(scope) {
    if (scope.choice !== this.choice) {
      // Another choice of signals has other columns.
      this.rows = [];
      this.nextRow = 0;
      this.choice = scope.choice;
    }
    this.signals = scope.signals;
    this.fault = scope.fault;
    this.skipped = scope.skipped;
    const news = scope.rows.slice(Math.max(0, this.nextRow - scope.first));
    this.nextRow = Math.max(this.nextRow, scope.first + scope.rows.length);
    if (!news.length) return;
    // A paused page draws the rows that it had: what is kept is another list.
    const oldest = Number(news[news.length - 1][0]) - SCOPE_MS;
    const begin = this.rows.findIndex((row) => Number(row[0]) >= oldest);
    this.rows = (begin < 0 ? [] : this.rows.slice(begin)).concat(news);
  }

  /** @param {LiveEvent} event */
  note(event) {
    if (event.end === "") return;
    let strip = this.strips.get(event.source);
    if (!strip) {
      strip = { wire: [], ends: [], marks: [], main: "", sub: "" };
      this.strips.set(event.source, strip);
    }
    for (const rows of [strip.wire, strip.ends, strip.marks]) {
      if (rows.length > KEPT_CHANGES) rows.splice(0, KEPT_CHANGES / 2);
    }
    if (event.kind === "reset") {
      strip.marks.push(event);
      // A reset is seen on the wire also by the end that did not send it.
      if (strip.wire.length) strip.wire.push([event.time_ms, "Reset"]);
      strip[event.end === "sub" ? "sub" : "main"] = "Reset";
      strip.ends.push([event.time_ms, "Reset"]);
      return;
    }
    if (event.end === "wire") return void strip.wire.push([event.time_ms, event.state]);
    strip[event.end] = event.state;
    // The end in the lower state decides: a connection is in Data only if both ends are.
    const lower = LEVELS.indexOf(strip.main) < LEVELS.indexOf(strip.sub) ? strip.main : strip.sub;
    strip.ends.push([event.time_ms, lower || "Silent"]);
  }
}

/**
 * The last of some times that is not later than a moment; -1: all are later.
 * @template T
 * @param {T[]} rows
 * @param {number} at
 * @param {(row: T) => number} time
 */
export function lastBefore(rows, at, time) {
  let [low, high] = [0, rows.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time(rows[middle]) <= at) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** @param {number} ms */
export const clock = (ms) => `${(ms / 1000).toFixed(3)} s`;
