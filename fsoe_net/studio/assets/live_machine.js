// Places of the parts of the machine: each bus in rows from its MainDevice, branches below, cables, arcs.

/** @typedef {import("./types").LivePicture} LivePicture */
/** @typedef {import("./types").LiveConnection} LiveConnection */
/**
 * `nodes` has the box of each node, with the foot of its line; `ends` the MainDevice of each bus; a cable has a
 * number, see fsoe_net/studio/live_cabling.py, and the place of its sign; an arc the place of its ring and for how many facts
 * there is room.
 * @typedef {{ x: number, y: number, width: number, height: number, foot: number }} Box
 * @typedef {{ number: number, path: string, x: number, y: number }} Cable
 * @typedef {{ name: string, path: string, x: number, y: number, facts: number }} Arc
 * @typedef {{ width: number, height: number, lines: number, nodes: Box[], ends: (Box & { bus: number })[],
 *   cables: Cable[], arcs: Arc[] }} Layout
 */

const MAIN_PX = 84; // width of a MainDevice
const GAP_PX = 28; // between two boxes: a cable that can be pressed
const LEAST_PX = 108; // width of a box
const MOST_PX = 236;
const HEAD_PX = 66; // name, type, AL state
const LAMP_PX = 18;
const AXIS_PX = 62;
const BAND_PX = 74; // above a row, for arcs
const LANE_PX = 26; // below a row, for cables that return
const FEW = 40; // up to so many nodes, lamps have their names
const CABLE_AT = 22; // from the upper edge of a box
const FACTS_PX = 150; // width of the facts of a connection
const ZOOMS = [1.7, 1.5, 1.3, 1.15];
const ZOOMED_PX = 400; // height that an enlarged picture may have, so that the buttons stay in sight

/** Whether the lamps of a picture have their names. @param {LivePicture} picture */
export const isRoomy = (picture) => picture.nodes.length <= FEW;

/**
 * The nodes of each bus in chains: from the MainDevice along port 1, then each branch.
 * @param {LivePicture} picture
 * @returns {{ from: number | null, bus: number, nodes: number[] }[]}
 */
export function chains(picture) {
  /** @type {Map<number | null, number[]>} */
  const after = new Map();
  picture.nodes.forEach(({ parent }, n) => after.set(parent, [...(after.get(parent) ?? []), n]));
  /** @type {ReturnType<typeof chains>} */
  const found = [];
  // A list and no recursion: a bus may have thousands of SubDevices.
  const waiting = [...(after.get(null) ?? [])].reverse();
  for (let first = waiting.pop(); first !== undefined; first = waiting.pop()) {
    const chain = { from: picture.nodes[first].parent, bus: picture.nodes[first].bus, nodes: [first] };
    found.push(chain);
    /** @type {number[]} */
    const branches = [];
    for (let last = first; ; ) {
      const next = after.get(last) ?? [];
      const straight = next.find((n) => picture.nodes[n].port === 1) ?? next[next.length - 1];
      branches.push(...next.filter((n) => n !== straight));
      if (straight === undefined) break;
      chain.nodes.push(straight);
      last = straight;
    }
    waiting.push(...branches.reverse());
  }
  return found;
}

/** Height of a box. @param {LivePicture} picture @param {number} number */
function heightOf(picture, number) {
  const node = picture.nodes[number];
  const lamps = isRoomy(picture)
    ? LAMP_PX * (node.inputs.length + node.outputs.length)
    : LAMP_PX * (Number(node.inputs.length > 0) + Number(node.outputs.length > 0));
  const logic = picture.stops && node.kind === "logic" ? 30 : 0; // its outputs, on or off
  return HEAD_PX + lamps + logic + (node.axes.length ? AXIS_PX : 0) + (lamps ? 8 : 0);
}

/**
 * The largest picture that fits: few SubDevices are enlarged, many are in several lines.
 * @param {LivePicture} picture
 * @param {LiveConnection[]} connections
 * @param {number} width in pixels
 * @returns {{ zoom: number, places: Layout }}
 */
export function fitted(picture, connections, width) {
  const plain = layout(picture, connections, width);
  for (const zoom of ZOOMS) {
    const places = layout(picture, connections, width / zoom);
    if (places.lines <= plain.lines && places.height * zoom <= ZOOMED_PX) return { zoom, places };
  }
  return { zoom: 1, places: plain };
}

/**
 * @param {LivePicture} picture
 * @param {LiveConnection[]} connections
 * @param {number} width in pixels
 * @returns {Layout}
 */
