"""Interprets the events of ``fsn-master``, and the state of a connection on the wire."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fsoe_net.core.bus_documents import PlannedConnection
from fsoe_net.core.snapshot import ConnectionSnapshot, DirectionSnapshot
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.pdu import Command, reset_code_text
from fsoe_net.live.result import ConnectionResult, RunEvent, RunEventKind, state_fields

ENDS = {"main": "MainInstance", "sub": "SubInstance"}
_MAX_EVENTS = 20_000


@dataclass(slots=True)
class BusEvents:
    """Results of the events so far, by connection. Times from the start in nanoseconds.

    ``details``: keep every Reset of a connection that resets repeatedly, instead of one at
    intervals.
    """

    start_ns: int
    details: bool = False
    events: list[RunEvent] = field(default_factory=list)
    events_lost: int = 0
    to_data_ns: dict[str, int] = field(default_factory=dict)
    last_reset: dict[str, int] = field(default_factory=dict)
    last_reset_by: dict[str, str] = field(default_factory=dict)

    def log(self, source: str, text: str, *, at_ns: int | None = None, **facts: Any) -> None:
        """Add an event; above a limit it is only counted. ``facts``: more fields of `RunEvent`."""
        if len(self.events) >= _MAX_EVENTS:
            self.events_lost += 1
            return
        now_ns = (time.monotonic_ns() if at_ns is None else at_ns) - self.start_ns
        self.events.append(RunEvent(time_ms=now_ns / 1e6, source=source, text=text, **facts))

    def take(self, event: Mapping[str, Any]) -> None:
        """Process an event of ``fsn-master``."""
        kind, at_ns = event.get("event"), int(event.get("now_ns", 0))
        if kind == "connection":
            self._connection(event, at_ns)
        elif kind == "subdevice":
            # An event without a change of state reports the links of the ports.
            same_state = event["before"] == event["after"]
            what = RunEventKind.LINKS if same_state else RunEventKind.OTHER
            self.log(str(event["subdevice"]), _subdevice_text(event), at_ns=at_ns, kind=what)
        elif kind == "group":
            self.log(str(event["group"]), str(event.get("text", "")), at_ns=at_ns)
        elif kind == "bus":
            pass  # its SubDevices report the same, with their states
        elif kind == "lost":
            self.events_lost += 1
            self.log("fsn-master", str(event.get("text", "")), at_ns=at_ns)
        else:
            # These three kinds are facts of the bus; all others concern fsn-master itself.
            source = "bus" if kind in ("wkc", "ring", "clocks") else "fsn-master"
            what = RunEventKind.WORKING_COUNTER if kind == "wkc" else RunEventKind.OTHER
            self.log(source, str(event.get("text", "")), at_ns=at_ns, kind=what)

    def _connection(self, event: Mapping[str, Any], at_ns: int) -> None:
        name = str(event["connection"])
        after = ConnectionState.from_event(str(event["after"]))
        # An event with `reset_by` is a reset; the state after it is reported by the next event.
        if "reset_by" not in event:
            if after.in_data:
                # The first time counts: a later return to Data is not the start-up time.
                self.to_data_ns.setdefault(name, at_ns - self.start_ns)
            fields = state_fields("wire", after.text, in_data=after.in_data)
            self.log(name, f"wire: {after.text}", at_ns=at_ns, **fields)
            return
        code = int(event["reset_code"])
        end = ENDS.get(str(event["reset_by"]), "one end")
        if event["before"] != "silent":  # otherwise it was on the wire before this run
            self.last_reset[name] = code
            self.last_reset_by[name] = end
        # Repeated Resets are reported at intervals.
        if self.details or event.get("level") != "detail":
            self.log(
                name,
                f"{end} resets: {reset_code_text(code)}",
                at_ns=at_ns,
                code=code,
                kind=RunEventKind.RESET,
                end=str(event["reset_by"]),
            )


def _subdevice_text(event: Mapping[str, Any]) -> str:
    before, after = event["before"], event["after"]
    links = ", ".join("open" if not up else "up" for up in event.get("link", ()))
    text = f"{before} -> {after}" if before != after else f"ports: {links}"
    if event.get("al_code"):
        text += f", AL status code 0x{int(event['al_code']):04x}"
    if event.get("detail"):
        text += f": {event['detail']}"
    return text


def connection_result(
    facts: PlannedConnection, wire: ConnectionSnapshot, events: BusEvents
) -> ConnectionResult:
    """Return the current state of a connection on the wire."""
    name = facts.name
    down, up = wire.to_sub, wire.to_main
    code = events.last_reset.get(name)
    sent = [d.reset_code for d in (down, up) if d.has_reset]
    if code is None and sent:
        # A Reset while the other end is silent does not change the state, so no event reports it.
        code = next((c for c in sent if c), sent[0])
    to_data = events.to_data_ns.get(name)
    in_data = wire.state.in_data
    return ConnectionResult(
        name=name,
        net=facts.net,
        main=facts.main,
        sub=facts.sub,
        state=wire.state,
        wire_state=wire.state,
        # Values on the wire take precedence over those in the files.
        connection_id=down.connection_id or up.connection_id or facts.connection_id,
        address=facts.address,
        watchdog_ms=facts.watchdog_ms,
        chosen=(),
        time_to_data_ms=None if to_data is None else to_data / 1e6,
        fsoe_cycle_ms={
            "last": down.interval_last_ns / 1e6,
            "min": down.interval_min_ns / 1e6,
            "mean": down.interval_mean_ns / 1e6,
            "max": down.interval_max_ns / 1e6,
        },
        frames_to_sub=down.frames,
        frames_to_main=up.frames,
        wrong_to_sub=down.wrong,
        wrong_to_main=up.wrong,
        gaps=wire.gaps,
        resets=wire.resets,
        last_reset_code=code,
        last_reset_text="" if code is None else reset_code_text(code),
        data_to_sub=_data_kind(down) if in_data else "none",
        data_to_main=_data_kind(up) if in_data else "none",
        safe_to_sub=None,
        safe_to_main=None,
        configured=wire.configured,
        observed=wire.observed,
        differs=wire.differs,
    )


def _data_kind(direction: DirectionSnapshot) -> str:
    kinds = {int(Command.PROCESS_DATA): "process", int(Command.FAIL_SAFE_DATA): "failsafe"}
    return kinds.get(direction.command, "none")
