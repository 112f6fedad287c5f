"""Output of decoded frames: text in columns, or one JSON document written incrementally."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator

import click

from fsoe_net.capture.decode import CaptureFacts, DecodedFrame, Found
from fsoe_net.capture.names import ConnectionNames
from fsoe_net.cli.terminal import echo
from fsoe_net.core.scan import FoundConnection, FoundPlace, ScanCounts
from fsoe_net.core.snapshot import DirectionSnapshot
from fsoe_net.diag.printable import printable
from fsoe_net.diag.words import counted
from fsoe_net.fsoe.observed import CrcVerdict, FrameDirection
from fsoe_net.fsoe.pdu import Command, command_text, reset_code_text, safe_data_length, safe_data_of
from fsoe_net.version import __version__

_ARROWS = ("main > sub", "sub > main")
_COLOUR = {CrcVerdict.WRONG: "red", CrcVerdict.UNCHECKED: "yellow", CrcVerdict.SAME: None}
_LINES_AT_ONCE = 500
_MOST_PARTS = 10_000


class _Parts:
    """Cached texts of the constant parts of a frame: all but CRCs, time and number."""

    def __init__(self, build: Callable[[DecodedFrame, bytes], tuple[str, str]]) -> None:
        self._build = build
        self._known: dict[tuple[object, ...], tuple[str, str]] = {}

    def of(self, row: DecodedFrame) -> tuple[str, str]:
        _, _, names, number, direction, frame, _, state, _, _ = row
        data = safe_data_of(frame)
        name = None if names is None else names.name
        key = number, direction, frame[0], data, state, frame[-2:], name
        texts = self._known.get(key)
        if texts is None:
            # Safe data that never repeat, such as positions, must not exhaust the memory.
            if len(self._known) >= _MOST_PARTS:
                self._known.clear()
            left, right = self._build(row, data)
            texts = self._known[key] = printable(left), printable(right)
        return texts


class _Lines:
    """Writes large blocks, because a capture has many short lines."""

    def __init__(self) -> None:
        self._lines: list[str] = []

    def add(self, text: str) -> None:
        self._lines.append(text)
        if len(self._lines) >= _LINES_AT_ONCE:
            self.flush()

    def flush(self) -> None:
        click.echo("".join(self._lines), nl=False)
        self._lines.clear()


def _meaning(row: DecodedFrame, data: bytes) -> str:
    """Return the meaning of the frame that its columns do not show."""
    if row.frame[0] == Command.RESET:
        return f"{data[0]}: {reset_code_text(data[0])}"
    if row.frame[0] == Command.PROCESS_DATA and row.names is not None:
        return row.names.values(row.direction, data)
    return ""


class TextOutput:
    """Columns for people."""

    def __init__(self) -> None:
        self.wrong = 0
        self.unchecked = False
        self._lines = _Lines()
        self._columns = _Parts(self._constant)
        self._headed = False

    def begin(self, source: str) -> None:
        """Remember the source; its heading is printed with the first frame."""
        self._source = source
        self._headed = self._damaged = False

    def row(self, row: DecodedFrame) -> None:
        """Print one frame as a line."""
        typed = row.time_ms is None
        if not self._headed:
            self._headed = True
            place = "" if typed else f"{'packet':>8} {'time ms':>12}  {'connection':20} "
            self._lines.add(
                f"{place}{'way':11} {'command':14} {'ConnID':>6}  "
                f"{'CRC':16} {'state':14} safe data\n"
            )
        if typed:
            self.wrong += row.verdict is CrcVerdict.WRONG
        crc = "same frame" if row.verdict is CrcVerdict.SAME else row.verdict.value
        if row.sequence:
            crc = f"{crc} #{row.sequence}"
        crc = f"{crc:16}"
        if row.verdict is not CrcVerdict.RIGHT:
            crc = click.style(crc, fg=_COLOUR[row.verdict])
        place = "" if typed else f"{row.packet:>8} {row.time_ms:>12.3f}  "
        note = printable(f"  {row.note}") if row.note else ""
        left, right = self._columns.of(row)
        self._lines.add(f"{place}{left}{crc} {right}{note}\n")

    @staticmethod
    def _constant(row: DecodedFrame, data: bytes) -> tuple[str, str]:
        """Return the columns left and right of the CRC."""
        name = row.names.name if row.names else f"#{row.number + 1}"
        way = _ARROWS[row.direction]
        connection_id = int.from_bytes(row.frame[-2:], "little")
        place = "" if row.time_ms is None else f"{name:20} "
        left = f"{place}{way:11} {command_text(row.frame[0]):14} {connection_id:>6}  "
        meaning = _meaning(row, data)
        right = f"{row.state.replace('_', ' '):14} {data.hex(' ')}"
        return left, f"{right}  {meaning}" if meaning else right

    def damaged(self, message: str) -> None:
        """Print the message on standard error."""
        self._lines.flush()
        self._damaged = True
        self.wrong += 1
        echo(f"error: {message}", err=True)

    def end_of_frames(self) -> None:
        """Print an empty line."""
        self._lines.flush()
        if self._headed:
            echo()

    def found(self, connections: list[Found], counts: ScanCounts, facts: CaptureFacts) -> None:
        """Print one block per connection, or why there are none."""
        for number, (c, names, swapped) in enumerate(connections, start=1):
            for line in _connection_lines(number, c, names, swapped):
                echo(line)
        if connections:
            echo(
                f"{counted(counts.packets, 'packet')}, {counts.ethercat} of EtherCAT, "
                f"{counts.datagrams} answered process data datagrams"
            )
        elif counts.packets or not self._damaged:
            echo(f"{self._source}: no FSoE connection found; {_none_text(counts)}")
        for number, text in (
            (facts.cut, "packets were captured in part only: capture with -s 0"),
            (facts.other_links, "packets of interfaces that are not Ethernet left out"),
            (counts.malformed, "EtherCAT frames with datagrams that do not fit"),
            (counts.dropped, "datagrams or places were not looked at: too many at once"),
        ):
            if number:
                echo(f"{number} {text}")

    def end(self) -> None:
        """Do nothing: all output is complete."""


def _connection_lines(
    number: int, c: FoundConnection, names: ConnectionNames | None, swapped: bool
) -> Iterator[str]:
    yield (
        f"{names.name if names else f'#{number}'}: "
        f"ConnID {c.connection_id}, now {c.state.replace('_', ' ')}"
    )
    # Wrongly guessed roles are corrected by the network.
    ways = (c.to_sub, c.to_main)[:: -1 if swapped else 1]
    for way, direction in zip(_ARROWS, ways, strict=True):
        yield f"  {way}  {_counts_text(direction)}"
    for place in c.places:
        yield f"  {_place_text(place, swapped)}"
    if not sum(d.right + d.wrong for d in ways):
        yield "  no CRC could be checked: too few frames of both ends in a row"
    if c.gaps:
        yield f"  {counted(c.gaps, 'gap')}: the capture does not hold every frame"
    if names and not _is_where_expected(c, names):
        yield "  named by ConnID and lengths; the addresses are not those of the IgH MainDevice"
    if not c.roles_certain and not names:
        yield "  main and sub are distinguished by their numbers; no start-up was seen"


def _is_where_expected(found: FoundConnection, names: ConnectionNames) -> bool:
    """Whether both ends are where the IgH MainDevice would place this connection."""
    expected = names.addresses[0] | names.addresses[1]
    return all(place.is_logical and place.address in expected for place in found.places[:2])


def _counts_text(d: DirectionSnapshot) -> str:
    text = (
        f"{counted(d.frames, 'frame')}: {d.right} right, {d.wrong} wrong, {d.unchecked} unchecked"
    )
    if d.interval_max_ns:
        low, mean, high = (
            n / 1e6 for n in (d.interval_min_ns, d.interval_mean_ns, d.interval_max_ns)
        )
        text += f"; every {low:.3f} … {mean:.3f} … {high:.3f} ms"
    if d.has_reset:
        text += f"; {counted(d.resets, 'reset')}, last {d.reset_code}: "
        text += reset_code_text(d.reset_code)
    return text


def _place_text(place: FoundPlace, swapped: bool) -> str:
    safe = safe_data_length(place.size_bytes)
    way = _ARROWS[place.direction ^ swapped]
    at = f"0x{place.address:08x}"
    if not place.is_logical:
        at = f"station 0x{place.address & 0xFFFF:04x} offset 0x{place.address >> 16:04x}"
    size = f"{place.size_bytes} bytes with {counted(safe, 'safe byte')}"
    return f"{way}  at {place.command} {at}, {size}"


def _none_text(counts: ScanCounts) -> str:
    if not counts.packets:
        return "the capture is empty"
    if not counts.ethercat:
        return (
            f"none of its {counted(counts.packets, 'packet')} is EtherCAT (0x88A4, or UDP "
            f"port 34980)"
        )
    if not counts.datagrams and counts.unanswered:
        return (
            f"all {counts.unanswered} process data datagrams have working counter 0: captured on "
            "the way out only, or no SubDevice was there"
        )
    return (
        f"{counted(counts.ethercat, 'EtherCAT frame')} with {counts.datagrams} answered "
        f"process data "
        "datagrams were looked at"
    )


class JsonOutput:
    """One document; frames are written as they arrive, so memory use is constant."""

    def __init__(self) -> None:
        self.wrong = 0
        self.unchecked = False
        self._sources = 0
        self._rows = 0
        self._damage: str | None = None
        self._lines = _Lines()
        self._parts = _Parts(self._constant)
        head = json.dumps({"tool": "fsoe-net", "version": __version__})
        echo(head[:-1] + ', "sources": [', nl=False)

    def begin(self, source: str) -> None:
        """Open the object of a source."""
        echo("," if self._sources else "")
        echo(f'{{"source": {json.dumps(source)}, "frames": [', nl=False)
        self._sources, self._rows, self._damage = self._sources + 1, 0, None

    def row(self, row: DecodedFrame) -> None:
        """Write one frame."""
        where = ""
        if row.time_ms is None:
            self.wrong += row.verdict is CrcVerdict.WRONG
        else:
            where = f'"packet": {row.packet}, "time_ms": {row.time_ms:.6f}, '
        note = f', "note": {json.dumps(row.note)}' if row.note else ""
        self._lines.add(
            f"{',' if self._rows else ''}\n{{{where}{self._parts.of(row)[0]}, "
            f'"crc": "{row.verdict}", "sequence": {row.sequence or "null"}, '
            f'"frame": "{row.frame.hex()}"{note}}}'
        )
        self._rows += 1

    @staticmethod
    def _constant(row: DecodedFrame, data: bytes) -> tuple[str, str]:
        """Return the members that do not change between frames; they are written last."""
        item: dict[str, object] = {
            "connection": row.names.name if row.names else None,
            "connection_number": row.number + 1,
            "connection_id": int.from_bytes(row.frame[-2:], "little"),
            "direction": str(row.direction),
            "command": command_text(row.frame[0]),
            "command_byte": row.frame[0],
            "safe_data": data.hex(),
            "state": row.state,
        }
        if row.frame[0] == Command.RESET:
            item["reset_code"] = data[0]
            item["reset_text"] = reset_code_text(data[0])
        if row.frame[0] == Command.PROCESS_DATA and row.names is not None:
            item["values"] = row.names.signal_values(row.direction, data)
        return json.dumps(item)[1:-1], ""

    def damaged(self, message: str) -> None:
        """Keep the message for the object of the source."""
        self.wrong += 1
        self._damage = message
        echo(f"error: {message}", err=True)

    def end_of_frames(self) -> None:
        """Close the list; for hex input, also the object."""
        self._lines.flush()
        echo("]", nl=False)
        self._open = True

    def found(self, connections: list[Found], counts: ScanCounts, facts: CaptureFacts) -> None:
        """Write the connections found in a capture."""
        rows = []
        for number, (c, names, swapped) in enumerate(connections, start=1):
            ways = (c.to_sub, c.to_main)[:: -1 if swapped else 1]
            rows.append(
                {
                    "number": number,
                    "connection": names.name if names else None,
                    "connection_id": c.connection_id,
                    "state": c.state,
                    "gaps": c.gaps,
                    "roles": "certain" if c.roles_certain else "by numbers",
                    "main_to_sub": _counts_json(ways[0]),
                    "sub_to_main": _counts_json(ways[1]),
                    "places": [
                        {
                            "command": p.command,
                            "address": p.address,
                            "direction": str(FrameDirection(p.direction ^ swapped)),
                            "size_bytes": p.size_bytes,
                        }
                        for p in c.places
                    ],
                }
            )
        tail: dict[str, object] = {
            "start_ns": max(facts.start_ns, 0),
            "damage": self._damage,
            "connections": rows,
            "packets": counts.packets,
            "ethercat_frames": counts.ethercat,
            "malformed_frames": counts.malformed,
            "process_data_datagrams": counts.datagrams,
            "unanswered_datagrams": counts.unanswered,
            "cut_packets": facts.cut,
            "packets_of_other_links": facts.other_links,
            "dropped_places": counts.dropped,
        }
        echo(", " + json.dumps(tail, indent=1)[1:], nl=False)
        self._open = False

    def end(self) -> None:
        """Close the document."""
        echo(("}" if self._open else "") + "]}")


def _counts_json(d: DirectionSnapshot) -> dict[str, object]:
    return {
        "frames": d.frames,
        "right": d.right,
        "wrong": d.wrong,
        "unchecked": d.unchecked,
        "resets": d.resets,
        "reset_code": d.reset_code if d.has_reset else None,
        "cycle_ms": {
            "min": d.interval_min_ns / 1e6,
            "mean": d.interval_mean_ns / 1e6,
            "max": d.interval_max_ns / 1e6,
        },
    }


Output = TextOutput | JsonOutput
