"""A network as a picture: the bus, slots, and a line per FSoE connection; even with errors."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.diag.words import counted
from fsoe_net.document.markup import escape, shortened, svg_text
from fsoe_net.document.model import MARKS, Level
from fsoe_net.model.bus import Located, SubDevice
from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.resolve import Connection, Resolution

_WIDTH, _CARD, _MARGIN = 900, 270, 12
_BOX, _BOX_STEP, _PER_ROW = 150, 174, 5
_HEAD, _SLOT, _GAP = 46, 26, 14
_BUS_NAME, _BOX_ROW = 18, 48
_BAD = MARKS[Level.ERROR]
_DRAWN = 'style="stroke:var(--c2)"'
_WRONG = 'style="stroke:var(--red)" stroke-dasharray="2 4"'

_Places = set[tuple[str, int]]


def network_picture(resolution: Resolution, found: Sequence[Diagnostic]) -> str:
    """Draw a network: MainInstances left, SubInstances right, each connection from slot to slot.

    Args:
        resolution: The network, which may have errors.
        found: Findings: parts with an error are marked by a sign and by their line.
    """
    # Findings have places in files, not parts: a part is marked if its line has an error.
    wrong = {(d.span.file, d.span.line) for d in found if d.level is Severity.ERROR}
    subs = resolution.network.subdevices
    mains = {net.safety_master for net in resolution.network.nets}
    ends = {c.sub.name for c in resolution.connections}
    parts, top = _bus(resolution.network, wrong)
    ports: dict[tuple[str, int | None], tuple[float, float]] = {}
    columns = {True: top, False: top}
    for sub in (s for s in subs if _slots(s)):
        # A SubDevice without a connection is placed by its slots: only a safety logic has several.
        is_left = sub.name in mains or (sub.name not in ends and len(_slots(sub)) > 1)
        role = "MainInstance" if sub.name in mains else "no FSoE connection"
        role = "SubInstance" if sub.name in ends else role
        role = "Main- and SubInstance" if sub.name in mains & ends else role
        parts.append(_card(sub, role, columns[is_left], ports, is_left=is_left))
        columns[is_left] += _HEAD + _SLOT * len(_slots(sub)) + _GAP
    parts += [_line(c, ports, wrong) for c in resolution.connections]
    count = counted(len(resolution.connections), "FSoE connection")
    height = max(columns.values())
    return (
        f'<svg viewBox="0 0 {_WIDTH} {height}" style="max-width:{_WIDTH}px" role="img" '
        f'aria-label="Bus with {counted(len(subs), "SubDevice")}, {count}">{"".join(parts)}</svg>'
    )


def _slots(sub: SubDevice) -> Sequence[int]:
    return () if sub.layout is None else [pair.slot for pair in sub.layout.frame_pairs]


def _bus(network: NetworkConfig, wrong: _Places) -> tuple[list[str], int]:
    """Return the boxes along each bus, and the height at which the cards begin."""
    buses: dict[int, list[SubDevice]] = {}
    for sub in network.subdevices:
        buses.setdefault(sub.master_id, []).append(sub)
    parts, top = [], _MARGIN
    for number, subs in buses.items():
        if len(buses) > 1:
            parts.append(
                svg_text(_MARGIN, top + 12, _bus_name(network, number, subs), "start", "name")
            )
            top += _BUS_NAME
        parts += [_box(sub, place, top, wrong) for place, sub in enumerate(subs)]
        top += _BOX_ROW * -(-len(subs) // _PER_ROW)
    return parts, top + _GAP


def _bus_name(network: NetworkConfig, number: int, subs: Sequence[SubDevice]) -> str:
    name = network.buses[number].name if network.buses else subs[0].system
    return shortened(name, 60)


def _box(sub: SubDevice, place: int, top: int, wrong: _Places) -> str:
    row, column = divmod(place, _PER_ROW)
    x, y = _MARGIN + column * _BOX_STEP, top + row * _BOX_ROW
    sign = f"{_BAD} " if _is_wrong(sub, wrong) else ""
    before = x - (_BOX_STEP - _BOX if column else _MARGIN)
    label = f"{sign}{sub.position} {shortened(sub.name, 20)}"
    return (
        f'<line x1="{before}" y1="{y + 16}" x2="{x}" y2="{y + 16}" class="bus"/>'
        f'<rect x="{x}" y="{y}" width="{_BOX}" height="32" rx="4" class="box"/>'
        + svg_text(x + _BOX / 2, y + 21, label, "middle")
    )


def _card(
    sub: SubDevice,
    role: str,
    y: int,
    ports: dict[tuple[str, int | None], tuple[float, float]],
    *,
    is_left: bool,
) -> str:
    x = _MARGIN if is_left else _WIDTH - _CARD - _MARGIN
    edge = x + _CARD if is_left else x
    height = _HEAD + _SLOT * len(_slots(sub))
    parts = [
        f'<rect x="{x}" y="{y}" width="{_CARD}" height="{height}" rx="6" '
        f'class="box {"main" if is_left else "sub"}"/>',
        svg_text(x + 12, y + 20, shortened(sub.name, 20), "start", "name"),
        svg_text(x + 12, y + 37, role, "start", "small"),
    ]
    for n, slot in enumerate(_slots(sub)):
        middle = y + _HEAD + _SLOT * n + _SLOT / 2 - 4
        ports[sub.name, slot] = (edge, middle)
        place, anchor = (edge - 14, "end") if is_left else (edge + 14, "start")
        parts.append(
            f'<rect x="{edge - 7}" y="{middle - 7:g}" width="14" height="14" class="sm"/>'
            + svg_text(place, middle + 4, f"slot {slot}", anchor, "small")
        )
    return "".join(parts)


def _line(
    connection: Connection,
    ports: dict[tuple[str, int | None], tuple[float, float]],
    wrong: _Places,
) -> str:
    begin = ports.get((connection.main.name, connection.slot))
    end = ports.get((connection.sub.name, connection.sub_slot))
    # A connection with an error may name a slot that does not exist.
    if begin is None or end is None:
        return ""
    rows = (connection.facts, connection.to_sub.transfer, connection.to_main.transfer)
    is_wrong = any(row is not None and _is_wrong(row, wrong) for row in rows)
    kind = _WRONG if is_wrong else _DRAWN
    # At least 60: two cards at the same height would otherwise be joined by a flat line.
    bend = max(60.0, abs(end[0] - begin[0]) / 2)
    back = bend if end[0] - begin[0] < 40 else -bend  # both in one column: a loop
    middle = (begin[0] + end[0]) / 2, (begin[1] + end[1]) / 2
    return (
        f"<g><title>{escape(connection.name)}</title>"
        f'<path d="M{begin[0]},{begin[1]:g} C{begin[0] + bend:g},{begin[1]:g} '
        f'{end[0] + back:g},{end[1]:g} {end[0]},{end[1]:g}" class="arc" {kind}/>'
        + (svg_text(middle[0], middle[1] - 4, _BAD, "middle", "name") if is_wrong else "")
        + "</g>"
    )


def _is_wrong(part: Located, wrong: _Places) -> bool:
    return (part.span.file, part.span.line) in wrong
