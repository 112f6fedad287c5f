// What the server says, see fsoe_net/studio/document.py.

export interface Pair {
  slot: number;
  /** Bytes of the frame of the device to the MainDevice; 0 without one. */
  sends_bytes: number;
  /** Bytes of the frame that the device takes; 0 without one. */
  takes_bytes: number;
  matched: boolean;
  /** Number of the connection that uses it. */
  connection: number | null;
}

/** See fsoe_net/model/kinds.py. */
export type SubDeviceKind = "coupler" | "terminal" | "drive" | "logic";

export interface SubDevice {
  name: string;
  kind: SubDeviceKind;
  /** Order number and description in the device library; empty: it is not there. */
  type: string;
  about: string;
  position: number;
  alias: number;
  bus: number;
  line: number;
  /** Of parts that may be absent; empty: it is always there. */
  group: string;
  role: "main" | "sub" | "both" | "";
  /** What the device library knows of frames of these lengths; empty: nothing for certain. */
  likely: "main" | "sub" | "";
  device: string;
  identity: string;
  pairs: Pair[];
}

export type Fact = "address" | "connection_id" | "watchdog_ms";

export interface Connection {
  name: string;
  net: string;
  main: string;
  sub: string;
  slot: number | null;
  sub_slot: number | null;
  address: number | null;
  connection_id: number | null;
  watchdog_ms: number | null;
  /** Limits of the FSoE watchdog by the timing budget; null: nothing asks, or times are missing. */
  least_ms: number | null;
  greatest_ms: number | null;
  unconfirmed: string | null;
  to_sub_bytes: number;
  to_main_bytes: number;
  /** To the SubInstance, back from it. */
  copies: { size_bytes: number; source: CopyEnd; destination: CopyEnd }[];
  line: number;
}

/** Bytes of a frame in the process data of a SubDevice; null where that is not known offline. */
export interface CopyEnd {
  subdevice: string;
  entry: string;
  sm: number | null;
  byte: number | null;
  /** Bytes of the whole sync manager. */
  of_bytes: number | null;
}

export interface Finding {
  code: string;
  severity: "error" | "warning" | "info";
  message: string;
  hint: string;
  file: string;
  line: number;
  column: number;
  own: boolean;
  fixable: boolean;
  subdevices: string[];
  connections: number[];
  related: { message: string; line: number; place: string }[];
}

export interface State {
  error: string;
  version: number;
  /** Equal as long as all files of the network have the same content. */
  content: string;
  path: string;
  name: string;
  text: string;
  saved: boolean;
  /** There is no file yet; Save makes it. */
  /** Whether the live page may act on a bus. */
  may_control: boolean;
  is_new: boolean;
  /** Device files that Save writes beside it. */
  unwritten: string[];
  /** What a person has to know of what was just done. */
  said?: string[];
  outside: boolean;
  can_undo: boolean;
  can_redo: boolean;
  is_network: boolean;
  /** Bus cycle; null: not stated. */
  cycle_us: number | null;
  buses: string[];
  /** How the cables of the first bus run, by a scan that was given; null: nothing shows it. */
  wiring: Wiring | null;
  subdevices: SubDevice[];
  connections: Connection[];
  limits: Record<Fact, number>;
  proposals: Partial<Record<Fact, number>>;
  findings: Finding[];
}

/** Cables by a scan, see fsoe_net/studio/document.py. */
export interface Wiring {
  file: string;
  /** Whether the links of the scan leave one way only. */
  is_known: boolean;
  /** Position and port from which a cable goes back to the MainDevice. */
  ring_from: [number, number] | null;
  nodes: WiredNode[];
}

export interface WiredNode {
  position: number;
  /** Position of the one before it; null: the MainDevice. */
  parent: number | null;
  port: number;
  /** Its name in the network; empty: it is not in there. */
  subdevice: string;
  /** Whether the scan has a device of another type there. */
  is_other: boolean;
  type: string;
}

/** A try on the emulated bus, see fsoe_net/studio/server.py. */
export interface Tried {
  error: string;
  content: string;
  passed: boolean;
  duration_ms: number;
  connections: TriedConnection[];
  events: { time_ms: number; source: string; text: string }[];
  events_left_out: number;
}

export interface TriedConnection {
  name: string;
  state: string;
  /** Its group is left out: a place has one tool, the first. */
  absent: boolean;
  in_data: boolean;
  time_to_data_ms: number | null;
  resets: number;
  /** Reason of the last Reset; empty: none. */
  last_reset: string;
  chosen: string[];
}

/** A file beside the network, see fsoe_net/project/companion_files.py. */
export interface CompanionFile {
  number: number;
  name: string;
  kind: "incident" | "log" | "record" | "test_record" | "robot" | "controllers" | "other";
  words: string;
}

export interface Listed {
  error: string;
  files: CompanionFile[];
  /** What a person types to sign off. */
  commands: string[];
}

