"""Creates a proposal from gathered data and answers, again after each answer."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from fsoe_net.diag.diagnostic import Diagnostic, Severity, Span
from fsoe_net.errors import InputError
from fsoe_net.formats.own.library import load_library
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.write_files import write_all
from fsoe_net.formats.shared.writers import Written
from fsoe_net.model.answers import Answers, Ask, Question
from fsoe_net.model.bus import SubDevice
from fsoe_net.model.described_network import describe
from fsoe_net.model.description import DescribedSubDevice, Description
from fsoe_net.model.joined_descriptions import fill_devices, has_layout, idle_types, join_buses
from fsoe_net.model.library import Library
from fsoe_net.model.names import numbered
from fsoe_net.model.network import NetworkConfig
from fsoe_net.proposal.gather import Gathered
from fsoe_net.proposal.proposal import Proposal, propose
from fsoe_net.proposal.ring import DeviceType, list_types, ring_of
from fsoe_net.proposal.safety_project import match_project

_MOST_IDLE = 4
_VALUES = {
    "address": "FSoE address",
    "connection_id": "connection ID",
    "watchdog_ms": "FSoE watchdog",
}
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """A proposal, or the reasons why there is none yet.

    Attributes:
        proposal: ``None`` while the content of the ring is unknown.
        name: Name of the network.
        questions: Open questions in order.
        findings: Invalid answers.
        notes: Assumptions and omissions.
        inputs: Its input files.
    """

    inputs: Inputs
    proposal: Proposal | None
    name: str
    questions: tuple[Question, ...]
    findings: tuple[Diagnostic, ...]
    notes: tuple[str, ...] = ()

    @property
    def open(self) -> tuple[str, ...]:
        """Remaining tasks for a person, in words."""
        if self.proposal is None:
            return ()
        bus = self.proposal.bus
        found = list(self.proposal.open)
        for key, what in _VALUES.items():
            subs = [
                bus.subdevices[c.sub].name
                for c in bus.connections
                if c.sub is not None and getattr(c, key) is None
            ]
            if subs:
                found.append(f"{what} not given: {', '.join(dict.fromkeys(subs))}")
        if bus.cycle_us is None:
            found.append("bus cycle not given: cycle_us")
        return tuple(found)

    def files(self) -> Written:
        """Return the commented files of the network, ``network.yaml`` first.

        Raises:
            InputError: The content of the ring is still unknown.
        """
        from fsoe_net.proposal.draft_text import draft_files

        return draft_files(self)

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the files, all or none.

        Raises:
            InputError: As in `files`; or a file exists and must not be replaced.
            EnvironmentFault: A file cannot be written; the existing content is unchanged.
        """
        files = {name: text.encode("utf-8") for name, text in self.files().files.items()}
        write_all(folder, files, overwrite=overwrite)


@dataclass(slots=True)
class Inputs:
    """The gathered data, the device library, and the rings built so far."""

    found: Gathered
    library: Library
    types: list[DeviceType]
    _rings: dict[object, tuple[Description | None, Collector, list[str]]] = field(
        default_factory=dict
    )

    @classmethod
    def of(cls, found: Gathered) -> Inputs:
        """Return the inputs with the library of the package."""
        library, _ = load_library()
        ring_known = bool(found.buses)
        types = [] if ring_known else list_types(found.esis, found.types, library, found.out)
        errors = [d for d in found.out.diagnostics if d.level is Severity.ERROR]
        if errors:
            raise InputError("nothing written", errors)
        return cls(found, library, types)

    def ring(self, answers: Answers) -> tuple[Description | None, Collector, list[str]]:
        """Return the bus with process data, findings and notes; files are read once."""
        key = answers.subdevices
        if key not in self._rings:
            out, notes = Collector(), list(self.found.notes)
            bus = join_buses(self.found.buses, notes) if self.found.buses else None
            if bus is None:
                bus = ring_of(answers.subdevices, self.types, out)
            if bus is not None:
                bus = self._with_process_data(bus, out, notes)
            self._rings[key] = (bus, out, notes)
        return self._rings[key]

    def _with_process_data(self, bus: Description, out: Collector, notes: list[str]) -> Description:
        from fsoe_net.formats.esi.wanted import load_devices

        # Without a bus, types are only candidates.
        types = list(self.found.types) if self.found.buses else []
        for path in self.found.esis if self.found.buses else ():
            made = load_devices(path, [s for s in bus.subdevices if not has_layout(s.device)], out)
            if made is not None:
                types.append(made)
        filled = fill_devices(bus, types, notes)
        idle = idle_types(bus, types)
        # A folder of ESI files has hundreds of types; a number is sufficient.
        if len(idle) >= _MOST_IDLE:
            idle = [f"{len(idle)} device types that no SubDevice has are left out"]
        notes += idle
        return _with_part(filled, self.found.part, notes)


