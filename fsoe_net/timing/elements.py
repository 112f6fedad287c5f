"""Parts of a safety function with their times and PFH: as stated, or else from the library."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import SubDevice
from fsoe_net.model.library import Library, LibraryDevice
from fsoe_net.model.resolve import Connection, Resolution
from fsoe_net.model.safety import ElementKind, SafetyElement, SafetyFunction, level_words
from fsoe_net.model.written import holds_a_place

# Placeholders, anywhere in a text: "tbd by the maker", "manual 3.0?", "to be checked".
_OPEN = re.compile(
    r"\?|\b(?:tb[acd]|todo|fixme|guess\w*|na|unknown|unclear|unverified|placeholder|pending"
    r"|x{3,}|no (?:source|idea)"
    r"|to be (?:\w+ )?(?:added|agreed|announced|asked|checked|clarified|confirmed|defined"
    r"|determined|done|looked|measured|provided|read|stated|verified)"
    r"|not (?:\w+ )?(?:applicable|available|checked|clear|confirmed|defined|known|stated"
    r"|verified))\b"
)
# Sources without a reference to look up: "my own estimate", "as assumed".
_NO_SOURCE = re.compile(
    r"approx\w*|assum\w*|author|best|conservative|custom\w*|dummy|engineering|estimat\w*|experience|figure"
    r"|good|judg\w*|later|me|missing|myself|no|none|nothing|open|own|rough|rule|safe|self|source"
    r"|standard|thumb|typical|usual|value|worst|yet|zero"
    r"|an?|and|are|as|at|be|by|case|for|from|i|is|it|just|my|not|of|on|only|or|our|still|that|the"
    r"|this|to|very|we"
)


def names_a_source(text: str) -> bool:
    """Whether the source of a figure, or a reason, can be looked up.

    Case, punctuation and other words around a placeholder do not count; digits alone are not a
    source either. This is not proof: people must check that the source supports it.
    """
    plain = _plain(text)
    if _OPEN.search(plain):
        return False
    words = re.findall(r"[^\W_]+", plain)
    said = "".join(w for w in words if not _NO_SOURCE.fullmatch(w))
    return sum(map(str.isalpha, said)) >= 2 and not holds_a_place(said)


def names_a_revision(text: str) -> bool:
    """Whether a manual is named; a revision alone is sufficient: ``3.0`` is one, ``0`` is not."""
    return _OPEN.search(_plain(text)) is None and not holds_a_place(text)


def _plain(text: str) -> str:
    """Return a text in a normalised spelling: ``T.B.D.`` is ``tbd``, ``n/a`` is ``na``."""
    folded = unicodedata.normalize("NFKC", text).casefold()
    return re.sub(r"\b([^\W\d_])[ ./\-]+(?=[^\W\d_]\b)", r"\1", folded)


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A number with its unit and source.

    Attributes:
        value: The value; ``None`` if not stated.
        unit: ``ms`` or ``1/h``.
        source: Source in words; empty if not stated.
        answered_for: Whether it is supported: the network file states it with a source, or names
            the manual that confirms the value of the library. This is its only meaning.
        needs_reason: Whether it is 0 without a stated reason; then it is not supported either.
    """

    value: float | None
    unit: str
    source: str = ""
    answered_for: bool = False
    needs_reason: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ElementRow:
    """One element with its known facts."""

    element: SafetyElement
    time: Quantity
    pfh: Quantity

    @property
    def claim(self) -> str:
        """PL and SIL claimed by its source, in words; empty if it states none."""
        return ", ".join(level_words(self.element))

    @property
    def has_no_claim(self) -> bool:
        """Whether a level is missing; not needed if the element never fails for a stated reason."""
        is_never = self.pfh.value == 0 and not self.pfh.needs_reason
        return not self.claim and not is_never

    @property
    def claim_answered_for(self) -> bool:
        """Whether its level, category and mission time are supported."""
        return _is_sourced(self.element)


@dataclass(frozen=True, slots=True, kw_only=True)
class Apart:
    """A SubDevice of a safety function without an FSoE connection to its logic.

    Attributes:
        end: Name of the SubDevice with the input or output.
        logic: Names of the SubDevices with the logic; never empty.
    """

    end: str
    logic: tuple[str, ...]

    @property
    def words(self) -> str:
        """The description for people."""
        return f"no FSoE connection joins {self.end} and {' or '.join(self.logic)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionParts:
    """Elements with times, and the connections between input, logic and output.

    Attributes:
        rows: In the order of the function.
        to_input: Connections between inputs and logic; empty if they are one SubDevice.
        to_output: Connections between logic and outputs.
        unstated: Missing data that are required to calculate times, in words.
        apart: SubDevices not connected to the logic; then the time is also missing.
        unverified: Elements with an unsupported time or PFH, in words.
    """

    rows: tuple[ElementRow, ...]
    to_input: tuple[Connection, ...]
    to_output: tuple[Connection, ...]
    unstated: tuple[str, ...]
    apart: tuple[Apart, ...]
    unverified: tuple[str, ...]

    def slowest(self, kind: ElementKind, device: str = "") -> float:
        """Return the longest time of a kind, ms; 0 if it is missing.

        Args:
            kind: Kind of the elements, which work in parallel.
            device: Only elements of this SubDevice, and those that name none.
        """
        rows = (r for r in self.rows if r.element.kind is kind)
        # Elements of another SubDevice work on another path at the same time.
        if device:
            rows = (r for r in rows if r.element.sub in ("", device))
        return max((r.time.value or 0.0 for r in rows), default=0.0)

    @property
    def logic(self) -> tuple[str, ...]:
        """SubDevices with the logic, by name."""
        return tuple(r.element.sub for r in self.rows if r.element.kind is ElementKind.LOGIC)

    def local(self, kind: ElementKind) -> tuple[str, ...]:
        """Return SubDevices that have inputs or outputs and the logic, by name."""
        subs = (r.element.sub for r in self.rows if r.element.kind is kind)
        return tuple(dict.fromkeys(sub for sub in subs if sub and sub in self.logic))


