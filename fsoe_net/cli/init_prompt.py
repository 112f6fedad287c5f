"""Questions of ``fsoe-net init`` at a terminal."""

from __future__ import annotations

import re
from dataclasses import replace

import click

from fsoe_net.cli.output import print_diagnostics
from fsoe_net.cli.terminal import echo
from fsoe_net.diag.diagnostic import Severity, Span, sort_diagnostics
from fsoe_net.errors import InputError
from fsoe_net.model.answers import AnsweredDevice, AnsweredWord, Answers, Ask, Question
from fsoe_net.model.network import ConnectionFacts
from fsoe_net.proposal.draft import Draft, Inputs, make_draft, question_findings

_ITEM = re.compile(
    r"(?:(?P<name>[A-Za-z_]\w*)\s*=\s*)?(?:(?P<count>\d{1,3})\s*[x*]\s*)?(?P<type>[\w.-]+)\Z"
)
_HERE = Span("your answer")


def ask(question: Question, answers: Answers, made: Draft) -> Answers:
    """Ask until there is an answer, and return the answers with it.

    Args:
        question: The question.
        answers: Known answers.
        made: The proposal based on them.

    Raises:
        click.Abort: The user stops (Ctrl-D, Ctrl-C).
    """
    echo(f"\n{question.text}", err=True)
    for fact in question.facts:
        echo(f"  {fact}", err=True)
    for number, (word, meaning) in enumerate(question.choices, 1):
        echo(f"  {number}) {word}" + (f": {meaning}" if meaning else ""), err=True)
    while True:
        try:
            text = click.prompt(_hint(question), default="", show_default=False, err=True).strip()
        except click.Abort:
            echo("\nnothing written", err=True)
            raise
        # An empty answer leaves a question open. Without a ring, however, nothing can be proposed.
        if not text and question.ask is not Ask.SUBDEVICES:
            return replace(answers, passed=answers.passed | {question.key})
        if question.ask is Ask.SUBDEVICES:
            found = _with_ring(text, answers)
        else:
            found = _with(question, text, answers, made)
        if found is not None:
            return found
        echo("That is not one of the answers.", err=True)


def _hint(question: Question) -> str:
    if question.ask is Ask.SUBDEVICES:
        return "Types, such as: EL6910, 2 x EL1904, stop=EL2904"
    what = "numbers, such as 1,2" if question.ask is Ask.MAIN else "number"
    return f"Your answer ({what}; Enter leaves it open)"


def parse_ring(text: str) -> tuple[AnsweredDevice, ...] | None:
    """Return what ``EL6910, 2 x EL1904, stop=EL2904`` means, or ``None``."""
    rows = []
    for item in (i.strip() for i in text.split(",")):
        match = _ITEM.match(item)
        if match is None or (match["count"] is not None and int(match["count"]) == 0):
            return None
        rows.append(
            AnsweredDevice(
                span=_HERE,
                type=match["type"],
                name=match["name"] or "",
                count=int(match["count"] or 1),
            )
        )
    return tuple(rows)


def _with_ring(text: str, answers: Answers) -> Answers | None:
    rows = parse_ring(text)
    return None if rows is None else replace(answers, subdevices=rows)


def _with(question: Question, text: str, answers: Answers, made: Draft) -> Answers | None:
    words = [_choice(question, w) for w in re.split(r"[,;]\s*", text)]
    # Several words are allowed for MainInstances only.
    if None in words or (len(words) > 1 and question.ask is not Ask.MAIN):
        return None
    chosen = [AnsweredWord(span=_HERE, text=w) for w in words if w is not None]
    if question.ask is Ask.PROCESS_DATA:
        table = {**answers.process_data, question.subject: chosen[0]}
        return replace(answers, process_data=table)
    if question.ask is Ask.FRAMES:
        return replace(answers, frames={**answers.frames, question.subject: chosen[0]})
    if question.ask is Ask.MAIN:
        known = [] if made.proposal is None else made.proposal.mains
        subs = () if made.proposal is None else made.proposal.bus.subdevices
        others = [AnsweredWord(span=_HERE, text=subs[n].name) for n in known]
        return replace(answers, main=(*others, *chosen))
    main, slot = chosen[0].text.rsplit(" ", 1)
    row = ConnectionFacts(
        span=_HERE, sub=question.subject, sub_slot=question.sub_slot, main=main, slot=int(slot)
    )
    return replace(answers, connections=(*answers.connections, row))


def _choice(question: Question, text: str) -> str | None:
    if text.isdecimal() and 1 <= int(text) <= len(question.choices):
        return question.choices[int(text) - 1][0]
    wanted = " ".join(text.split()).casefold()
    return next((w for w, _ in question.choices if w.casefold() == wanted), None)


def refuse(made: Draft) -> None:
    """Reject a proposal with wrong answers.

    Raises:
        InputError: An answer cannot be used.
    """
    errors = [d for d in made.findings if d.level is Severity.ERROR]
    if errors:
        raise InputError("nothing written", sort_diagnostics(errors))


def answered(inputs: Inputs, answers: Answers, *, asking: bool) -> Draft:
    """Make a proposal; at a terminal, ask and repeat until no question is open."""
    made = make_draft(inputs, answers)
    refuse(made)
    while asking and made.questions:
        tried = ask(made.questions[0], answers, made)
        after = make_draft(inputs, tried)
        wrong = [d for d in after.findings if d.level is Severity.ERROR]
        # No part of a wrong answer is kept, so the same question is asked again.
        if wrong:
            print_diagnostics(wrong, err=True)
        else:
            answers, made = tried, after
    return made


def report_questions(made: Draft, *, answered: bool) -> None:
    """Report open questions; fail if there is no ring or open questions are not allowed.

    Raises:
        InputError: Answers are needed.
    """
    found = question_findings(made, answered=answered)
    needed = [d for d in found if d.level is Severity.ERROR]
    if needed:
        print_diagnostics(sort_diagnostics(made.inputs.found.out.diagnostics), err=True)
        raise InputError("nothing written: answers are needed, and there is no terminal", needed)
    print_diagnostics(found, err=True)
