"""``fsoe-net campaign --replay``: compare recorded runs with the engine of this package."""

from __future__ import annotations

import json

from fsoe_net.campaign.recording.replay import replay
from fsoe_net.campaign.recording.rows import file_lines
from fsoe_net.cli.replay_output import ReplayOutcome, outcome_json, print_outcome
from fsoe_net.cli.terminal import echo
from fsoe_net.errors import InputError, RecordingError
from fsoe_net.formats.recognise import other_document
from fsoe_net.formats.shared.files import open_file
from fsoe_net.version import __version__


def print_replay(files: tuple[str, ...], fmt: str) -> int:
    """Replay recordings, print the result and return the exit code.

    Each end of a recording receives the recorded frames at the recorded times. Its frames, states,
    reset codes and data are compared with the recording. This is not a conformance test.
    """
    outcomes = []
    # All files are tried: a failing file must not hide the others.
    for file in files:
        outcome = _replayed(file)
        outcomes.append(outcome)
        if fmt == "text":
            print_outcome(outcome)
    if fmt == "json":
        document = {
            "tool": "fsoe-net",
            "version": __version__,
            "replays": all(outcome.replays for outcome in outcomes),
            "files": [outcome_json(outcome) for outcome in outcomes],
        }
        echo(json.dumps(document, indent=2))
    return int(not all(outcome.replays for outcome in outcomes))


def _replayed(file: str) -> ReplayOutcome:
    try:
        with open_file(file, regular=False) as stream:
            peek = getattr(stream, "peek", None)  # standard input was read to its end
            other = other_document(peek() if peek else b"", "recording")
            if other is not None:
                return ReplayOutcome(file=file, reason="; ".join(other))
            return ReplayOutcome(file=file, result=replay(file_lines(stream)))
    except RecordingError as exc:
        return ReplayOutcome(file=file, reason=exc.reason, line=exc.line)
    except InputError as exc:
        return ReplayOutcome(file=file, reason=exc.diagnostics[0].message)
    except OSError as exc:
        return ReplayOutcome(file=file, reason=exc.strerror or str(exc))
