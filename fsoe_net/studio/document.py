"""Content of the page about a network: parts with their places in the text, slots, findings."""

from __future__ import annotations

import hashlib
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from typing import Any

from fsoe_net.compare.scan_match import first_master, match_subdevices
from fsoe_net.diag.diagnostic import Diagnostic, Span
from fsoe_net.diag.printable import printable
from fsoe_net.document.model import outward
from fsoe_net.model.bus import Device, SubDevice
from fsoe_net.model.description import DescribedSubDevice
from fsoe_net.model.kinds import kind_of
from fsoe_net.model.layout import FramePair
from fsoe_net.model.library import Library
from fsoe_net.model.library_fill import library_device, library_role
from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.scan import Scan
from fsoe_net.model.transfer_ends import ResolvedTransfer
from fsoe_net.model.wiring import wiring_of
from fsoe_net.project.check import Checked, library_of
from fsoe_net.studio.changes import FACTS
from fsoe_net.studio.workspace import Workspace
from fsoe_net.timing.budget import make_budget
from fsoe_net.timing.watchdogs import Limit, WatchdogBudget

# By whether the SubDevice has MainInstances and SubInstances.
_ROLES = {(True, True): "both", (True, False): "main", (False, True): "sub", (False, False): ""}


def cables_of(network: NetworkConfig, scan: Scan) -> dict[str, Any]:
    """Return the cables as plain JSON values; see ``assets/types.d.ts``.

    Args:
        network: Its SubDevices are found in the scan as in ``fsoe-net check --scan``.
        scan: Scan of the bus; with several buses, of the first one.
    """
    match = match_subdevices(first_master(network), scan.subdevices, {})
    names = {there.position: sub.name for sub, there in (*match.other, *match.pairs)}
    names |= {there.position: sub.name for sub, _, there in match.moved}
    for one, there, two, where in match.swapped:
        names |= {there.position: one.name, where.position: two.name}
    others = {there.position for _, there in match.other}
    wiring = wiring_of(scan)
    cables = () if wiring is None else wiring.cables
    # In a ring, frames also arrive from the other side; the drawing closes the loop there.
    ring = None if wiring is None else wiring.ring_from
    return {
        "is_known": wiring is not None,
        "ring_from": None if ring is None else list(ring),
        "nodes": [
            {
                "position": cable.position,
                "parent": cable.parent,
                "port": cable.port,
                "subdevice": names.get(cable.position, ""),
                "is_other": cable.position in others,
                "type": printable(scan.subdevices[cable.position].name.split(" ")[0]),
            }
            for cable in cables
        ],
    }


Row = dict[str, object]


def state_of(workspace: Workspace, scan: tuple[str, Scan] | None = None) -> Row:
    """Return the content of the page as plain JSON values; shape: ``assets/types.d.ts``.

    Args:
        workspace: The file being edited.
        scan: A scan that shows the cabling of the bus, with the name of its file.
    """
    checked = workspace.checked
    resolution = checked.resolution
    # A text that is not yet a valid network has no parts; the page then shows the last drawing.
    subdevices: list[Row] = []
    connections: list[Row] = []
    proposals: Row = {}
    if resolution is not None:
        library = library_of(resolution.network)
        subdevices = subdevice_rows(resolution, library)
        budget = make_budget(resolution, library)
        connections = [_connection(row, workspace.path) for row in budget.connections]
        proposals = {key: _next_free(key, resolution) for key in ("address", "connection_id")}
    parts = _Parts(workspace.path, resolution)
    return {
        "version": workspace.version,
        "content": content_of(workspace.checked),
        "path": workspace.path,
        "name": "" if resolution is None else resolution.network.name,
        # A text field of a browser has one type of line ending. `_with_line_ends` restores the
        # others.
        "text": workspace.text.replace("\r\n", "\n"),
        "saved": workspace.is_saved,
        "is_new": workspace.is_new,
        "unwritten": list(workspace.unwritten),
        "outside": workspace.outside,
        "can_undo": workspace.can_undo,
        "can_redo": workspace.can_redo,
        "is_network": resolution is not None,
        "cycle_us": None
        if resolution is None or resolution.network.cycle_ns is None
        else resolution.network.cycle_ns / 1000,
        "buses": [] if resolution is None else [bus.name for bus in resolution.network.buses],
        "wiring": None
        if scan is None or resolution is None
        else {"file": scan[0], **cables_of(resolution.network, scan[1])},
        "subdevices": subdevices,
        "connections": connections,
        "limits": FACTS,
        "proposals": proposals,
        "findings": [_finding(row, parts, workspace.path) for row in checked.diagnostics],
    }


