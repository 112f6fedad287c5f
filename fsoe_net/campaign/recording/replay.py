"""Compares a recorded run of other implementations with this engine.

Each end alone receives the input of its counterpart in the recording, at the recorded time and
after the recorded commands; its answers are compared. The file format is in §13 of the protocol
notes.

Two kinds of steps may differ for a valid reason and are counted as `tolerated`:

* FailSafeData with non-zero content (§9): the recorded frame is taken into our chain when that is
  the only difference, and the comparison continues.
* Lines marked ``quirk`` (§11): either answer is correct. From there to the next Reset sent by the
  recorded end, the two histories differ; then ours is also reset and the comparison continues.
"""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

from fsoe_net.campaign.recording.difference import (
    Compared,
    RecordingDifference,
    differing,
    frame_text,
    value_text,
)
from fsoe_net.campaign.recording.model import (
    Answer,
    Call,
    Order,
    OrderKind,
    RecordedStep,
    Recording,
    SideName,
    Skip,
)
from fsoe_net.campaign.recording.reader import read_recording
from fsoe_net.campaign.recording.rows import file_lines
from fsoe_net.errors import RecordingError
from fsoe_net.fsoe.chain import Chain
from fsoe_net.fsoe.event import Event, EventKind
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.pdu import Command, decode_pdu, is_frame_length
from fsoe_net.fsoe.sub_instance import SubInstance

_KEPT_DIFFERENCES = 100


@dataclass(slots=True, kw_only=True)
class ReplayResult:
    """Result of a replay.

    Attributes:
        differences: Values that differ, in the order of the recording; the first 100.
        differing: Number of values that differ, including those not kept.
        compared: Calls compared, both ends counted, lockstep cycles included.
        tolerated: Calls that differ for a valid reason.
    """

    differences: list[RecordingDifference] = field(default_factory=list)
    differing: int = 0
    compared: int = 0
    tolerated: int = 0

    def add(self, difference: RecordingDifference) -> None:
        """Count a difference; only the first ones are kept."""
        self.differing += 1
        if len(self.differences) < _KEPT_DIFFERENCES:
            self.differences.append(difference)


class _Side:
    """One of our ends, driven by the recording."""

    def __init__(self, name: SideName, recording: Recording) -> None:
        self.name = name
        self.session_id = recording.first_ids.get(name, 0)
        self.verdict = 0
        self.apart = False  # from a quirk to the next Reset
        self.end = self._end(recording)

    def _end(self, recording: Recording) -> MainInstance | SubInstance:
        def session_ids() -> int:  # the id which the recorded end drew in this step
            return self.session_id

        if self.name is SideName.MAIN:
            return MainInstance(recording.main, session_ids=session_ids)
        config = replace(recording.sub, verify=lambda _parameters: self.verdict)
        return SubInstance(config, session_ids=session_ids)

    def carry_out(self, order: Order) -> None:
        """Execute a recorded command."""
        if order.kind is OrderKind.POWER_CYCLE:
            self.end.power_cycle()
        actions: dict[OrderKind, Callable[[], None]] = {
            OrderKind.ENABLE: lambda: setattr(self.end, "enable", True),
            OrderKind.DISABLE: lambda: setattr(self.end, "enable", False),
            OrderKind.RESET: self.end.request_reset,
            OrderKind.DATA: lambda: self.end.set_safe_data(order.data),
            OrderKind.VERIFY: lambda: setattr(self, "verdict", order.number),
        }
        if order.kind in actions:
            actions[order.kind]()
        elif order.number is not None:  # SESSION, and POWER_CYCLE with an id
            self.session_id = order.number

    def step(self, time_us: int, call: Call) -> Answer:
        """Make the recorded call at our end."""
        if call.session_id is not None:
            self.session_id = call.session_id
        self.end.set_safe_data(call.safe_data)
        frame = self.end.step(time_us * 1000, call.received)
        events = self.end.take_events()
        reset_by, code = _reset_of(events[-1] if events else None)
        return Answer(
            frame=frame,
            state=self.end.state.value,
            reset_by=reset_by,
            reset_code=code,
            valid=self.end.data_valid,
            data=self.end.received_safe_data,
        )

    def chain(self) -> Chain:
        """Return the current chain."""
        return copy.copy(self.end._chain)

    def adopt(self, before: Chain, call: Call) -> bool:
        """Take the recorded FailSafeData into our chain if only its data differ (§9)."""
        frame, received = call.expected.frame, call.received
        if frame is None or received is None or not is_frame_length(len(received)):
            # Without both frames the chain cannot be followed.
            return False
        pdu = decode_pdu(frame)
        if pdu.command != Command.FAIL_SAFE_DATA or not before.receive(decode_pdu(received)):
            return False
        # All but the data must agree; otherwise the difference is a real one.
        if before.send(pdu.command, pdu.safe_data, self.end.connection_id) != frame:
            return False
        self.end._chain = before
        return True

    def rejoin(self, time_us: int) -> None:
        """Take the state in which the recorded end is after it sent a Reset."""
        self.end.request_reset()
        self.end.step(time_us * 1000, None)
        self.end.take_events()
        self.apart = False


