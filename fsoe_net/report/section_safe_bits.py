"""The safe bits and FSoE frames that carry a safety function."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fsoe_net.document.model import (
    Cell,
    Column,
    Heading,
    Level,
    Part,
    Table,
    Verdict,
    cell,
    muted,
    stated,
    strong,
)
from fsoe_net.model.resolve import Connection
from fsoe_net.model.safe_bits import ElementFrame, element_frames, frame_of, frame_place
from fsoe_net.model.safety import ElementKind, SafeBit, SafetyElement, SafetyFunction

_STATED = "network file"
_DERIVED = "derived: docs/explanation/fsoe-engine.md, §1"


def safe_bits(function: SafetyFunction, connections: Sequence[Connection]) -> list[Part]:
    """Return a row for each safe bit of a function, and for each input and output without any.

    A function without inputs and outputs has no table.

    Args:
        function: The function in the network file.
        connections: Connections of the network.
    """
    ends = [e for e in function.elements if e.kind in (ElementKind.INPUT, ElementKind.OUTPUT)]
    if not ends:
        return []
    table = Table(
        name=f"safe data bits of {function.name}",
        columns=(
            Column("Signal"),
            Column("Element"),
            Column("Connection"),
            Column("Safe bit", number=True),
            Column("Frame byte", number=True),
            Column("Bit in it", number=True),
            Column("PDO entry"),
        ),
        rows=tuple(r for e in ends for r in _rows(e, element_frames(e, function, connections))),
        remark="Safe bits count in the safe data of the frame, frame bytes from the command; both "
        "start at 0. A CRC follows every second byte of safe data.",
    )
    return [Heading("Safe bits"), table]


def _rows(e: SafetyElement, frames: Sequence[ElementFrame]) -> Iterator[tuple[Cell, ...]]:
    element = cell(e.kind.value, strong(e.name))
    if e.bits:
        for bit in e.bits:
            yield (cell(strong(bit.name)), element, *_place(bit, frame_of(bit, frames)))
    # The frame exists but its bit is not stated: a person must determine it.
    elif frames:
        between = tuple(item for f in frames for item in _between(f))
        yield (cell(Verdict("not stated", Level.OPEN)), element, between, (), (), (), ())
    else:
        yield (cell(muted("no FSoE frame")), element, (), (), (), (), ())


def _between(frame: ElementFrame) -> Cell:
    transfer = frame.transfer.transfer
    way = f"{transfer.source.module} → {transfer.destination.module}"
    return cell(frame.connection.name, muted(way))


def _place(bit: SafeBit, frame: ElementFrame | None) -> tuple[Cell, ...]:
    number = cell(stated(bit.bit, "", _STATED))
    # The bit is outside of the safe data of the frame: a typing error, or another device.
    if frame is None or frame.safe_bits is None or bit.bit >= frame.safe_bits:
        between = () if frame is None else _between(frame)
        return between, number, cell(Verdict("in no frame", Level.ERROR)), (), ()
    byte, inside = frame_place(bit.bit)
    entry = frame.entry_of(bit.bit)
    named = cell(muted("padding")) if entry is None else cell(entry.address, muted(entry.label))
    place = (cell(stated(n, "", _DERIVED)) for n in (byte, inside))
    return (_between(frame), number, *place, named)
