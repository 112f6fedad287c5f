"""Texts of a proposed network: its commented files, and a template for answers."""

from __future__ import annotations

from collections.abc import Iterable

from fsoe_net.errors import InputError
from fsoe_net.formats.own.comments import Remarks
from fsoe_net.formats.own.write import write_network
from fsoe_net.formats.shared.writers import Written
from fsoe_net.model.answers import Ask, Question
from fsoe_net.model.description import DescribedSubDevice
from fsoe_net.proposal.draft import Draft
from fsoe_net.proposal.proposal import Proposal


def draft_files(made: Draft) -> Written:
    """Return the commented files of a proposed network.

    Raises:
        InputError: The content of the ring is still unknown, or a file cannot represent the
            network.
    """
    if made.proposal is None:
        raise InputError("nothing written: which SubDevices are on the ring is not known")
    return write_network(made.proposal.bus, name=made.name, remarks=_remarks(made))


def _remarks(made: Draft) -> Remarks:
    proposal = made.proposal
    if proposal is None:
        return Remarks()
    used = ", ".join(made.inputs.found.used) or "answers and the device library"
    head = [f"Proposed by `fsoe-net init` from {used}.", _TRUST]
    if proposal.bus.connections:
        head.append(_SLOT)
    if any(c.unconfirmed for c in proposal.bus.connections):
        head.append(_UNCONFIRMED)
    if made.open:
        head += ["", "Open:", *(f"- {text}" for text in made.open)]
    head.append("")
    return Remarks(
        head=tuple(head),
        subdevices={n: _subdevice(proposal, n) for n in range(len(proposal.bus.subdevices))},
        devices={n: _device(proposal, n) for n in range(len(proposal.bus.subdevices))},
        connections=proposal.reasons,
    )


_FACTS = ("address", "connection_id", "watchdog_ms")
_SLOT = (
    "slot: which pair of FSoE frames of the MainInstance, from 0, in the order of its process data."
)
_UNCONFIRMED = (
    "unconfirmed: its slot is only the next one in turn. Correct main, sub and slot "
    "by the safety project, then delete the key; until then `fsoe-net plan` refuses the network."
)
_TRUST = (
    "Compare it with the safety project before you use it: this tool is part of the black channel "
    "and cannot know the required connections."
)


def _device(proposal: Proposal, number: int) -> tuple[str, ...]:
    sub = proposal.bus.subdevices[number]
    path = sub.device.path
    notes = proposal.notes.get(number, ())
    head = f"{sub.order or sub.name}{f', from {path}' if path else ''}"
    return (
        head,
        *proposal.sources.get(number, ()),
        *(("From the device library:",) if notes else ()),
        *(f"- {n}" for n in notes),
    )


def _subdevice(proposal: Proposal, number: int) -> tuple[str, ...]:
    sub = proposal.bus.subdevices[number]
    # The order number is repeated only if the name does not contain it.
    title = sub.order if sub.order and sub.order.casefold() != sub.name.casefold() else ""
    lines = [title] if title else []
    if number in proposal.mains:
        lines = [f"{title + ': ' if title else ''}FSoE MainInstance"]
    facts = []
    if sub.serial:
        facts.append(f"serial {sub.serial}")
    if sub.fsoe_address is not None:
        facts.append(f"FSoE address {sub.fsoe_address}, as the device reports")
    tables = (proposal.sources, proposal.remarks, proposal.unconnected)
    return (*lines, *facts, *(text for table in tables for text in table.get(number, ())))


