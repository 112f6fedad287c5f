"""Holds a recorded run of other implementations against this engine.

Each end alone is fed what its counterpart in the recording received, at the recorded time and after
the recorded commands; what it answers is compared. The file format is in §13 of the protocol notes.

Two kinds of steps differ with good reason and are counted as `tolerated`:

* FailSafeData that carried something else than zeros (§9): the recorded frame is taken into our
  chain when that is the only difference, and the comparison goes on.
* Lines marked ``quirk`` (§11): either answer is right. From there to the next Reset the recorded
  end sends, the two histories differ; then ours is reset as well and the comparison goes on.
"""

from __future__ import annotations

import copy
import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fsoe_net.errors import FsoeError
from fsoe_net.fsoe.chain import Chain
from fsoe_net.fsoe.config import MainConfig, SubConfig
from fsoe_net.fsoe.event import Event, EventKind
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.pdu import Command, decode_pdu, describe, is_frame_length
from fsoe_net.fsoe.sub_instance import SubInstance

__all__ = ["Difference", "ReplayResult", "replay", "replay_file"]

_Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """One value in which our end and the recorded one differ.

    Attributes:
        step: Step number of the line in the recording.
        side: ``main`` or ``sub``.
        field: ``frame``, ``state``, ``reset by``, ``reset code``, ``valid``, ``data``, ``hash``.
        expected: Recorded value; a frame with its meaning.
        got: Our value.
    """

    step: int
    side: str
    field: str
    expected: str
    got: str

    def __str__(self) -> str:
        return (
            f"step {self.step} {self.side} {self.field}: expected {self.expected}, got {self.got}"
        )


@dataclass(slots=True, kw_only=True)
class ReplayResult:
    """What a replay found.

    Attributes:
        differences: Values that differ, in the order of the recording.
        compared: Calls compared, both ends counted, lockstep cycles included.
        tolerated: Calls that differ with good reason.
    """

    differences: list[Difference] = field(default_factory=list)
    compared: int = 0
    tolerated: int = 0


class _SessionIds:
    """Hands out the session id which the recorded end drew in this step."""

    def __init__(self, constant: int) -> None:
        self.value = constant

    def __call__(self) -> int:
        return self.value


def _frame_text(frame: bytes | None) -> str:
    if frame is None:
        return "no frame"
    meaning = describe(decode_pdu(frame)) if is_frame_length(len(frame)) else "no FSoE frame"
    return f"{frame.hex()} ({meaning})"


def _bytes(text: str | None) -> bytes | None:
    return None if text is None else bytes.fromhex(text)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Answer:
    """What one call did, recorded or ours."""

    frame: bytes | None
    state: str
    reset_by: str
    reset_code: int | None
    valid: bool
    data: bytes

    def differing(self, other: _Answer) -> list[str]:
        names = ("frame", "state", "reset_by", "reset_code", "valid", "data")
        return [name for name in names if getattr(self, name) != getattr(other, name)]

    def text(self, name: str) -> str:
        value = getattr(self, name)
        if name == "frame":
            return _frame_text(value)
        return value.hex(" ") if isinstance(value, bytes) else str(value)


