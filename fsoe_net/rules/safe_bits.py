"""FSN615 and FSN616: the safe bits named by safety functions."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import FindingList, Related
from fsoe_net.model.safe_bits import ElementFrame, element_frames, frame_of, frame_words
from fsoe_net.model.safety import ElementKind, SafeBit, SafetyElement, SafetyFunction
from fsoe_net.timing.budget import Budget

_ENDS = (ElementKind.INPUT, ElementKind.OUTPUT)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Placed:
    """A safe bit in its frame."""

    function: SafetyFunction
    element: SafetyElement
    bit: SafeBit
    frame: ElementFrame


def check_safe_bits(out: FindingList, budget: Budget, left_out: Collection[str]) -> None:
    """Report safe bits that are not in a frame, and contradictory names.

    Args:
        out: Takes FSN615 and FSN616.
        budget: Budget with all functions and connections of the network.
        left_out: Names of functions with an element that is not in the network.
    """
    connections = [row.connection for row in budget.connections]
    placed: list[_Placed] = []
    for function in (row.function for row in budget.functions):
        # A misspelt SubDevice would make each of its bits a finding.
        if function.name in left_out:
            continue
        for element in function.elements:
            frames = element_frames(element, function, connections)
            placed += _element(out, function, element, frames)
    _contradictions(out, placed)


def _element(
    out: FindingList,
    function: SafetyFunction,
    element: SafetyElement,
    frames: Sequence[ElementFrame],
) -> Iterator[_Placed]:
    if element.bits and not frames:
        words, hint = _no_frame(function, element)
        out.add("FSN615", element.at("bits"), f"{function.name}: {words}", hint=hint)
        return
    for bit in element.bits:
        frame = frame_of(bit, frames)
        name = f"{function.name}: safe bit {bit.name}"
        if frame is None:
            slots = ", ".join("unknown" if f.slot is None else str(f.slot) for f in frames)
            at = "one of several slots" if bit.slot is None else f"slot {bit.slot}"
            words = f"{name} is at {at} of {element.sub}; slots with a connection to the logic: "
            out.add(
                "FSN615",
                bit.at("slot"),
                words + slots,
                hint="write slot: with the FSoE frame pair of the SubDevice that has the bit",
            )
        elif frame.safe_bits is not None and bit.bit >= frame.safe_bits:
            out.add(
                "FSN615",
                bit.at("bit"),
                f"{name}: bit {bit.bit} is outside the {frame.safe_bits} bits of safe data of "
                f"{frame.connection.name}",
                hint="count in the safe data alone, from 0; command, CRCs and connection ID do not "
                "count",
            )
        else:
            yield _Placed(function=function, element=element, bit=bit, frame=frame)


def _no_frame(function: SafetyFunction, element: SafetyElement) -> tuple[str, str]:
    """Return why an element has no frame, and the next step."""
    if element.kind not in _ENDS or not element.sub:
        return (
            f"{element.kind.value} {element.name} has safe bits, and no FSoE frame",
            "state safe bits at an input or output that names its SubDevice with sub:",
        )
    # Within the logic no frame carries the signal.
    if any(e.kind is ElementKind.LOGIC and e.sub == element.sub for e in function.elements):
        return (
            f"{element.sub} is the safety logic: no FSoE frame carries its safe bits",
            "remove bits: of this element",
        )
    return (
        f"no FSoE connection carries the safe bits of {element.sub}",
        "state its connection to the logic",
    )


def _contradictions(out: FindingList, placed: Iterable[_Placed]) -> None:
    """Report a bit with two names in an element or a frame, and a name with two bits."""
    by_bit: dict[tuple[int, int], _Placed] = {}
    by_name: dict[tuple[int, str], _Placed] = {}
    for row in placed:
        number, bit = row.frame.transfer.number, row.bit
        frame = frame_words(row.element, bit)
        # One bit has one name in a frame, whatever function uses it.
        first = by_bit.setdefault((number, bit.bit), row)
        if first.bit.name != bit.name:
            words = f"bit {bit.bit} of {frame} has two names, {first.bit.name} and {bit.name}"
            _contradiction(out, row, first, words)
        elif first is not row and first.element is row.element:
            _contradiction(out, row, first, f"bit {bit.bit} of {frame} is stated twice")
        # The reverse: one name has one bit.
        first = by_name.setdefault((number, bit.name), row)
        if first.bit.bit != bit.bit:
            words = f"{bit.name} is both bit {first.bit.bit} and bit {bit.bit} of {frame}"
            _contradiction(out, row, first, words)


def _contradiction(out: FindingList, row: _Placed, first: _Placed, words: str) -> None:
    out.add(
        "FSN616",
        row.bit.span,
        f"{row.function.name}: {words}",
        hint="give each safe bit of a frame one name of its own, as in the safety project",
        related=(Related(span=first.bit.span, message=f"the first one, in {first.function.name}"),),
    )
