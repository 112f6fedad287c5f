"""Pictures of a report: the network, and the copied bytes. Plain SVG, no script."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fsoe_net.diag.words import counted
from fsoe_net.document.markup import escape, shortened, svg_text
from fsoe_net.plan.model import NONE, Plan
from fsoe_net.plan.show import entry_at

_BOX_WIDTH, _BOX_HEIGHT, _GAP = 170, 62, 34
MAX_PER_ROW = 5
_LINE, _TOP_LINE = 15, 34  # height of a name, and the highest baseline in the picture
# Word and class of a box, by whether the SubDevice has MainInstances and SubInstances.
_ROLES = {
    (True, True): ("Main + Sub", "main"),
    (True, False): ("MainInstance", "main"),
    (False, True): ("SubInstance", "sub"),
    (False, False): ("no FSoE", "plain"),
}
_DASHES = ("", "9 4", "2 3", "12 3 2 3", "18 5", "5 3 2 3 2 3")
_COLOURS = ("#0550ae", "#953800", "#116329", "#6639ba", "#99286e", "#424a53")


def _colour(number: int) -> str:
    """Return a colour; the page defines variables for it that follow its colour scheme."""
    place = number % len(_COLOURS)
    return f"var(--c{place},{_COLOURS[place]})"


def topology_picture(plan: Plan, *, per_row: int = MAX_PER_ROW) -> str:
    """Draw the bus with the SubDevices involved and its FSoE connections.

    Connections are arcs; if those would cross too many rows, each box names its connections
    instead. If there are many SubDevices, those without a copy are omitted with a note.

    Args:
        plan: The plan to draw.
        per_row: Boxes per row; 2 fit a phone.
    """
    # A small network is shown completely, so that a person recognises the machine.
    is_small = len(plan.subdevices) <= 12
    shown = [n for n, s in enumerate(plan.subdevices) if is_small or s.in_copy]
    # Arcs across more than two rows would cross boxes and be hard to follow.
    dense = len(shown) > 2 * per_row
    first_y, step_x, step_y = (30 if dense else 110), _BOX_WIDTH + _GAP, (94 if dense else 200)
    place: dict[int, tuple[float, float]] = {}
    rows = _rows(plan, shown, per_row)
    for row, (_, numbers) in enumerate(rows):
        y = first_y + row * step_y
        place |= {number: (20 + column * step_x, y) for column, number in enumerate(numbers)}
    columns = max((len(numbers) for _, numbers in rows), default=1)
    last_y = first_y + max(len(rows) - 1, 0) * step_y
    names = [(row, name) for row, (name, _) in enumerate(rows) if name]
    width, height = 20 + columns * step_x, last_y + _BOX_HEIGHT + 28 + _LINE * bool(names)
    connections = counted(len(plan.connections), "FSoE connection")
    parts = [
        f'<svg viewBox="0 20 {width} {height - 20:g}" style="max-width:{width}px" role="img" '
        f'aria-label="Topology: {connections}">'
    ]
    # Drawn first, so that boxes cover the line.
    parts += _bus_line(list(place.values()), step_x)
    for row, name in names:
        below = first_y + row * step_y + _BOX_HEIGHT + 16
        parts.append(svg_text(20, below, name, "start", "name"))
    parts += _boxes(plan, place, _connection_lines(plan) if dense else {})
    if not dense:  # names above all lines, so that no line crosses a name
        parts += _arcs(plan, place)
    hidden = len(plan.subdevices) - len(shown)
    if hidden:
        text = f"{hidden} SubDevices without a copy"
        parts.append(svg_text(20, height - 6, text, "start", "small"))
    return "".join([*parts, "</svg>"])


def _boxes(
    plan: Plan, place: Mapping[int, tuple[float, float]], lines: Mapping[int, str]
) -> list[str]:
    mains = {c.main for c in plan.connections}
    subs = {c.sub for c in plan.connections}
    return [
        _box(plan, n, at, n in mains, n in subs, lines.get(n, ""))
        for n, at in sorted(place.items())
    ]


def _rows(plan: Plan, shown: Sequence[int], per_row: int) -> list[tuple[str, list[int]]]:
    """Return the content of each row; with several buses, the first row of a bus has its name."""
    buses: dict[int, list[int]] = {}
    for number in shown:
        # In order of the plan, which is the order on the wire.
        buses.setdefault(plan.bus_number(number), []).append(number)
    return [
        (
            f"bus {plan.buses[bus].name}" if len(plan.buses) > 1 and not at else "",
            own[at : at + per_row],
        )
        for bus, own in buses.items()
        for at in range(0, len(own), per_row)
    ]


def _bus_line(places: list[tuple[float, float]], step_x: float) -> list[str]:
    """Return the EtherCAT line through the boxes, row by row."""
    lines = []
    for top in sorted({y for _, y in places}):
        y, end = top + _BOX_HEIGHT / 2, max(x for x, row in places if row == top)
        lines.append(f'<line x1="2" y1="{y:g}" x2="{end + step_x - 10:g}" y2="{y:g}" class="bus"/>')
    return lines


def _connection_lines(plan: Plan) -> dict[int, str]:
    """Return the connections of a box: partner and connection ID, or their number."""
    found: dict[int, list[str]] = {}
    for c in plan.connections:
        known = f", ConnID {c.connection_id}" if c.connection_id else ""
        found.setdefault(c.main, []).append(f"with {plan.subdevices[c.sub].name}{known}")
        found.setdefault(c.sub, []).append(f"with {plan.subdevices[c.main].name}{known}")
    return {n: w[0] if len(w) == 1 else counted(len(w), "connection") for n, w in found.items()}


def _box(
    plan: Plan,
    number: int,
    at: tuple[float, float],
    is_main: bool,
    is_sub: bool,
    line: str,
) -> str:
    sub = plan.subdevices[number]
    x, y = at
    role, cls = _ROLES[is_main, is_sub]
    address = f"alias {sub.alias}+{sub.position}" if sub.alias else f"position {sub.position}"
    middle = x + _BOX_WIDTH / 2
    name = shortened(sub.name, 22)
    return (
        f"<g><title>{escape(sub.name)}: vendor 0x{sub.vendor_id:08x}, product "
        f"0x{sub.product_code:08x}</title>"
        f'<rect x="{x:g}" y="{y:g}" width="{_BOX_WIDTH}" height="{_BOX_HEIGHT}" rx="6" '
        f'class="box {cls}"/>'
        + svg_text(middle, y + (19 if line else 24), name, "middle", "name")
        + svg_text(middle, y + (37 if line else 46), f"{role} · {address}", "middle", "small")
        + (svg_text(middle, y + 53, shortened(line, 28), "middle", "small") if line else "")
        + "</g>"
    )


def _arcs(plan: Plan, place: dict[int, tuple[float, float]]) -> list[str]:
    """Return the lines of all connections, then their names, which do not overlap."""
    lines, names = [], []
    taken: list[tuple[float, float, float]] = []
    for number, connection in enumerate(plan.connections):
        line, middle, wanted = _arc(number, place[connection.main], place[connection.sub])
        identity = connection.connection_id
        label = f"ConnID {identity}" if identity else shortened(connection.name, 22)
        wide = 7.6 * len(label) + 4
        base = _free_line(middle, wanted, wide, taken)
        taken.append((middle, base, wide))
        lines.append(line)
        names.append(
            f"<g><title>{escape(connection.name)}</title>"
            f'<rect x="{middle - wide / 2:g}" y="{base - 11:g}" width="{wide:g}" height="14" '
            'class="under"/>'
            f'<text x="{middle:g}" y="{base:g}" text-anchor="middle" class="label" '
            f'style="fill:{_colour(number)}">{escape(label)}</text></g>'
        )
    return lines + names


def _free_line(
    middle: float, wanted: float, wide: float, taken: list[tuple[float, float, float]]
) -> float:
    """Return the free height for a name that is closest to the wanted one."""
    # Alternately above and below, so that the closest free line is found first.
    for step in range(4 * len(taken) + 2):
        base = wanted + _LINE * ((step + 1) // 2) * (1 if step % 2 else -1)
        # Above this line the text would be outside of the picture.
        if base < _TOP_LINE:
            continue
        near = (t for t in taken if abs(t[1] - base) < _LINE)
        if all(abs(x - middle) >= (other + wide) / 2 for x, _, other in near):
            return base
    return wanted


def _arc(
    number: int, main: tuple[float, float], sub: tuple[float, float]
) -> tuple[str, float, float]:
    """Return the line of a connection and the best position of its name: middle and baseline.

    Lines differ in colour and dashes.
    """
    (x1, y1), (x2, y2) = main, sub
    shift = 10 * (number % 4) - 15
    start, end = x1 + _BOX_WIDTH / 2 + shift, x2 + _BOX_WIDTH / 2 + shift / 2
    lift = 30 + 13 * (number % 5) + abs(end - start) / 30
    bend = min(y1, y2) - lift
    middle = bend + lift * 0.25 + 4
    # Between two rows, below the upper box: above it, the line would cross that row.
    if y1 != y2:
        y1, y2 = (y + _BOX_HEIGHT if y == min(y1, y2) else y for y in (y1, y2))
        middle = (y1 + y2) / 2 + 4
        bend = middle
    line = (
        f'<path d="M{start:g},{y1:g} C{start:g},{bend:g} {end:g},{bend:g} {end:g},{y2:g}" '
        f'class="arc" stroke-dasharray="{_DASHES[number % len(_DASHES)]}" '
        f'style="stroke:{_colour(number)}"/>'
    )
    return line, (start + end) / 2, middle


def copy_picture(plan: Plan, number: int) -> str:
    """Draw source and destination sync manager of a copy as byte rows, the copied range filled."""
    copy = plan.copies[number]
    colour = _colour(number if copy.connection == NONE else copy.connection)
    ends = (
        (copy.source_sm, copy.source_bit // 8, "from"),
        (copy.destination_sm, copy.destination_bit // 8, "to"),
    )
    parts = ['<svg viewBox="0 0 400 86" class="bytes" role="img" aria-label="copied bytes">']
    for row, (sm_number, first, word) in enumerate(ends):
        parts.append(_byte_row(plan, sm_number, first, copy.size_bytes, word, 40 * row, colour))
    return "".join([*parts, "</svg>"])


def _byte_row(
    plan: Plan, sm_number: int, first: int, size: int, word: str, y: float, colour: str
) -> str:
    sm = plan.sync_managers[sm_number]
    # An empty sync manager must not cause a division by zero.
    total = max(1, sm.size_bytes)
    left, room = 122, 266
    unit = room / total
    name = plan.subdevices[sm.subdevice].name
    entry = entry_at(plan, sm_number, 8 * first)
    last = first + size - 1
    shown = shortened(name, 9)
    label = str(first) if size == 1 else f"{first} … {last}"
    wide = 6.2 * len(label)
    middle = left + unit * (first + size / 2)
    # The label stays within the row, even for a frame at its start or end.
    middle = min(max(middle, left + wide / 2 - 4), left + room - wide / 2 + 4)
    end = 6.2 * len(str(total)) + 8
    cells = "".join(
        f'<line x1="{left + unit * n:g}" y1="{y + 10:g}" x2="{left + unit * n:g}" y2="{y + 26:g}" '
        'class="tick"/>'
        for n in range(1, total)
        # More than 64 ticks would be a grey area.
        if total <= 64
    )
    return (
        f"<g><title>{escape(name)} SM{sm.index}: bytes {first} … {last} of {total}"
        f"{', ' + entry if entry else ''}</title>"
        + svg_text(4, y + 22, f"{word} {shown} SM{sm.index}", "start", "small")
        + f'<rect x="{left}" y="{y + 10:g}" width="{room}" height="16" class="sm"/>'
        + f'<rect x="{left + unit * first:g}" y="{y + 10:g}" width="{unit * size:g}" height="16" '
        f'style="fill:{colour}"/>'
        + cells
        + svg_text(middle, y + 38, label, "middle", "tiny")
        # The end labels are omitted if the label of the frame would cover them.
        + (
            svg_text(left, y + 38, "0", "start", "tiny")
            if first and middle - wide / 2 > left + 14
            else ""
        )
        + (
            svg_text(left + room, y + 38, str(total - 1), "end", "tiny")
            if last + 1 < total and middle + wide / 2 < left + room - end
            else ""
        )
        + "</g>"
    )
