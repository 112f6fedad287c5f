"""The FSoE frames that carry the safe bits of a safety function."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.fsoe.pdu import is_frame_length, safe_byte_offset, safe_data_length
from fsoe_net.model.resolve import Connection, Resolution
from fsoe_net.model.safety import ElementKind, SafeBit, SafetyElement, SafetyFunction
from fsoe_net.model.signals import Signal, signals_of
from fsoe_net.model.transfer_ends import ResolvedEnd, ResolvedTransfer


@dataclass(frozen=True, slots=True, kw_only=True)
class ElementFrame:
    """An FSoE frame that the SubDevice of an element exchanges with the logic.

    Attributes:
        connection: Its connection.
        transfer: Its transfer: for an input, of the frame that its SubDevice sends; for an output,
            of the frame that it receives.
        end: The end of the transfer at that SubDevice.
        slot: Frame pair of that SubDevice; ``None`` if unknown.
    """

    connection: Connection
    transfer: ResolvedTransfer
    end: ResolvedEnd
    slot: int | None

    @property
    def safe_bits(self) -> int | None:
        """Number of bits of safe data in the frame; ``None`` if its length is invalid."""
        size_bytes = self.transfer.transfer.size_bytes
        return 8 * safe_data_length(size_bytes) if is_frame_length(size_bytes) else None

    def entry_of(self, bit: int) -> Signal | None:
        """Return the PDO entry of its SubDevice with this safe bit; ``None`` for padding."""
        if self.end.sm is None:
            return None
        size_bytes = self.transfer.transfer.size_bytes
        signals = signals_of("", self.end.sm, self.end.byte_offset, size_bytes).values()
        return next((s for s in signals if s.bit <= bit < s.bit + s.bits), None)


def element_frames(
    element: SafetyElement, function: SafetyFunction, connections: Sequence[Connection]
) -> tuple[ElementFrame, ...]:
    """Return the FSoE frames that carry the signal of an element to or from the logic.

    Args:
        element: The element; only an input and an output with a SubDevice have frames.
        function: The function that it belongs to. If its logic names SubDevices, only connections
            with these count; an element in the logic itself has no frame.
        connections: Connections of the network.
    """
    if element.kind not in (ElementKind.INPUT, ElementKind.OUTPUT) or not element.sub:
        return ()
    logic = {e.sub for e in function.elements if e.kind is ElementKind.LOGIC and e.sub}
    # Within the logic, the signal does not cross the bus.
    if element.sub in logic:
        return ()
    found = []
    for c in connections:
        ends = {c.main.name, c.sub.name}
        if element.sub in ends and (not logic or not logic.isdisjoint(ends)):
            found.append(_frame(element, c))
    return tuple(found)


def _frame(element: SafetyElement, c: Connection) -> ElementFrame:
    at_sub = element.sub == c.sub.name
    if element.kind is ElementKind.INPUT:
        transfer = c.to_main if at_sub else c.to_sub
        end = transfer.source
    else:
        transfer = c.to_sub if at_sub else c.to_main
        end = transfer.destination
    slot = c.sub_slot if at_sub else c.slot
    return ElementFrame(connection=c, transfer=transfer, end=end, slot=slot)


def frame_of(bit: SafeBit, frames: Sequence[ElementFrame]) -> ElementFrame | None:
    """Return the frame of an element that contains this bit, or ``None`` if it is not unique."""
    fitting = [f for f in frames if bit.slot is None or f.slot == bit.slot]
    return fitting[0] if len(fitting) == 1 else None


def frame_place(bit: int) -> tuple[int, int]:
    """Return the byte of an FSoE frame and the bit in it, both from 0, of a safe bit."""
    byte, inside = divmod(bit, 8)
    return safe_byte_offset(byte), inside


def bit_words(element: SafetyElement) -> list[str]:
    """Return the safe bits of an element in words: ``K1 is bit 0 of the frame to io``."""
    return [f"{b.name} is bit {b.bit} of {frame_words(element, b)}" for b in element.bits]


def frame_words(element: SafetyElement, bit: SafeBit) -> str:
    """Return the frame that contains a safe bit of an element, in words: ``the frame to io``."""
    slot = "" if bit.slot is None else f" of slot {bit.slot}"
    way = "from" if element.kind is ElementKind.INPUT else "to"
    return f"the frame{slot} {way} {element.sub}"


def bit_names(resolution: Resolution) -> dict[str, str]:
    """Return the names that safety functions give to entries of safe data, by `Signal.name`."""
    found: dict[str, str] = {}
    for function in resolution.network.safety_functions:
        for element in function.elements:
            frames = element_frames(element, function, resolution.connections)
            for bit in element.bits:
                frame = frame_of(bit, frames)
                entry = None if frame is None else frame.entry_of(bit.bit)
                if entry is not None and entry.bits == 1:
                    found.setdefault(f"{element.sub}{entry.name}", bit.name)
    return found