def content_of(checked: Checked) -> str:
    """Return a hash of the content of all files of a network; empty for an invalid text."""
    if checked.network is None:
        return ""
    rows = "\n".join(f"{source.sha256} {source.path}" for source in checked.network.sources)
    return hashlib.sha256(rows.encode("utf-8", "surrogateescape")).hexdigest()


def subdevice_rows(resolution: Resolution, library: Library) -> list[Row]:
    """Return the SubDevices of a network, in the order of its file."""
    used = _used(resolution)
    return [_subdevice(s, used, resolution, library) for s in resolution.network.subdevices]


def _used(resolution: Resolution) -> dict[tuple[str, int], int]:
    """Return the number of the connection that uses a pair of frames, by SubDevice and slot."""
    found: dict[tuple[str, int], int] = {}
    for number, row in enumerate(resolution.connections):
        for end, slot in ((row.main, row.slot), (row.sub, row.sub_slot)):
            if slot is not None:
                found[end.name, slot] = number
    return found


def _subdevice(
    sub: SubDevice, used: dict[tuple[str, int], int], resolution: Resolution, library: Library
) -> Row:
    # A device without a known layout has no slots, and therefore nothing to connect.
    pairs: Sequence[FramePair] = () if sub.layout is None else sub.layout.frame_pairs
    is_main = any(net.safety_master == sub.name for net in resolution.network.nets)
    is_sub = any(row.sub is sub for row in resolution.connections)
    device, groups = sub.device, resolution.network.groups
    likely = "" if device is None else _likely_role(device, pairs, library)
    known = None if device is None else library_device(DescribedSubDevice(device=device), library)
    is_logic = is_main or (likely == "main" and not is_sub)
    return {
        "name": sub.name,
        "kind": kind_of(sub, is_main=is_logic).value,
        "type": "" if known is None else known.name,
        "about": "" if known is None else known.about,
        "position": sub.position,
        "alias": sub.alias,
        "bus": sub.master_id,
        "line": sub.span.line,
        "group": next((g.name for g in groups if sub.name in g.subdevices), ""),
        # If it is in use, the role is a fact in the file; `likely` is a guess for an unconnected
        # SubDevice.
        "role": _ROLES[is_main, is_sub],
        "likely": likely,
        "device": "" if device is None else device.path,
        "identity": ""
        if device is None
        else f"vendor 0x{device.vendor_id:08x}, product 0x{device.product_code:08x}",
        "pairs": [_pair(pair, used.get((sub.name, pair.slot))) for pair in pairs],
    }


def _pair(pair: FramePair, connection: int | None) -> Row:
    return {
        "slot": pair.slot,
        "sends_bytes": pair.sent_bytes,
        "takes_bytes": 0 if pair.takes is None else pair.takes.frame_bytes,
        "matched": pair.matched,
        "connection": connection,
    }


def _likely_role(device: Device, pairs: Sequence[FramePair], library: Library) -> str:
    """Return the role in the device library for frames of these lengths."""
    lengths = tuple((p.taken_bytes, p.sent_bytes) for p in pairs)
    return library_role(DescribedSubDevice(device=device), lengths, library)


def _connection(budget: WatchdogBudget, path: str) -> Row:
    row, facts = budget.connection, budget.connection.stated
    return {
        "name": row.name,
        "net": row.net.name,
        "main": row.main.name,
        "sub": row.sub.name,
        "slot": row.slot,
        "sub_slot": row.sub_slot,
        "address": facts.address,
        "connection_id": facts.connection_id,
        "watchdog_ms": facts.watchdog_ms,
        "least_ms": _ms(budget.least, up=True),
        "greatest_ms": _ms(budget.greatest, up=False),
        "unconfirmed": facts.unconfirmed,
        "to_sub_bytes": row.to_sub.transfer.size_bytes,
        "to_main_bytes": row.to_main.transfer.size_bytes,
        "copies": [_copy(way) for way in (row.to_sub, row.to_main)],
        "line": _own_line((row.facts or row.to_sub.transfer).span, path),
    }