def parts_of(function: SafetyFunction, resolution: Resolution, library: Library) -> FunctionParts:
    """Look up the elements of a safety function.

    Args:
        function: The function in the network file.
        resolution: The network.
        library: Library for times and PFH that the network does not state.
    """
    subs = {s.name: s for s in resolution.network.subdevices}
    rows = tuple(_row(e, subs, library) for e in function.elements)
    logic = _named(function, ElementKind.LOGIC, subs)
    to_input = _between(_named(function, ElementKind.INPUT, subs), logic, resolution)
    to_output = _between(_named(function, ElementKind.OUTPUT, subs), logic, resolution)
    ends = {**to_input, **to_output}
    unstated = [*_unstated(rows, subs), *_several_logics(to_input, to_output, logic)]
    # Ends that name SubDevices need a logic that names one: otherwise the path over the bus is
    # unknown.
    if ends and not logic and any(r.element.kind is ElementKind.LOGIC for r in rows):
        unstated.append("the logic names no SubDevice; write sub: with its name")
    return FunctionParts(
        rows=rows,
        to_input=tuple(c for there in to_input.values() for c in there),
        to_output=tuple(c for there in to_output.values() for c in there),
        unstated=tuple(unstated),
        # An end without a connection to the logic: its signal never arrives.
        apart=tuple(
            Apart(end=end, logic=tuple(logic))
            for end, there in ends.items()
            if logic and not there and end not in logic
        ),
        unverified=_unverified(rows),
    )


def _unstated(rows: Sequence[ElementRow], subs: Mapping[str, SubDevice]) -> list[str]:
    """Return kinds without an element, elements without a time, and names without a SubDevice."""
    kinds = {r.element.kind for r in rows}
    return [
        *(
            f"no {kind.value} is stated; write time_ms: 0 and zero_because: for what takes no time"
            for kind in ElementKind
            if kind not in kinds
        ),
        *(
            f"the time of {r.element.kind.value} {r.element.name} is not stated"
            for r in rows
            if r.time.value is None
        ),
        *(
            f"{r.element.sub} is not a SubDevice of this network"
            for r in rows
            if r.element.sub and r.element.sub not in subs
        ),
    ]


def _unverified(rows: Sequence[ElementRow]) -> tuple[str, ...]:
    return tuple(
        dict.fromkeys(
            r.element.name
            for r in rows
            for q in (r.time, r.pfh)
            if q.value is not None and not q.answered_for
        )
    )


def _named(function: SafetyFunction, kind: ElementKind, subs: dict[str, SubDevice]) -> list[str]:
    names = [e.sub for e in function.elements if e.kind is kind and e.sub in subs]
    return list(dict.fromkeys(names))


_Joined = dict[str, tuple[Connection, ...]]  # SubDevices, each with its connections to the logic


def _between(ends: Sequence[str], logic: Sequence[str], resolution: Resolution) -> _Joined:
    return {
        end: tuple(
            c
            for c in resolution.connections
            if end not in logic and end in _ends(c) and any(name in _ends(c) for name in logic)
        )
        for end in ends
    }


def _ends(connection: Connection) -> tuple[str, str]:
    return connection.main.name, connection.sub.name


def _several_logics(there: _Joined, back: _Joined, logic: Sequence[str]) -> list[str]:
    """Return an input and an output without a common logic: that path has more connections."""

    def logics(joined: _Joined) -> list[tuple[str, set[str]]]:
        found = [(end, {end, *(n for c in cs for n in _ends(c))}) for end, cs in joined.items()]
        return [(end, names.intersection(logic)) for end, names in found]

    return [
        f"{one} and {other} have different logics; a way through several logics is not worked out"
        for one, first in logics(there)
        for other, second in logics(back)
        # Both ends have a logic, but not the same one: the signal passes between logics.
        if first and second and not first & second
    ][:1]


def _row(element: SafetyElement, subs: dict[str, SubDevice], library: Library) -> ElementRow:
    sub = subs.get(element.sub)
    device = None
    if sub is not None and sub.device is not None:
        device = library.find(*sub.device.identity)
    return ElementRow(
        element=element,
        time=_quantity(element, element.time_ms, "ms", device, f"{element.kind.value}_ms"),
        pfh=_quantity(element, element.pfh_per_hour, "1/h", device, "pfh_per_hour"),
    )


def _is_sourced(element: SafetyElement) -> bool:
    """Whether stated values have a source; the manual counts if no source is named."""
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
        # Zero is the most dangerous assumption, so it needs a reason.
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
    # Values of the library count as verified only with the manual of this device.
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
