"""A net proposed for a scanned bus, as a comment; the user decides about the connections."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence

from fsoe_net.model.bus import SubDevice
from fsoe_net.model.layout import DeviceLayout, FsoeBlock
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.scan import Scan, ScannedConnection

_Pair = tuple[FsoeBlock, FsoeBlock]


def proposed_net(resolution: Resolution, scan: Scan) -> str:
    """Return YAML comments: a net for each MainInstance that reports its connections.

    A connection is proposed if exactly one SubDevice has its FSoE address, and the frames of both
    ends have the same sizes.
    """
    subs = resolution.network.subdevices
    by_address: dict[int | None, list[SubDevice]] = {}
    for sub in subs:
        fsoe = scan.subdevices[sub.position].fsoe
        if fsoe is not None and fsoe.address is not None:
            by_address.setdefault(fsoe.address, []).append(sub)
    lines: list[str] = []
    for sub in subs:
        layout, fsoe = sub.layout, scan.subdevices[sub.position].fsoe
        # Here, only a device that reports its connections is a MainInstance; sizes are not used for
        # guessing.
        if fsoe is None or not fsoe.connections or layout is None:
            continue
        slots = _pairs(layout)
        rows = sorted(fsoe.connections, key=lambda c: c.object_index)
        found = [
            (row, slot, other)
            # Slots and connection objects are both in the order of the object index; one list may
            # be shorter.
            for row, slot in zip(rows, slots, strict=False)
            if (other := _partner(row, slot, sub, by_address.get(row.address, ()))) is not None
        ]
        if found:
            lines += _net(sub, layout.slots, found)
    if not lines:
        return ""
    return "\n".join(
        (
            "# Proposed from what the devices report of their connections. Compare it with the "
            "safety project",
            "# before you use it in place of the line above: it is not confirmed.",
            "# nets:",
            *(f"# {line}" for line in lines),
            "",
        )
    )


def _pairs(layout: DeviceLayout) -> list[_Pair]:
    """Return the frames of each connection of a device: received and sent."""
    blocks = {b.key: b for sm in layout.managers for b in sm.blocks}
    pairs = [(blocks[out], blocks[into]) for out, into in sorted(layout.partners.items())]
    return sorted(pairs, key=lambda p: p[0].command.index)


def _partner(
    row: ScannedConnection,
    slot: _Pair,
    main: SubDevice,
    subs: Sequence[SubDevice],
) -> tuple[SubDevice, _Pair] | None:
    """Return the only matching frame pair of those ``subs`` that have the address."""
    found: list[tuple[SubDevice, _Pair]] = []
    for sub in subs:
        layout = sub.layout
        # An FSoE connection between two frames of one device does not exist.
        if sub is main or layout is None:
            continue
        fitting = [
            pair
            for pair in _pairs(layout)
            # The frame sent by one end is received by the other end, in both directions.
            if pair[0].frame_bytes == slot[1].frame_bytes
            and pair[1].frame_bytes == slot[0].frame_bytes
        ]
        found += [(sub, pair) for pair in fitting]
    # If two match, only the safety project can decide.
    return found[0] if len(found) == 1 else None


def _net(
    main: SubDevice,
    numbers: Mapping[tuple[int, int], int],
    found: list[tuple[ScannedConnection, _Pair, tuple[SubDevice, _Pair]]],
) -> list[str]:
    lines = [
        f"  - name: {yaml_word(main.name + '_safety')}",
        f"    safety_master: {yaml_word(main.name)}",
        "    transfers:",
    ]
    facts: list[str] = []
    for row, (main_in, main_out), (sub, (sub_in, sub_out)) in found:
        lines += _transfer(sub, sub_out, main, main_in) + _transfer(main, main_out, sub, sub_in)
        slots = {numbers.get(main_in.key), numbers.get(main_out.key)}
        values = [("slot", slots.pop() if len(slots) == 1 else None), ("address", row.address)]
        values += [("connection_id", row.connection_id), ("watchdog_ms", row.watchdog_ms)]
        stated = "".join(f", {key}: {value}" for key, value in values if value is not None)
        facts.append(
            f"      - {{main: {yaml_word(main.name)}, sub: {yaml_word(sub.name)}{stated}}}"
        )
    return [*lines, "    connections:", *facts]


def yaml_word(name: str) -> str:
    """Return a name in a form that YAML reads as text."""
    # Unquoted only if YAML cannot read the name as another type, as with `on` or `1e3`.
    bare = re.fullmatch(r"[a-z][a-z0-9]*_[a-z0-9_]+|[a-z]+[0-9]+", name)
    return name if bare else json.dumps(name)


def _transfer(source: SubDevice, out: FsoeBlock, sink: SubDevice, into: FsoeBlock) -> list[str]:
    return [
        f"      - size: {out.frame_bytes}   # {source.name} to {sink.name}",
        f"        in: {_end(source, out)}",
        f"        out: {_end(sink, into)}",
    ]


def _end(sub: SubDevice, block: FsoeBlock) -> str:
    index, subindex = block.command.index, block.command.subindex
    return f"{{ec_module: {yaml_word(sub.name)}, index: 0x{index:04x}, subindex: {subindex}}}"