def _copy(way: ResolvedTransfer) -> Row:
    """Return the source and destination of the bytes of a frame."""
    return {"size_bytes": way.transfer.size_bytes} | {
        name: {
            "subdevice": end.endpoint.module,
            "entry": f"0x{end.endpoint.index:04x}:{end.endpoint.subindex:02x}",
            "sm": None if end.sm is None else end.sm.sm.index,
            "byte": None if end.placed is None else end.placed.bit_offset // 8,
            "of_bytes": None if end.sm is None else (end.sm.bits + 7) // 8,
        }
        for name, end in (("source", way.source), ("destination", way.destination))
    }


def _ms(limit: Limit | None, *, up: bool) -> float | None:
    """Return a limit, rounded to the safe side: at most 109.96 ms is shown as 109.9 ms."""
    return None if limit is None else outward(limit.ms, 1, up=up)


def _own_line(span: Span, path: str) -> int:
    return span.line if span.file == path else 0


def _next_free(key: str, resolution: Resolution) -> int:
    """Return the lowest number that no connection has: a proposal, never set automatically."""
    taken = {getattr(row.stated, key) for row in resolution.connections}
    return next(number for number in range(1, len(taken) + 2) if number not in taken)


class _Parts:
    """Finds the SubDevice or connection that a finding belongs to, by its place."""

    def __init__(self, path: str, resolution: Resolution | None) -> None:
        self._starts: list[tuple[int, int, str, str]] = []
        self._devices: dict[str, list[str]] = {}
        if resolution is None:
            return
        network = resolution.network
        for sub in network.subdevices:
            self._add(sub.span, path, "subdevice", sub.name)
            if sub.device is not None:
                self._devices.setdefault(sub.device.path, []).append(sub.name)
        # Places of other parts limit the preceding ones: a finding belongs to the last part that
        # starts before it.
        for place in (*network.fields.values(), *(net.span for net in network.nets)):
            self._add(place, path, "", "")
        for function in network.safety_functions:
            self._add(function.span, path, "", "")
        for number, row in enumerate(resolution.connections):
            for located in (row.facts, row.to_sub.transfer, row.to_main.transfer):
                if located is not None:
                    self._add(located.span, path, "connection", str(number))
        self._starts.sort()

    def _add(self, span: Span, path: str, kind: str, name: str) -> None:
        if span.file == path and span.line:
            self._starts.append((span.line, span.column, kind, name))

    def at(self, span: Span) -> tuple[list[str], list[int]]:
        """Return the names of SubDevices and the numbers of connections at a place."""
        # A finding in a device file concerns each SubDevice that uses this file.
        if span.file in self._devices:
            return self._devices[span.file], []
        # "~" sorts after every name, so that a part that starts exactly here counts.
        place = bisect_right(self._starts, (span.line, span.column, "~", ""))
        if not place or not span.line:
            return [], []
        _, _, kind, name = self._starts[place - 1]
        return [name] if kind == "subdevice" else [], [int(name)] if kind == "connection" else []


def _finding(row: Diagnostic, parts: _Parts, path: str) -> Row:
    subdevices, connections = parts.at(row.span) if row.span.file else ([], [])
    return {
        "code": row.code,
        "severity": row.level.value,
        "message": printable(row.message),
        "hint": printable(row.hint),
        "file": printable(row.span.file),
        "line": row.span.line,
        "column": row.span.column,
        "own": row.span.file == path,
        "fixable": bool(row.edits) and _all_in(path, (edit.span for edit in row.edits)),
        "subdevices": subdevices,
        "connections": connections,
        "related": [
            {
                "message": printable(other.message),
                "line": _own_line(other.span, path),
                "place": printable(str(other.span)),
            }
            for other in row.related
        ],
    }


def _all_in(path: str, spans: Iterable[Span]) -> bool:
    return all(span.file == path for span in spans)