/** Values of a step or of what is read at a SubDevice; empty: not filled in. */
export type Fields = Record<string, string>;

export interface Step {
  name: string;
  title: string;
  what: string;
  expected: string;
  limit_ms: number | null;
  limit_source: string;
  emulated: string;
  live: string;
  fields: Fields;
  is_open: boolean;
  is_failed: boolean;
}

/** A test record, see fsoe_net/studio/test_records.py. */
export interface TestRecord {
  error: string;
  files: { number: number; name: string }[];
  number: number | null;
  /** Tells it from a test record of another network or configuration. */
  key: string;
  /** What the emulated column is worth. */
  note: string;
  /** Why its results are not taken for this network. */
  notes: string[];
  steps: Step[];
  devices: { name: string; title: string; fields: Fields }[];
}

/** What a person has entered, kept in the browser until the file has it. */
export interface Kept {
  step: string;
  subdevice: string;
  before: Fields;
  now: Fields;
  /** To be sent; else it is being written. */
  done: boolean;
  /** What was sent last: where the file has it, only the answer was lost. */
  sent: Fields | null;
  /** Why the server did not take it. */
  problem: string;
  /** What somebody else has entered meanwhile. */
  theirs: Fields | null;
}

/** Sends a change of the text; answers with the state after it. */
export type Act = (name: string, body?: object) => Promise<State | { error: string }>;

/** What is selected: a SubDevice by its name, or a connection by its number. */
export type Selected = { subdevice: string } | { connection: number } | null;

/** One end of a connection. */
export interface Port {
  subdevice: string;
  pair: Pair;
}

/** The editor of the text, see editor.js. */
export interface Editor {
  /** Shows the text of the server. */
  take: (text: string) => void;
  mark: (findings: Finding[]) => void;
  /** Selects a line from a column to its end. */
  show: (line: number, column: number, focus: boolean) => void;
  end: () => void;
}

/** A file that a person gives, with its name below the folder that was given. */
export interface Given {
  name: string;
  file: File;
}

/** What can be added, and what the files say that were given to the page: fsoe_net/studio/uploads.py. */
export interface Uploads {
  error: string;
  files: string[];
  offers: Offer[];
  offers_left_out: number;
  findings: { severity: "error" | "warning"; place: string; message: string; hint: string }[];
  /** The network that the files propose; null: they say of no bus. */
  proposal: {
    name: string;
    subdevices: number;
    connections: number;
    unconfirmed: number;
    open: string[];
    notes: string[];
  } | null;
}

/** See fsoe_net/model/library.py. */
export type DeviceFunction = "safe_input" | "safe_output" | "drive" | "safety_logic";

export interface Offer {
  number: number;
  order: string;
  about: string;
  file: string;
  position: number | null;
  revision: number | null;
  process_data: string;
  /** Of each pair: bytes to the device, from it. */
  frames: [number, number][];
  role: "main" | "sub" | "";
  functions: DeviceFunction[];
  /** Connections that a person chooses, at most; 0: they are fixed. */
  most_connections: number;
  /** Why it cannot be added; empty: it can. */
  obstacle: string;
}

/** Formats that the network can be written as, and one of them: fsoe_net/studio/export.py. */
export interface Targets {
  error: string;
  targets: { name: string; title: string; is_folder: boolean }[];
}

export interface Export {
  error: string;
  version: number;
  target: string;
  files: { name: string; bytes: number }[];
  notes: string[];
  findings: string[];
}

// -- the live page, see fsoe_net/studio/live_rows.py ----------------------------------------------

/** See fsoe_net/live/health.py. */
export type HealthLevel = "good" | "unknown" | "warning" | "error";

export interface LiveConnection {
  name: string;
  main: string;
  sub: string;
  state: string;
  in_data: boolean;
  absent: boolean;
  level: HealthLevel;
  /** Why it has this level. */
  reasons: string[];
  connection_id: number | null;
  address: number | null;
  watchdog_ms: number | null;
  last_ms: number;
  mean_ms: number;
  max_ms: number;
  /** Longest FSoE cycle as a share of the watchdog. */
  share: number | null;
  wrong: number;
  gaps: number;
  held: number;
  resets: number;
  cause: string;
  /** Parameters that are not those of the plan. */
  differences: string[];
  chosen: string[];
}

export interface LiveSubDevice {
  name: string;
  known: boolean;
  al: string;
  al_code: number | null;
  level: HealthLevel;
  reasons: string[];
  returns: number;
  held: number;
  links: { port: number; up: boolean; lost: number }[];
  rx_errors: number;
}

/** A safe input or output of the picture. */
export interface LiveLamp {
  name: string;
  label: string;
}

/** A SubDevice of the picture, see fsoe_net/studio/live_cabling.py. */
export interface LiveNode {
  /** Empty: the scan has it, and the network does not. */
  name: string;
  kind: SubDeviceKind;
  type: string;
  about: string;
  bus: number;
  /** Number of the node before it; null: the MainDevice. */
  parent: number | null;
  port: number;
  inputs: LiveLamp[];
  outputs: LiveLamp[];
  axes: string[];
}

