"""What people wrote into a test protocol: whether it is whole, and can be."""

from __future__ import annotations

import re
from datetime import date

from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.protocol import AtMachine, ProtocolStep, StepOutcome
from fsoe_net.model.written import says_something

_DATE = re.compile(r"(\d{4}-\d\d-\d\d)([T ].*)?")


def check_entry(step: ProtocolStep, out: Collector) -> None:
    """Report what is missing or wrong in the column of the machine.

    Args:
        step: A step as read.
        out: Takes FSN160 and FSN161.
    """
    machine = step.machine
    if not machine.filled:
        return
    if not step.kind.at_machine:
        out.add(
            "FSN161",
            machine.span,
            f"step {step.id} is tried on the emulated bus only, and has an entry at the machine",
            hint="empty it; note tests of your own beside this protocol",
        )
        return
    check_date(f"step {step.id}", machine.date, machine.at("date"), out)
    if step.is_late and machine.outcome is StepOutcome.AS_EXPECTED:
        out.add(
            "FSN161",
            machine.at("measured_ms"),
            f"step {step.id}: {machine.measured_ms:g} ms is longer than the limit of "
            f"{step.limit_ms:g} ms, and the result says as expected",
            hint="write `result: not as expected` and find the cause, or correct the time",
        )
    if missing := _missing(machine):
        out.add(
            "FSN160",
            machine.span,
            f"step {step.id} stays open: {' and '.join(missing)} not filled in",
            hint="write result, by (who was there) and date (such as 2026-11-21)",
        )


def _missing(machine: AtMachine) -> list[str]:
    by, day = says_something(machine.by), says_something(machine.date)
    rows = {"result": machine.outcome, "by": by, "date": day}
    return [key for key, value in rows.items() if not value]


def check_date(what: str, given: str, place: Span, out: Collector) -> None:
    """Report what is not a day, FSN161; nothing is said of an empty one."""
    text = given.strip()
    if not text:
        return
    match = _DATE.fullmatch(text)
    try:
        if match is None:
            raise ValueError
        date.fromisoformat(match[1])
    except ValueError:
        out.add(
            "FSN161",
            place,
            f"{what}: {text!r} is not a date",
            hint="write year, month and day, such as 2026-11-21",
        )