def _reset_of(event: Event | None) -> tuple[str, int | None]:
    if event is None or event.kind is EventKind.STATE:
        return "none", None
    by = "this end" if event.kind is EventKind.RESET_LOCAL else "the other end"
    return by, event.code


def _is_row_11(side: _Side, call: Call) -> bool:
    """§11.2: a wrong Session reply which both ignore, with different bookkeeping."""
    ignored = call.expected.frame is None and call.received is not None
    return side.name is SideName.MAIN and call.expected.state == "Session" and ignored


class _Replay:
    """Both ends, and their position in the recording."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.sides = {name: _Side(name, recording) for name in SideName}
        self.result = ReplayResult()
        self.line = 0
        self.step_number = 0
        self.time_us = 0
        self.sub_frame: bytes | None = None

    def run(self) -> ReplayResult:
        for line, what in self.recording.lines:
            self.line = line
            if isinstance(what, Skip):
                self._skip(what)
            else:
                self._step(what)
        return self.result

    def _step(self, step: RecordedStep) -> None:
        self.step_number, self.time_us = step.number, step.time_us
        for order in step.orders:
            self.sides[order.side].carry_out(order)
        for name, call in step.calls.items():
            self._compare(self.sides[name], step, call)
        if step.sub_frame is not None:
            self.sub_frame = step.sub_frame

    def _compare(self, side: _Side, step: RecordedStep, call: Call) -> None:
        """Run one call of one end and record differences."""
        before, state_before = side.chain(), side.end.state.value
        expected, got = call.expected, side.step(step.time_us, call)
        self.result.compared += 1
        names = differing(expected, got)
        # After a known quirk, both sides are in different states until the next Reset.
        if step.quirk and (names or _is_row_11(side, call)):
            side.apart = True
        if side.apart:
            self.result.tolerated += bool(names)
            # A Reset brings both sides back into the same state.
            if expected.frame is not None and expected.frame[0] == Command.RESET:
                side.rejoin(step.time_us)
            return
        if names == ["frame"] and side.adopt(before, call):
            self.result.tolerated += 1
            return
        compared = Compared(
            time_us=step.time_us,
            received=call.received,
            state_before=state_before,
            expected=expected,
            got=got,
        )
        for name in names:
            self.result.add(
                RecordingDifference(
                    line=self.line,
                    step=step.number,
                    side=side.name.label,
                    field=name.replace("_", " "),
                    expected=value_text(expected, name),
                    got=value_text(got, name),
                    call=compared,
                )
            )

    def _skip(self, skip: Skip) -> None:
        """Run cycles in lockstep with constant data; SHA-256 over main's and sub's frames."""
        main, sub = self.sides[SideName.MAIN], self.sides[SideName.SUB]
        self.result.compared += 2 * skip.cycles
        # A side in a different state would give a different, meaningless hash.
        if main.apart or sub.apart:
            self.result.tolerated += 2 * skip.cycles
            return
        digest = hashlib.sha256()
        for _ in range(skip.cycles):
            self.time_us += self.recording.bus_cycle_us
            sent = main.end.step(self.time_us * 1000, self.sub_frame)
            self.sub_frame = sub.end.step(self.time_us * 1000, sent)
            digest.update(sent or b"")
            digest.update(self.sub_frame or b"")
        # Events of the skipped cycles are not recorded.
        main.end.take_events()
        sub.end.take_events()
        if digest.hexdigest() != skip.sha256:
            self.result.add(
                RecordingDifference(
                    line=self.line,
                    step=self.step_number,
                    side="both",
                    field="hash",
                    expected=skip.sha256,
                    got=f"{digest.hexdigest()}, last frame {frame_text(self.sub_frame)}",
                )
            )


def replay(lines: Iterable[str]) -> ReplayResult:
    """Compare a recorded run with this engine, line by line.

    Args:
        lines: Lines of the recording: one configuration, then steps.

    Returns:
        The differences; none when the engine answers as recorded.

    Raises:
        RecordingError: An invalid line, or there is nothing to compare.
    """
    result = _Replay(read_recording(lines)).run()
    if not result.compared:
        raise RecordingError("nothing to compare: no line holds the call of a recorded end")
    return result


def replay_file(path: Path) -> ReplayResult:
    """Compare the recorded run in a ``.jsonl`` file with this engine; see `replay`."""
    with path.open("rb") as file:
        return replay(file_lines(file))
