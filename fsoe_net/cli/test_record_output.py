"""Output of ``fsoe-net test-record``, and its questions to the person at the machine."""

from __future__ import annotations

import click

from fsoe_net.cli.terminal import echo
from fsoe_net.diag.printable import printable
from fsoe_net.diag.words import counted
from fsoe_net.model.test_record import EMULATED_NOTE, StepOutcome, TestRecord, TestStep


def print_step(step: TestStep) -> None:
    """Print the result of a step on the live bus."""
    seen = step.live
    if seen is not None:
        time = "" if seen.measured_ms is None else f", {seen.measured_ms:g} ms {seen.time_is}"
        echo(f"  {step.id}: {seen.outcome.value}{time}; {seen.remark}", err=True)


class PersonAtTerminal:
    """The person at the terminal."""

    def guarded(self, step: TestStep) -> bool:
        """Ask whether the area is guarded; the person answers with the name of the SubDevice."""
        echo(f"\n{step.id}: {step.what}", err=True)
        echo("Machines may move or stop. Is the area guarded, with no person in it?", err=True)
        answer = click.prompt(
            printable(f"write {step.subject} to go on, Enter to leave this step out"),
            default="",
            show_default=False,
            err=True,
        )
        return str(answer).strip() == step.subject

    def tell(self, text: str) -> None:
        """Print what to do now."""
        echo(text, err=True)


def print_outcome(record: TestRecord, output: str) -> int:
    """Print a summary of the steps and return the exit code."""
    steps = record.steps
    wrong = [
        step.id
        for step in steps
        for seen in (step.emulated, step.live)
        if seen is not None and seen.outcome is StepOutcome.NOT_AS_EXPECTED
    ]
    machine = f"{len(record.open_steps)} of {len(record.machine_steps)} open at the machine"
    echo(f"{output}: {counted(len(steps), 'step')}, {machine}")
    tried = [s.emulated for s in steps if s.emulated is not None]
    if tried:
        left = sum(seen.outcome is StepOutcome.NOT_RUN for seen in tried)
        echo(f"{len(tried) - left} tried on the emulated bus, {left} not: {EMULATED_NOTE}")
    for name in dict.fromkeys(wrong):
        echo(f"not as expected: {name}")
    return 1 if wrong else 0
