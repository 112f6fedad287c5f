"""``fsoe-net replay``: hold recorded runs of FSoE ends against the engine of this package."""

from __future__ import annotations

import json
from dataclasses import dataclass

import click

from fsoe_net import __version__
from fsoe_net.cli.options import FILE, format_option
from fsoe_net.cli.terminal import echo
from fsoe_net.diag.words import counted
from fsoe_net.errors import InputError, RecordingError
from fsoe_net.formats.shared.files import open_file
from fsoe_net.fsoe.recording.difference import Difference, differing_bytes, explain
from fsoe_net.fsoe.recording.model import Answer
from fsoe_net.fsoe.recording.replay import ReplayResult, replay
from fsoe_net.fsoe.recording.rows import file_lines

__all__ = ["command"]

_EPILOG = """\b
Examples:
  fsoe-net replay trace.jsonl
  fsoe-net replay traces/*.jsonl --format json

Exit codes: 0 all files replay as recorded, 1 something differs or a file is no recording."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outcome:
    """What became of one file; ``reason`` says why it was not read to its end."""

    file: str
    result: ReplayResult | None = None
    reason: str = ""
    line: int = 0

    @property
    def replays(self) -> bool:
        return self.result is not None and not self.result.differing


@click.command("replay", epilog=_EPILOG)
@click.argument("files", nargs=-1, required=True, type=FILE, metavar="TRACE...")
@format_option
@click.pass_context
def command(ctx: click.Context, files: tuple[str, ...], fmt: str) -> None:
    """Hold recorded runs of other FSoE implementations against this engine.

    Each end of a TRACE is fed what it received in the recording, at the recorded times; its frames,
    states, reset codes and data are compared. This is no conformance test.
    """
    outcomes = []
    for file in files:
        outcome = _replayed(file)
        outcomes.append(outcome)
        if fmt == "text":
            _print_outcome(outcome)
    if fmt == "json":
        document = {
            "tool": "fsoe-net",
            "version": __version__,
            "replays": all(outcome.replays for outcome in outcomes),
            "files": [_json(outcome) for outcome in outcomes],
        }
        echo(json.dumps(document, indent=2))
    ctx.exit(int(not all(outcome.replays for outcome in outcomes)))


def _replayed(file: str) -> _Outcome:
    try:
        with open_file(file, regular=False) as stream:
            return _Outcome(file=file, result=replay(file_lines(stream)))
    except RecordingError as exc:
        return _Outcome(file=file, reason=exc.reason, line=exc.line)
    except InputError as exc:
        return _Outcome(file=file, reason=exc.diagnostics[0].message)
    except OSError as exc:
        return _Outcome(file=file, reason=exc.strerror or str(exc))


def _print_outcome(outcome: _Outcome) -> None:
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
        more = (
            "1 more value differs"
            if result.differing == 2
            else (f"{result.differing - 1} more values differ")
        )
        echo(f"  {more}; {counted(result.compared, 'call')} compared")


def _json(outcome: _Outcome) -> dict[str, object]:
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


def _difference_json(difference: Difference) -> dict[str, object]:
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