/** An e-stop: safe inputs of a SubDevice that a safety logic reads. */
export interface LiveStop {
  logic: string;
  subdevice: string;
  /** Sensors of the safety functions; empty: none is named. */
  title: string;
  inputs: string[];
}

/** The constant part of a machine. */
export interface LivePicture {
  buses: string[];
  /** Numbers of the nodes from which a cable returns to the MainDevice. */
  rings: number[];
  nodes: LiveNode[];
  stops?: LiveStop[];
  /** Whether axes can be turned, in an emulated run. */
  has_axes?: boolean;
}

/** The changing part of an emulated machine, see fsoe_net/studio/live_machine.py. */
export interface LiveMachine {
  /** Of the lamps of each node, inputs first. */
  values: number[];
  /** Numbers of cut cables. */
  cut: number[];
  /** SubDevices after a cut cable. */
  separated: string[];
  /** Of the axes of each node: position as a part of a turn, speed in rpm, state. */
  axes: [number, number, string][];
  logics: { name: string; on: boolean }[];
  /** Whether the program runs that turns the axes. */
  turning: boolean;
}

/** Selection in the picture. */
export type LiveSelected = { subdevice: string } | { connection: string } | null;

/** Acts on an emulated run, with what to expect. */
export interface Order {
  command: (lines: string[], expect: string) => void;
  hold: (ms: number, expect: string) => void;
  cable: (number: number, whole: boolean) => void;
  axes: (run: boolean) => void;
}

export interface Histogram {
  count: number;
  mean_ns: number;
  p99_ns: number;
  max_ns: number;
  /** Smallest time in a bar, how often. */
  bars: [number, number][];
}

export interface LiveStatistics {
  cycles: number;
  overruns: number;
  wkc_errors: number;
  expected_wkc: number;
  actual_wkc: number;
  lost_frames: number;
  histograms: Record<string, Histogram>;
}

export interface LiveEvent {
  time_ms: number;
  source: string;
  text: string;
  kind: "state" | "reset" | "wkc" | "links" | "other";
  /** Of a state or a Reset. */
  end: "main" | "sub" | "wire" | "";
  /** The new state, for people. */
  state: string;
}

export interface LiveView {
  run: string;
  source: "master" | "emulated" | "file";
  title: string;
  state: string;
  /** Why nobody answers. */
  away: string;
  current: boolean;
  good: boolean;
  ended: boolean;
  now_ms: number;
  /** How fast an emulated run goes beside the clock. */
  pace: number | null;
  /** Of the files of an emulated run. */
  content: string | null;
  notes: string[];
  /** Of an emulated run. */
  machine: LiveMachine | null;
  connections: LiveConnection[];
  subdevices: LiveSubDevice[];
  /** Health of the bus; null of a recorded run. */
  bus: { level: HealthLevel; reasons: string[] } | null;
  statistics: LiveStatistics | null;
  /** Number of the page that has control of the bus, 0: none has; null or absent: none may. */
  control?: number | null;
}

/** What the page holds that has control, and an output: fsoe_net/studio/live_control.py. */
export interface Held {
  token: string;
  turn: number;
  access: string;
  lease_ms: number;
}

export interface Output {
  name: string;
  interface: string;
  kind: string;
  value: string;
  stop_value: string;
  restart_relevant: boolean;
  /** Who writes it. */
  client: number | null;
  mine: boolean;
}

/** A question that a dialog asks before something is done. */
export interface Question {
  title: string;
  lines: string[];
  /** A box that has to be checked; empty: none. */
  check: string;
  act: string;
  then: () => void;
}

/** A view, and what the page lacks of the past. */
export interface Picture extends LiveView {
  first: number;
  left_out: number;
  events: LiveEvent[];
  scope: ScopePart | null;
  /** Of a recorded run, with the view. */
  picture?: LivePicture;
}

export interface ScopePart {
  choice: number;
  signals: string[];
  skipped: number;
  fault: string;
  first: number;
  /** Milliseconds, then a value for each signal. */
  rows: (number | null)[][];
}

/** What the buttons of an emulated run name. */
export interface LiveNames {
  inputs: { name: string; label: string; subdevice: string; most: number; watched: boolean }[];
  subdevices: { name: string; bus: number; powered: boolean }[];
  connections: string[];
  groups: string[];
}

export interface LiveSources {
  error: string;
  master: string | null;
  run: string | null;
  names: LiveNames | null;
}

export interface SignalChoice {
  name: string;
  label: string;
  kind: string;
}

/** A step, or a SubDevice at which something is read (then without a row). */
export interface Part {
  step: string;
  subdevice: string;
  title: string;
  fields: Fields;
  row: Step | null;
}
