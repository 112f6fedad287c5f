"""Parts of a safety function with their times and PFH: as stated, else as the library has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fsoe_net.model.bus import SubDevice
from fsoe_net.model.library import Library, LibraryDevice
from fsoe_net.model.resolve import Connection, Resolution
from fsoe_net.model.safety import ElementKind, SafetyElement, SafetyFunction, level_words
from fsoe_net.timing.sources import names_a_revision, names_a_source

__all__ = ["Apart", "ElementRow", "FunctionParts", "Quantity", "parts_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A number with its unit and where it comes from.

    Attributes:
        value: ``None``: not stated.
        unit: ``ms`` or ``1/h``.
        source: In words; empty when nobody says.
        answered_for: Whether somebody answers for it: the network file states it with a source, or
            names the manual that confirms the value of the library. It claims no more than that.
        needs_reason: Whether it is 0 and nobody says why; then nobody answers for it either.
    """

    value: float | None
    unit: str
    source: str = ""
    answered_for: bool = False
    needs_reason: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ElementRow:
    """One element with what is known about it."""

    element: SafetyElement
    time: Quantity
    pfh: Quantity

    @property
    def claim(self) -> str:
        """PL and SIL that its source claims, in words; empty when it states none."""
        return ", ".join(level_words(self.element))

    @property
    def has_no_claim(self) -> bool:
        """Whether a level is missing; what fails never, for a stated reason, needs none."""
        is_never = self.pfh.value == 0 and not self.pfh.needs_reason
        return not self.claim and not is_never

    @property
    def claim_answered_for(self) -> bool:
        """Whether somebody answers for its level, category and mission time."""
        return _is_sourced(self.element)


@dataclass(frozen=True, slots=True, kw_only=True)
class Apart:
    """A SubDevice of a safety function that no FSoE connection joins to its logic.

    Attributes:
        end: Name of the SubDevice with the input or output.
        logic: Names of the SubDevices with the logic; never empty.
    """

    end: str
    logic: tuple[str, ...]

    @property
    def words(self) -> str:
        """The same for people."""
        return f"no FSoE connection joins {self.end} and {' or '.join(self.logic)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionParts:
    """Elements with times, and the connections between input, logic and output.

    Several elements of one kind work in parallel: the slowest one counts.

    Attributes:
        rows: In the order of the function.
        to_input: Connections between inputs and logic; empty when they are one SubDevice.
        to_output: Connections between logic and outputs.
        unstated: What has to be stated before times can be worked out, in words.
        apart: SubDevices that are not joined to the logic; there is no time then either.
        unverified: Elements with a time or PFH that nobody answers for, in words.
    """

    rows: tuple[ElementRow, ...]
    to_input: tuple[Connection, ...]
    to_output: tuple[Connection, ...]
    unstated: tuple[str, ...]
    apart: tuple[Apart, ...]
    unverified: tuple[str, ...]

    def slowest(self, kind: ElementKind) -> float:
        """Return the longest time of a kind, ms; 0 while it is missing."""
        return max((r.time.value or 0.0 for r in self.rows if r.element.kind is kind), default=0.0)

    @property
    def sensor(self) -> float:
        """T_S, ms."""
        return self.slowest(ElementKind.SENSOR)

    @property
    def input(self) -> float:
        """T_I, ms."""
        return self.slowest(ElementKind.INPUT)

    @property
    def logic(self) -> float:
        """T_L, ms."""
        return self.slowest(ElementKind.LOGIC)

    @property
    def output(self) -> float:
        """T_O, ms."""
        return self.slowest(ElementKind.OUTPUT)

    @property
    def actuator(self) -> float:
        """T_A, ms."""
        return self.slowest(ElementKind.ACTUATOR)


def parts_of(function: SafetyFunction, resolution: Resolution, library: Library) -> FunctionParts:
    """Look up the elements of a safety function.

    Args:
        function: As the network file states it.
        resolution: The network.
        library: Where the network states no time or PFH.
    """
    subs = {s.name: s for s in resolution.network.subdevices}
    rows = tuple(_row(e, subs, library) for e in function.elements)
    unstated = [
        f"no {kind.value} is stated; write time_ms: 0 and zero_because: for what takes no time"
        for kind in ElementKind
        if all(e.kind is not kind for e in function.elements)
    ]
    unstated += [
        f"the time of {r.element.kind.value} {r.element.name} is not stated"
        for r in rows
        if r.time.value is None
    ]
    logic = _named(function, ElementKind.LOGIC, subs)
    to_input, apart_in = _between(_named(function, ElementKind.INPUT, subs), logic, resolution)
    to_output, apart_out = _between(_named(function, ElementKind.OUTPUT, subs), logic, resolution)
    return FunctionParts(
        rows=rows,
        to_input=to_input,
        to_output=to_output,
        unstated=tuple(unstated),
        apart=(*apart_in, *apart_out),
        unverified=tuple(
            dict.fromkeys(
                r.element.name
                for r in rows
                for q in (r.time, r.pfh)
                if q.value is not None and not q.answered_for
            )
        ),
    )


def _named(function: SafetyFunction, kind: ElementKind, subs: dict[str, SubDevice]) -> list[str]:
    names = [e.sub for e in function.elements if e.kind is kind and e.sub in subs]
    return list(dict.fromkeys(names))


def _between(
    ends: Sequence[str], logic: Sequence[str], resolution: Resolution
) -> tuple[tuple[Connection, ...], list[Apart]]:
    """Return the connections between SubDevices and the logic, and the ends that have none."""
    found: list[Connection] = []
    apart: list[Apart] = []
    for end in ends:
        if end in logic:
            continue
        there = [
            c
            for c in resolution.connections
            if end in (c.main.name, c.sub.name)
            and any(name in (c.main.name, c.sub.name) for name in logic)
        ]
        found += there
        if logic and not there:
            apart.append(Apart(end=end, logic=tuple(logic)))
    return tuple(found), apart


def _row(element: SafetyElement, subs: dict[str, SubDevice], library: Library) -> ElementRow:
    sub = subs.get(element.sub)
    device = None
    if sub is not None and sub.device is not None:
        device = library.find(sub.device.vendor_id, sub.device.product_code)
    return ElementRow(
        element=element,
        time=_quantity(element, element.time_ms, "ms", device, f"{element.kind.value}_ms"),
        pfh=_quantity(element, element.pfh_per_hour, "1/h", device, "pfh_per_hour"),
    )


def _is_sourced(element: SafetyElement) -> bool:
    """Whether what an element states has a source; a manual speaks where no source is named."""
    if element.source.strip():
        return names_a_source(element.source)
    return names_a_revision(element.manual)


def _quantity(
    element: SafetyElement,
    stated: float | None,
    unit: str,
    device: LibraryDevice | None,
    figure: str,
) -> Quantity:
    if stated is not None:
        is_zero, because = stated == 0, element.zero_because
        needs_reason = is_zero and not names_a_source(because)
        words = [
            element.source,
            f"manual {element.manual}" if element.manual else "",
            f"0 because {because}" if is_zero and because else "",
        ]
        return Quantity(
            value=stated,
            unit=unit,
            source=", ".join(w for w in words if w),
            answered_for=_is_sourced(element) and not needs_reason,
            needs_reason=needs_reason,
        )
    for known in () if device is None else device.figures:
        if known.name == figure and device is not None:
            source = f"device library: {device.sources.get(known.source, known.source)}"
            if element.manual:
                source += f"; confirmed by manual {element.manual}"
            return Quantity(
                value=known.value,
                unit=unit,
                source=source,
                answered_for=names_a_revision(element.manual),
            )
    return Quantity(value=None, unit=unit)