class _Side:
    """One of our ends, driven by the recording."""

    def __init__(self, name: str, config: _Row) -> None:
        self.name = name
        self.key = "master" if name == "main" else "slave"
        self.app_key = "master_app_out" if name == "main" else "slave_app_in"
        self.data_key = "safe_inputs" if name == "main" else "safe_outputs"
        self.verdict = 0
        self.apart = False  # since a quirk, until the next Reset
        first_id = config.get(f"{self.key}_session_id")
        self.recorded = config.get(f"{self.key}_impl") != "scripted" and first_id is not None
        self.ids = _SessionIds(first_id or 0)
        self.end = self._main(config) if name == "main" else self._sub(config)

    def _main(self, config: _Row) -> MainInstance | SubInstance:
        return MainInstance(
            MainConfig(
                connection_id=config["connection_id"],
                address=config["slave_address"],
                watchdog_ms=config["watchdog_ms"],
                safe_out_bytes=config["out_size"],
                safe_in_bytes=config["in_size"],
                app_parameters=bytes.fromhex(config["app_params"]),
            ),
            session_ids=self.ids,
        )

    def _sub(self, config: _Row) -> MainInstance | SubInstance:
        expected = config.get("slave_app_param_size")
        address = config.get("slave_own_address")
        return SubInstance(
            SubConfig(
                address=config["slave_address"] if address is None else address,
                safe_out_bytes=config["out_size"],
                safe_in_bytes=config["in_size"],
                app_parameter_bytes=(
                    len(config["app_params"]) // 2 if expected is None else expected
                ),
                verify=lambda _parameters: self.verdict,
            ),
            session_ids=self.ids,
        )

    def command(self, text: str) -> None:
        """Carry out one recorded command, its side taken off, such as ``data=0f00``."""
        name, _, value = text.partition("=")
        actions: dict[str, Callable[[], None]] = {
            "enable": lambda: setattr(self.end, "enable", True),
            "disable": lambda: setattr(self.end, "enable", False),
            "reset": self.end.request_reset,
            "data": lambda: self.end.set_safe_data(bytes.fromhex(value)),
            "session": lambda: setattr(self.ids, "value", int(value, 0)),
            "power_cycle": self.end.power_cycle,
            "verify": lambda: setattr(self, "verdict", int(value, 0)),
        }
        if name not in actions:
            raise FsoeError(f"unknown command {text!r} for {self.key}")
        actions[name]()
        if name == "power_cycle" and value:
            self.ids.value = int(value, 0)

    def expected(self, row: _Row) -> _Answer:
        by = row[f"{self.key}_event"]
        reset_by = {"none": "none", f"by_{self.key}": "this end"}.get(by, "the other end")
        return _Answer(
            frame=_bytes(row[f"{self.key}_tx"]),
            state=row[f"{self.key}_state"],
            reset_by=reset_by,
            reset_code=row[f"{self.key}_reason"],
            valid=row[f"{self.key}_pd_valid"],
            data=bytes.fromhex(row[self.data_key]),
        )

    def step(self, row: _Row) -> _Answer:
        drawn = row.get(f"{self.key}_session_id")
        if drawn is not None:
            self.ids.value = int(drawn, 16) if isinstance(drawn, str) else drawn
        self.end.set_safe_data(bytes.fromhex(row[self.app_key]))
        frame = self.end.step(row["time_us"] * 1000, _bytes(row[f"{self.key}_rx"]))
        events = self.end.take_events()
        reset_by, code = _reset_of(events[-1] if events else None)
        return _Answer(
            frame=frame,
            state=self.end.state.value,
            reset_by=reset_by,
            reset_code=code,
            valid=self.end.data_valid,
            data=self.end.received_safe_data,
        )

    def chain(self) -> Chain:
        return copy.copy(self.end._chain)

    def adopt(self, before: Chain, row: _Row, expected: _Answer) -> bool:
        """Take the recorded FailSafeData into our chain if only its data differ (§9)."""
        received = _bytes(row[f"{self.key}_rx"])
        if expected.frame is None or received is None:
            return False
        pdu = decode_pdu(expected.frame)
        if pdu.command != Command.FAIL_SAFE_DATA or not before.receive(decode_pdu(received)):
            return False
        if before.send(pdu.command, pdu.safe_data, self.end.connection_id) != expected.frame:
            return False
        self.end._chain = before
        return True

    def rejoin(self, time_us: int) -> None:
        """Fall into the state in which the recorded end is after the Reset it sent."""
        self.end.request_reset()
        self.end.step(time_us * 1000, None)
        self.end.take_events()
        self.apart = False


def _reset_of(event: Event | None) -> tuple[str, int | None]:
    if event is None or event.kind is EventKind.STATE:
        return "none", None
    by = "this end" if event.kind is EventKind.RESET_LOCAL else "the other end"
    return by, event.code