def make_draft(inputs: Inputs, answers: Answers) -> Draft:
    """Propose a network from the data and answers so far."""
    bus, out, notes = inputs.ring(answers)
    findings = list(out.diagnostics)
    name = answers.name or inputs.found.name or "network"
    # The bus in a file is a fact, which an answer could only contradict.
    if inputs.found.buses and answers.subdevices:
        where = inputs.found.buses[0].path
        findings.append(
            Diagnostic(
                code="FSN156",
                span=answers.at("subdevices"),
                message=f"{where} states what is on the ring",
                hint="delete subdevices: from the answers, or leave that file out",
            )
        )
    # Without a ring no proposal is possible, so the ring is asked for first.
    if bus is None:
        question = () if answers.subdevices else (_ask_ring(inputs),)
        return Draft(
            inputs=inputs,
            proposal=None,
            name=name,
            questions=question,
            findings=tuple(findings),
            notes=(),
        )
    bus = replace(bus, cycle_us=answers.cycle_us or bus.cycle_us)
    # Names are given before projects are matched, as they refer to names.
    names = _names(bus.subdevices)
    hints: list[tuple[frozenset[int], str]] = []
    connections = list(bus.connections)
    for project in inputs.found.projects:
        matched = match_project(bus.subdevices, project, inputs.library, bus.connections)
        connections += matched.connections
        hints += matched.hints
        notes = [*notes, *(f"{text}: no SubDevice fits" for text in matched.lost)]
    subs = tuple(replace(s, name=n) for s, n in zip(bus.subdevices, names, strict=True))
    proposal = propose(
        replace(bus, subdevices=subs, connections=tuple(connections)),
        names,
        inputs.library,
        answers,
        hints,
    )
    return Draft(
        inputs=inputs,
        proposal=proposal,
        name=name,
        questions=proposal.questions,
        findings=(*findings, *proposal.findings),
        notes=(*notes, *(f"{s.name}: {n}" for s in subs for n in s.notes)),
    )


def question_findings(made: Draft, *, answered: bool) -> list[Diagnostic]:
    """Return FSN157 for each open question; an error if nothing can be written without it.

    Args:
        made: The draft, with its questions.
        answered: Whether answers were given, or the rest may stay open.
    """
    more = "" if answered else "; --no-input leaves it open"
    return [
        Diagnostic(
            code="FSN157",
            span=q.span,
            message=f"{q.text} One of: {', '.join(w for w, _ in q.choices)}"
            if q.choices
            else q.text,
            severity=Severity.ERROR
            if q.ask is Ask.SUBDEVICES or not answered
            else Severity.WARNING,
            hint=f"{q.ask.value}: in a file for --answers; --answers-template writes one"
            + ("" if q.ask is Ask.SUBDEVICES else more),
        )
        for q in made.questions
    ]


def _ask_ring(inputs: Inputs) -> Question:
    files = [t for t in inputs.types if not t.is_of_library]
    orders = list(dict.fromkeys(t.order for t in files))
    facts = ["No file states what is on the ring; an ESI or SII image only describes types."]
    if orders:
        more = f" and {len(orders) - 30} more" if len(orders) > 30 else ""
        facts.append(f"Types in these files: {', '.join(orders[:30])}{more}")
    known = ", ".join(d.name for d in inputs.library.devices)
    facts.append(f"Types in the device library: {known}")
    if inputs.found.part is not None:
        facts.append(
            f"{inputs.found.part.span.file} has transfers between "
            f"{', '.join(sorted(_modules(inputs.found.part)))}: use these names"
        )
    place = next((t.path for t in files), inputs.found.used[0] if inputs.found.used else "")
    return Question(
        ask=Ask.SUBDEVICES,
        text="Which SubDevices are on the ring, in ring order?",
        facts=tuple(facts),
        span=Span(place or "<input>"),
    )


def _names(subdevices: Sequence[DescribedSubDevice]) -> tuple[str, ...]:
    """Return names of one word; duplicates get numbers."""
    return numbered([_word(s) for s in subdevices])


def _word(sub: DescribedSubDevice) -> str:
    # A name in capitals is an order number, not a name given by a person.
    if _NAME.match(sub.name) and not sub.name.isupper() and sub.name != sub.order:
        return sub.name
    text = sub.order if sub.order and sub.name.isdecimal() else sub.name or sub.order
    word = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")[:40]
    if not word:
        return f"subdevice_{sub.position}" if sub.position is not None else "subdevice"
    return f"n{word}" if word[0].isdigit() else word


# -- transfers without their modules --------------------------------------------------------------


def _modules(part: NetworkConfig) -> set[str]:
    return {e.module for n in part.nets for t in n.transfers for e in (t.source, t.destination)} - {
        s.name for s in part.subdevices
    }


def _with_part(bus: Description, part: NetworkConfig | None, notes: list[str]) -> Description:
    """Add the transfers of a file if all its modules are now known by name."""
    if part is None:
        return bus
    subs = tuple(
        SubDevice(span=s.span, name=n, position=s.position or 0, alias=s.alias, device=s.device)
        for s, n in zip(bus.subdevices, _names(bus.subdevices), strict=True)
    )
    # A transfer with an unknown module cannot be placed; half of the transfers would mislead.
    missing = sorted(_modules(part) - {s.name for s in subs})
    if missing:
        notes.append(
            f"{part.span.file}: its transfers are left out; no SubDevice is named "
            f"{', '.join(missing)}"
        )
        return bus
    try:
        made = describe(replace(part, subdevices=subs, partial=False))
    except InputError as exc:
        notes.append(f"{part.span.file}: its transfers are left out; {exc}")
        return bus
    return replace(bus, copies=made.copies, connections=made.connections, path=part.span.file)