export function layout(picture, connections, width) {
  const rows = chains(picture);
  const left = MAIN_PX + GAP_PX;
  const most = Math.max(1, ...rows.map((row) => row.nodes.length));
  const wide = (width - left - 20) / most - GAP_PX;
  const boxWidth = wide >= LEAST_PX ? Math.min(MOST_PX, wide) : LEAST_PX;
  const perLine = Math.max(1, Math.floor((width - left - 20 + GAP_PX) / (boxWidth + GAP_PX)));
  /** @type {Layout} */
  const found = { width, height: 0, lines: 0, nodes: [], ends: [], cables: [], arcs: [] };
  /** @type {Map<number, number>} Of a node: the number of its line. */
  const lines = new Map();
  let [y, line, bus] = [0, 0, -1];
  for (const row of rows) {
    for (let begin = 0; begin < row.nodes.length; begin += perLine) {
      const part = row.nodes.slice(begin, begin + perLine);
      const heights = part.map((n) => heightOf(picture, n));
      const high = Math.max(...heights);
      y += BAND_PX;
      part.forEach((n, at) => {
        found.nodes[n] = { x: left + at * (boxWidth + GAP_PX), y, width: boxWidth, height: heights[at], foot: y + high };
        lines.set(n, line);
      });
      if (row.from === null && begin === 0 && row.bus !== bus) {
        bus = row.bus;
        found.ends.push({ bus, x: 8, y, width: MAIN_PX - 8, height: HEAD_PX, foot: y + high });
      }
      y += high + LANE_PX;
      line += 1;
    }
  }
  found.height = y + 4;
  found.lines = line;
  placeCables(picture, found);
  placeArcs(picture, connections, found, lines);
  return found;
}

/** @param {LivePicture} picture @param {Layout} found */
function placeCables(picture, found) {
  const endOf = (/** @type {number} */ bus) => found.ends.find((e) => e.bus === bus) ?? found.ends[0];
  let gutter = 0;
  // Cables that leave a line run in the left margin, each a little further to the right.
  const margin = () => 6 + (gutter++ % 5) * 5;
  picture.nodes.forEach(({ parent, bus, port }, number) => {
    const to = found.nodes[number];
    const from = parent === null ? endOf(bus) : found.nodes[parent];
    const [x, y] = [to.x - GAP_PX / 2, to.y + CABLE_AT];
    const isNext = from.y === to.y && to.x > from.x && to.x - from.x - from.width < GAP_PX + 1;
    if (isNext) return void found.cables.push({ number, x, y, path: `M${from.x + from.width} ${y}H${to.x}` });
    const side = margin();
    // A branch leaves below its box, a line that is continued at its right edge.
    const lane = from.foot + LANE_PX / 2;
    const middle = from.x + from.width / 2 + (parent === null ? 0 : 12 * (port - 2));
    const start = parent !== null && port === 1
      ? `M${from.x + from.width} ${from.y + CABLE_AT}h10V${lane}`
      : `M${middle} ${from.y + from.height}V${lane - 4}`;
    found.cables.push({ number, x, y, path: `${start}H${side}V${y}H${to.x}` });
  });
  picture.rings.forEach((last, n) => {
    const [from, end] = [found.nodes[last], endOf(picture.nodes[last].bus)];
    const below = from.foot + LANE_PX / 2 + 4;
    const path = `M${from.x + from.width} ${from.y + CABLE_AT}h12V${below}H${end.x + 24}V${end.y + end.height}`;
    found.cables.push({ number: picture.nodes.length + n, x: from.x - 10, y: below, path });
  });
}

/**
 * @param {LivePicture} picture
 * @param {LiveConnection[]} connections
 * @param {Layout} found
 * @param {Map<number, number>} lines
 */
function placeArcs(picture, connections, found, lines) {
  const numbers = new Map(picture.nodes.map((node, n) => [node.name, n]));
  /** @type {Map<string, number>} How many connections end at a SubDevice so far. */
  const taken = new Map();
  /** @type {Map<string, number>} */
  const inAll = new Map();
  for (const c of connections) inAll.set(c.sub, (inAll.get(c.sub) ?? 0) + 1);
  for (const { name, main, sub } of connections) {
    const [a, b] = [numbers.get(main), numbers.get(sub)];
    if (a === undefined || b === undefined) continue;
    const [from, to] = [found.nodes[a], found.nodes[b]];
    const number = taken.get(sub) ?? 0;
    taken.set(sub, number + 1);
    const x = to.x + 18 + number * 26;
    const y = to.y - 15;
    const begin = from.x + from.width / 2 + (x < from.x ? -16 : 16);
    const far = Math.abs(to.x - from.x) / (from.width + GAP_PX);
    const isSame = lines.get(a) === lines.get(b);
    const top = Math.min(y - 10, to.y - 35 - Math.min(26, 8 * far));
    const path = isSame
      ? `M${begin} ${from.y}C${begin} ${top} ${x} ${top - 8} ${x} ${y - 10}`
      : across(from, begin, to, x);
    const room = to.width >= FACTS_PX ? 2 : 1;
    const facts = Number(inAll.get(sub)) > 1 ? 0 : room;
    found.arcs.push({ name, path, x, y, facts });
  }
}

/** An arc to another line. @param {Box} from @param {number} begin @param {Box} to @param {number} x */
function across(from, begin, to, x) {
  const isDown = to.y > from.y;
  const start = isDown ? from.y + from.height : from.y;
  return `M${begin} ${start}C${begin} ${start + (isDown ? 50 : -52)} ${x} ${to.y - 90} ${x} ${to.y - 25}`;
}