def _is_row_11(side: _Side, row: _Row, expected: _Answer) -> bool:
    """§11.2: a wrong Session reply which both ignore, with different bookkeeping."""
    ignored = expected.frame is None and row[f"{side.key}_rx"] is not None
    return side.name == "main" and expected.state == "Session" and ignored


def _compare(side: _Side, row: _Row, result: ReplayResult) -> None:
    """Run one call of one end and note what differs."""
    before = side.chain()
    expected, got = side.expected(row), side.step(row)
    result.compared += 1
    names = expected.differing(got)
    if row.get("quirk") is not None and (names or _is_row_11(side, row, expected)):
        side.apart = True
    if side.apart:
        result.tolerated += bool(names)
        if expected.frame is not None and expected.frame[0] == Command.RESET:
            side.rejoin(row["time_us"])
        return
    if names == ["frame"] and side.adopt(before, row, expected):
        result.tolerated += 1
        return
    for name in names:
        result.differences.append(
            Difference(
                step=row["n"],
                side=side.name,
                field=name.replace("_", " "),
                expected=expected.text(name),
                got=got.text(name),
            )
        )


def _skip(sides: list[_Side], row: _Row, at: _At, result: ReplayResult) -> None:
    """Run n lossless lockstep cycles with constant data; SHA-256 over main's and sub's frames."""
    main, sub = sides
    cycles: int = row["cycles"] if "cycles" in row else row["n"]
    result.compared += 2 * cycles
    if main.apart or sub.apart:
        result.tolerated += 2 * cycles
        return
    digest = hashlib.sha256()
    frame = at.sub_frame
    for cycle in range(1, cycles + 1):
        now_ns = (at.time_us + cycle * at.cycle_us) * 1000
        sent = main.end.step(now_ns, frame)
        frame = sub.end.step(now_ns, sent)
        digest.update(sent or b"")
        digest.update(frame or b"")
    main.end.take_events()
    sub.end.take_events()
    at.time_us += cycles * at.cycle_us
    at.sub_frame = frame
    if digest.hexdigest() != row["sha256"]:
        got = f"{digest.hexdigest()}, last frame {_frame_text(frame)}"
        result.differences.append(
            Difference(step=at.step, side="both", field="hash", expected=row["sha256"], got=got)
        )


@dataclass(slots=True, kw_only=True)
class _At:
    """Where in the recording we are, for lockstep cycles."""

    cycle_us: int
    step: int = 0
    time_us: int = 0
    sub_frame: bytes | None = None

    def move(self, row: _Row) -> None:
        self.step, self.time_us = row["n"], row["time_us"]
        if row["slave_tx"] is not None:
            self.sub_frame = bytes.fromhex(row["slave_tx"])


def replay(lines: Iterable[str]) -> ReplayResult:
    """Hold a recorded run against this engine.

    Args:
        lines: Lines of the recording: one configuration, then steps.

    Returns:
        What differs; nothing when the engine answers as recorded.

    Raises:
        FsoeError: The recording holds an unknown command or kind of line.
    """
    rows = iter([json.loads(line) for line in lines if line.strip()])
    config = next(rows)
    sides = [_Side("main", config), _Side("sub", config)]
    result = ReplayResult()
    at = _At(cycle_us=config["bus_cycle_us"])
    for row in rows:
        if row["type"] == "skip":
            _skip(sides, row, at, result)
            continue
        if row["type"] != "step":
            raise FsoeError(f"unknown kind of line {row['type']!r}")
        for text in row["commands"]:
            who, _, what = text.partition(".")
            sides[who == "slave"].command(what)
        for side in sides:
            if side.recorded and row.get(f"{side.key}_state") is not None:
                _compare(side, row, result)
        at.move(row)
    return result


def replay_file(path: Path) -> ReplayResult:
    """Hold the recorded run in a ``.jsonl`` file against this engine; see `replay`."""
    with path.open(encoding="utf-8") as lines:
        return replay(lines)