def answers_template(made: Draft, answered: str | None = None) -> str:
    """Return an answers file with all open points, as comments to be completed.

    Args:
        made: The proposal so far.
        answered: File with existing answers; they are not in the text.
    """
    lines = _template_head(made.name, answered)
    proposal = made.proposal
    # A value that is known is not asked for again.
    if proposal is None or proposal.bus.cycle_us is None:
        lines += ["# cycle_us: 1000", ""]
    questions = {a: [q for q in made.questions if q.ask is a] for a in Ask}
    for question in questions[Ask.SUBDEVICES]:
        lines += [f"# {question.text}", *(f"#   {f}" for f in question.facts)]
        example = next((t.order for t in made.inputs.types), "EL1904")
        lines += ["# subdevices:", f"#   - {{type: {example}, name: stop, count: 2}}", ""]
    lines += _process_data_lines(questions[Ask.PROCESS_DATA])
    lines += _frame_lines(questions[Ask.FRAMES])
    for question in questions[Ask.MAIN]:
        names = ", ".join(w for w, _ in question.choices)
        lines += [f"# {question.text}", f"# main: [{names}]", ""]
    if proposal is not None:
        rows = _connections(proposal, proposal.bus.subdevices)
        rows += [line for q in questions[Ask.CONNECTIONS] for line in _open_connection(q)]
        lines += ["# connections:", *rows] if rows else []
    return "\n".join(lines).rstrip() + "\n"


def _process_data_lines(questions: list[Question]) -> list[str]:
    lines = [f"# {Ask.PROCESS_DATA.value}:"] if questions else []
    for question in questions:
        rows = [f'{question.subject}: "{word}"   # {why}' for word, why in question.choices]
        lines += _question_lines(question, ["# keep one of these lines", *rows])
    return lines


def _frame_lines(questions: list[Question]) -> list[str]:
    lines = [f"# {Ask.FRAMES.value}:"] if questions else []
    for question in questions:
        lines += _question_lines(question, [f"{question.subject}: yes   # or no"])
    return lines


def _question_lines(question: Question, rows: list[str]) -> list[str]:
    """Return a question with its facts and possible answer lines, as comments."""
    return [f"#   {row}" for row in (f"# {question.text}", *_comments(question.facts), *rows)]


def _comments(texts: Iterable[str]) -> list[str]:
    return [f"# {text}" for text in texts]


def _template_head(name: str, answered: str | None) -> list[str]:
    if answered is not None:
        return [
            f"# Open points in addition to the answers in {answered}: complete them there. The "
            "answers",
            "# themselves are not repeated here, so do not write this over that file.",
        ]
    return [
        "# Answers for `fsoe-net init`. Delete the # in front of what you know and complete it;",
        "# what you leave out stays open. Use: fsoe-net init FILES --answers THIS-FILE -o FOLDER",
        f"name: {name}",
    ]


def _open_connection(question: Question) -> list[str]:
    lines = [f"#   # {question.text}", *(f"#   #   {f}" for f in question.facts)]
    main = question.choices[0][0].rsplit(" ", 1)[0]
    parts = [f"sub: {question.subject}"]
    if question.sub_slot is not None:
        parts.append(f"sub_slot: {question.sub_slot}")
    parts += [f"main: {main}", "slot: TODO", *(f"{k}: TODO" for k in _FACTS)]
    return [*lines, f"#   - {{{', '.join(parts)}}}"]


def _connections(proposal: Proposal, subs: tuple[DescribedSubDevice, ...]) -> list[str]:
    lines = []
    for row, why in zip(proposal.bus.connections, proposal.reasons, strict=True):
        # Open connections are listed as questions.
        if row.main is None or row.sub is None or row.unconfirmed:
            continue
        lines.append(f"#   # {why[0]}")
        parts = [f"sub: {subs[row.sub].name}"]
        if row.sub_slot is not None:
            parts.append(f"sub_slot: {row.sub_slot}")
        parts.append(f"main: {subs[row.main].name}")
        if row.slot is not None:
            parts.append(f"slot: {row.slot}")
        for key in _FACTS:
            value = getattr(row, key)
            parts.append(f"{key}: {'TODO' if value is None else value}")
        lines.append(f"#   - {{{', '.join(parts)}}}")
    return lines
