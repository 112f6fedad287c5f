"""Reads recorded runs line by line.

Every line is validated: the items that `read_recording` yields have the right types, sizes and
ranges, so that `fsoe_net.campaign.recording.replay` does not check them again.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

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
from fsoe_net.campaign.recording.rows import Row, rows, short
from fsoe_net.errors import FsoeError, RecordingError
from fsoe_net.fsoe.config import MainConfig, SubConfig
from fsoe_net.fsoe.event import State
from fsoe_net.fsoe.pdu import frame_length

_MAX_SKIP_CYCLES = 1_000_000
_MAX_TIME_US = 10**15  # 30 years
_STATES = frozenset(state.value for state in State)


def read_recording(lines: Iterable[str]) -> Recording:
    """Read the configuration; the other lines are read while iterating `Recording.lines`.

    Raises:
        RecordingError: The first line is not a configuration; from the iterator: invalid step.
    """
    lines_read = rows(lines)
    first = next(lines_read, None)
    if first is None:
        raise RecordingError("empty; a recording begins with its configuration")
    if first.get("type", str) != "config":
        raise first.error(f"the first line is a {first.row['type']!r}, not the 'config'")
    return _recording(first, lines_read)


def _recording(first: Row, others: Iterator[Row]) -> Recording:
    app = first.hex("app_params")
    address = first.number("slave_address")
    try:
        main = MainConfig(
            connection_id=first.number("connection_id"),
            address=address,
            watchdog_ms=first.number("watchdog_ms"),
            safe_out_bytes=first.number("out_size"),
            safe_in_bytes=first.number("in_size"),
            app_parameters=app,
        )
        own, size = "slave_own_address", "slave_app_param_size"
        # Older recordings have one address for both ends.
        sub = SubConfig(
            address=first.number(own) if first.given(own) else address,
            safe_out_bytes=main.safe_out_bytes,
            safe_in_bytes=main.safe_in_bytes,
            app_parameter_bytes=first.number(size) if first.given(size) else len(app),
        )
    # Values that FSoE does not allow are an error in the line, not in the program.
    except FsoeError as exc:
        raise first.error(str(exc)) from exc
    ids = {side: first.session_id(f"{side.value}_session_id") for side in SideName}
    # A scripted end only plays frames: it has no engine and therefore no session id.
    scripted = {s for s in SideName if first.row.get(f"{s.value}_impl") == "scripted"}
    reader = _Reader(
        {SideName.MAIN: main.safe_out_bytes, SideName.SUB: main.safe_in_bytes},
        {side: ident for side, ident in ids.items() if ident is not None and side not in scripted},
        {s for s in SideName if first.row.get(f"{s.value}_impl") == "foreign"},
        first.number("bus_cycle_us", 1) if first.given("bus_cycle_us") else 0,
    )
    return Recording(
        main=main,
        sub=sub,
        first_ids=reader.first_ids,
        bus_cycle_us=reader.bus_cycle_us,
        lines=reader.lines(others),
    )


class _Reader:
    """Turns the lines after the configuration into steps."""

    def __init__(
        self,
        sends: dict[SideName, int],
        first_ids: dict[SideName, int],
        foreign: set[SideName],
        bus_cycle_us: int,
    ) -> None:
        self.sends = sends
        self.bus_cycle_us = bus_cycle_us
        self.foreign = foreign  # ends without a recorded state
        self.first_ids = first_ids
        self.time_us = 0
        self.number: int | None = None  # of the previous step
        self.skipped = False  # after a skip, step numbers may continue from its end

    def lines(self, others: Iterator[Row]) -> Iterator[tuple[int, RecordedStep | Skip]]:
        for row in others:
            kind = row.get("type", str)
            if kind == "step":
                yield row.line, self._step(row)
            elif kind == "skip":
                yield row.line, self._skip(row)
            else:
                raise row.error(f"unknown kind of line {short(kind)}")

    def _skip(self, row: Row) -> Skip:
        key = "cycles" if "cycles" in row.row else "n"
        if not self.bus_cycle_us:
            raise row.error("cycles are left out, and the first line has no 'bus_cycle_us'")
        sha256: str = row.get("sha256", str)
        if len(row.unhex(sha256, "sha256")) != 32:
            raise row.error("'sha256' has not the 64 digits of a SHA-256")
        self.skipped = True
        return Skip(cycles=row.number(key, 0, _MAX_SKIP_CYCLES), sha256=sha256.lower())

    def _step(self, row: Row) -> RecordedStep:
        time_us = row.number("time_us", 0, _MAX_TIME_US)
        if time_us < self.time_us:
            raise row.error(f"'time_us' goes back from {self.time_us} to {time_us}")
        self.time_us = time_us
        return RecordedStep(
            number=self._number(row),
            time_us=time_us,
            quirk=row.given("quirk"),
            orders=tuple(self._order(row, text) for text in row.get("commands", list)),
            calls={
                side: self._call(row, side)
                for side in self.first_ids
                if side in self.foreign or row.given(f"{side.value}_state")
            },
            sub_frame=row.image("slave_tx"),
        )

    def _number(self, row: Row) -> int:
        """Return the number of a step; gaps are invalid, because the states would differ."""
        number, last = row.number("n"), self.number
        if last is not None and (number <= last or (number > last + 1 and not self.skipped)):
            raise row.error(f"step {number} after step {last}; {last + 1} is the next one")
        self.number, self.skipped = number, False
        return number

    def _order(self, row: Row, text: object) -> Order:
        if not isinstance(text, str):
            raise row.error(f"command {short(text)} is not a string")
        who, dot, what = text.partition(".")
        name, _, value = what.partition("=")
        if not dot or who not in {s.value for s in SideName}:
            raise row.error(f"command {short(text)} names neither 'master' nor 'slave'")
        if name not in {kind.value for kind in OrderKind}:
            # Truncated for the message: a line may be of any length.
            raise row.error(f"unknown command {short(text)}")
        side, kind = SideName(who), OrderKind(name)
        if kind is OrderKind.DATA:
            return Order(side=side, kind=kind, data=self._safe(row, row.unhex(value, text), side))
        number = None
        if kind in (OrderKind.SESSION, OrderKind.VERIFY) or (
            kind is OrderKind.POWER_CYCLE and value
        ):
            number = row.parsed(value, text)
        return Order(side=side, kind=kind, number=number)

    def _safe(self, row: Row, data: bytes, side: SideName) -> bytes:
        if len(data) != self.sends[side]:
            raise row.error(
                f"{len(data)} safe data bytes for the {side.value}, which sends {self.sends[side]}"
            )
        return data

    def _call(self, row: Row, side: SideName) -> Call:
        key = side.value
        is_main = side is SideName.MAIN
        foreign = side in self.foreign
        given = row.hex("master_app_out" if is_main else "slave_app_in")
        code = None if foreign or not row.given(f"{key}_reason") else row.number(f"{key}_reason")
        return Call(
            safe_data=self._safe(row, given, side),
            received=row.image(f"{key}_rx"),
            session_id=row.session_id(f"{key}_session_id"),
            expected=Answer(
                frame=self._sent(row, side),
                state=None if foreign else _state(row, f"{key}_state"),
                reset_by="none" if foreign else _reset_by(row, side),
                reset_code=code,
                valid=row.get(f"{key}_pd_valid", bool),
                data=row.hex("safe_inputs" if is_main else "safe_outputs"),
            ),
        )

    def _sent(self, row: Row, side: SideName) -> bytes | None:
        frame = row.image(f"{side.value}_tx")
        size = frame_length(self.sends[side])
        if frame is not None and len(frame) != size:
            raise row.error(
                f"'{side.value}_tx' has {len(frame)} bytes; its frames have {size} in this run"
            )
        return frame


def _state(row: Row, key: str) -> str:
    state: str = row.get(key, str)
    if state not in _STATES:
        raise row.error(f"{key!r} is {short(state)}, no state of an FSoE end")
    return state


def _reset_by(row: Row, side: SideName) -> str:
    key = f"{side.value}_event"
    event: str = row.get(key, str)
    if event == "none":
        return "none"
    if event not in {f"by_{s.value}" for s in SideName}:
        raise row.error(f"{key!r} is {short(event)}, none of none, by_master, by_slave")
    return "this end" if event == f"by_{side.value}" else "the other end"
