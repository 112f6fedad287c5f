"""Output of ``fsoe-net campaign --replay``."""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.campaign.recording.difference import RecordingDifference, differing_bytes, explain
from fsoe_net.campaign.recording.model import Answer
from fsoe_net.campaign.recording.replay import ReplayResult
from fsoe_net.cli.terminal import echo
from fsoe_net.diag.words import counted


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayOutcome:
    """The outcome of one file; ``reason`` explains why it was not read to its end."""

    file: str
    result: ReplayResult | None = None
    reason: str = ""
    line: int = 0

    @property
    def replays(self) -> bool:
        """Whether it could be read, and every value is equal."""
        return self.result is not None and not self.result.differing


def print_outcome(outcome: ReplayOutcome) -> None:
    """Print the outcome of one recording."""
    result = outcome.result
    if result is None:
        place = f"{outcome.file}:{outcome.line}" if outcome.line else outcome.file
        echo(f"{place}: {outcome.reason}", err=True)
        return
    if outcome.replays:
        echo(
            f"{outcome.file}: replays: {counted(result.compared, 'call')} compared, "
            f"{result.tolerated} tolerated"
        )
        return
    first = result.differences[0]
    head, *rest = explain(first)
    echo(f"{outcome.file}:{first.line}: {head}")
    for line in rest:
        echo(line)
    if result.differing > 1:
        more = f"{result.differing - 1} more values differ"
        if result.differing == 2:
            more = "1 more value differs"
        echo(f"  {more}; {counted(result.compared, 'call')} compared")


def outcome_json(outcome: ReplayOutcome) -> dict[str, object]:
    """Return the outcome as a JSON document (``docs/reference/json-output.md``)."""
    result = outcome.result
    error = {"line": outcome.line, "message": outcome.reason} if result is None else None
    return {
        "file": outcome.file,
        "replays": outcome.replays,
        "error": error,
        "compared": result.compared if result else 0,
        "tolerated": result.tolerated if result else 0,
        "differing": result.differing if result else 0,
        "differences": [_difference_json(d) for d in result.differences] if result else [],
    }


def _difference_json(difference: RecordingDifference) -> dict[str, object]:
    row: dict[str, object] = {
        "line": difference.line,
        "step": difference.step,
        "side": difference.side,
        "field": difference.field,
        "expected": difference.expected,
        "got": difference.got,
    }
    call = difference.call
    if call is not None:
        row["time_us"] = call.time_us
        row["received"] = call.received.hex() if call.received is not None else None
        row["state_before"] = call.state_before
        row["bytes"] = differing_bytes(call)
        row["expected_answer"] = _answer_json(call.expected)
        row["got_answer"] = _answer_json(call.got)
    return row


def _answer_json(answer: Answer) -> dict[str, object]:
    return {
        "frame": answer.frame.hex() if answer.frame is not None else None,
        "state": answer.state,
        "reset_by": answer.reset_by,
        "reset_code": answer.reset_code,
        "valid": answer.valid,
        "data": answer.data.hex(),
    }
