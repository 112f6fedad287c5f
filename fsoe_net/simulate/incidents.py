"""Writes an incident file if a connection of an emulated run leaves Data or never reaches it."""

from __future__ import annotations

import base64
import threading
from collections import deque
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fsoe_net.core.snapshot import CoreEvent, CycleImage
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.parameters import differences
from fsoe_net.fsoe.pdu import reset_code_text
from fsoe_net.incident.incident import CycleRecord, TriggerKind
from fsoe_net.incident.incident_write import incident_name, write_incident
from fsoe_net.simulate.emulated_documents import (
    fsoe_json,
    layout_json,
    snapshot_json,
    subdevices_json,
)
from fsoe_net.version import __version__

if TYPE_CHECKING:
    from fsoe_net.simulate.session import Session

_BEFORE_NS = 5_000_000_000
_AFTER_NS = 1_000_000_000
_MOST_BYTES = 64 << 20
_MOST_EVENTS = 500
_MOST_FILES = 50


@dataclass(slots=True)
class _Open:
    """An incident whose window has not ended; the head is from its moment."""

    name: str
    until_ns: int
    head: dict[str, Any]


@dataclass(slots=True)
class _Ring:
    """The newest cycles, limited by time and bytes."""

    rows: deque[CycleRecord] = field(default_factory=deque)
    bytes: int = 0

    def add(self, record: CycleRecord) -> None:
        self.rows.append(record)
        # A record without its image takes about 200 bytes.
        self.bytes += len(record.image or b"") + 200
        oldest = record.now_ns - _BEFORE_NS - _AFTER_NS
        while self.rows[0].now_ns < oldest or self.bytes > _MOST_BYTES:
            self.bytes -= len(self.rows.popleft().image or b"") + 200


class IncidentRecorder:
    """Observes every cycle of a session and keeps the last seconds.

    Call `cycle` after each cycle and `finish` at the end. Writing does not disturb the run: with
    ``background`` it has its own thread, and a full disk becomes an event.

    Args:
        session: The session; the events of its core must have no other reader.
        folder: Target folder; must exist.
        start: UTC of time 0 of the run.
        background: Whether to write in a separate thread.
    """

    def __init__(
        self,
        session: Session,
        folder: Path,
        *,
        start: datetime | None = None,
        background: bool = False,
    ) -> None:
        self._session = session
        self._folder = folder
        self._start = start or datetime.now(UTC)
        self._background = background
        self._ring = _Ring()
        self._events: deque[dict[str, Any]] = deque(maxlen=_MOST_EVENTS)
        self._open: _Open | None = None
        self._last: CycleImage | None = None
        self._absent: frozenset[str] = frozenset()
        self._threads: list[threading.Thread] = []
        self._lock = threading.Lock()
        self._outcome: list[str] = []
        self._base_ns: int | None = None
        self._asked_never = False
        self._had_data: set[int] = set()
        self.files: list[Path] = []
        """Files written so far."""
        self._begun = 0

    def cycle(self, now_ns: int) -> None:
        """Record the cycle that has just run; ``now_ns`` is the time of the run."""
        core = self._session.core
        seen = core.cycle_image()
        # The cycle of a paused core is the same one again.
        if self._last is None or seen.cycle != self._last.cycle:
            self._keep(seen)
        # The core has its own clock; the difference to the time of the run is constant.
        if self._base_ns is None:
            self._base_ns = seen.now_ns - now_ns
        self._look_at_subdevices(seen.now_ns)
        for event in core.events():
            self._event(event)
        if not self._asked_never and now_ns >= _BEFORE_NS:
            self._never_connected(seen.now_ns)
        if self._open is not None and seen.now_ns >= self._open.until_ns:
            self._close(self._open)
        self._tell(now_ns)

    def request(self, text: str) -> None:
        """Write an incident on request; ignored while another window is open."""
        if self._last is not None:
            self._begin(TriggerKind.REQUEST, None, self._last.now_ns, text)

    def finish(self, now_ns: int) -> None:
        """End the run: an open incident is written with the available cycles."""
        if self._last is not None and not self._asked_never:
            self._never_connected(self._last.now_ns)
        if self._open is not None:
            self._close(self._open)
        for thread in self._threads:
            thread.join()
        self._tell(now_ns)

    def _keep(self, seen: CycleImage) -> None:
        last = self._last
        before = last.frames if last is not None else {}

        def of_cycle(name: str) -> int:
            return seen.frames[name] - before.get(name, 0)

        short = seen.actual_wkc != seen.expected_wkc
        self._ring.add(
            CycleRecord(
                cycle=seen.cycle,
                now_ns=seen.now_ns,
                lost=of_cycle("lost_frames"),
                old=of_cycle("old_replies"),
                foreign=of_cycle("foreign_frames"),
                wkc=(seen.expected_wkc, seen.actual_wkc) if short else None,
                image=seen.image,
            )
        )
        was_short = last is not None and last.actual_wkc != last.expected_wkc
        # Only the change is an event: a cable that is open for minutes would fill the file.
        if short != was_short:
            self._note(
                "wkc",
                seen.now_ns,
                "warning" if short else "info",
                f"working counter {seen.actual_wkc} of {seen.expected_wkc}",
                complete=not short,
                expected=seen.expected_wkc,
                actual=seen.actual_wkc,
            )
        self._last = seen

    def _look_at_subdevices(self, now_ns: int) -> None:
        absent = frozenset(self._session.absent)
        for name in sorted(absent ^ self._absent):
            gone = name in absent
            before, after = ("OP", "none") if gone else ("none", "OP")
            self._note(
                "subdevice",
                now_ns,
                "warning" if gone and name not in self._session.away else "info",
                f"SubDevice {name}: {before} -> {after}",
                subdevice=name,
                before=before,
                after=after,
                returns=self._session.returns[name],
            )
        self._absent = absent

    def _event(self, event: CoreEvent) -> None:
        name = self._session.plan.connection_names[event.connection]
        # Without a change of state it reports the parameters on the wire.
        if event.before is event.after:
            self._parameters(event, name)
            return
        due = self._session.is_due(name)
        # Leaving Data is an incident only if the connection should be present.
        left = event.before.in_data and not event.after.in_data and due
        keys: dict[str, Any] = {
            "connection": name,
            "before": event.before.event_word,
            "after": event.after.event_word,
        }
        reset = event.after is ConnectionState.RESET and bool(event.by)
        text = f"connection {name}: {event.before.event_word} -> {event.after.event_word}"
        if reset:
            code = reset_code_text(event.reset_code)
            keys |= {"reset_by": event.by, "reset_code": event.reset_code, "reset_text": code}
            text += f", by the {event.by}: {code}"
        self._note("connection", event.now_ns, "warning" if left else "info", text, **keys)
        if event.after.in_data:
            self._had_data.add(event.connection)
        if left:
            self._begin(TriggerKind.LEFT_DATA, event, event.now_ns, text)

    def _parameters(self, event: CoreEvent, name: str) -> None:
        configured = self._session.records.connections[event.connection].parameters
        texts = differences(event.differs, configured, event.parameters)
        self._note(
            "parameters",
            event.now_ns,
            "warning" if texts else "info",
            f"connection {name} runs with other parameters than the plan: {'; '.join(texts)}"
            if texts
            else f"connection {name}: its parameters are those of the plan again",
            connection=name,
            configured=configured.to_json(),
            observed=event.parameters.to_json(),
            differs=list(event.differs),
            alarm=False,
        )

    def _never_connected(self, now_ns: int) -> None:
        self._asked_never = True
        names = self._session.plan.connection_names
        snapshot = self._session.core.snapshot()
        for number, row in enumerate(snapshot.connections):
            if row.state.in_data or number in self._had_data:
                continue
            text = f"connection {names[number]} is in {row.state.event_word}, not in Data"
            never = CoreEvent(
                now_ns=now_ns,
                connection=number,
                before=row.state,
                after=row.state,
                reset_code=0,
                by="",
            )
            self._begin(TriggerKind.NOT_CONNECTED, never, now_ns, text)
            return

    def _note(self, event: str, now_ns: int, level: str, text: str, **keys: Any) -> None:
        row = {"event": event, "utc": self._utc(now_ns), "now_ns": now_ns, "level": level}
        self._events.append(row | {"text": text} | keys)

    def _begin(self, kind: TriggerKind, event: CoreEvent | None, now_ns: int, text: str) -> None:
        # One file at a time: later events within its window belong to the same incident.
        if self._open is not None or self._last is None:
            return
        self._begun += 1
        # A bus that fails repeatedly must not fill the disk.
        if self._begun > _MOST_FILES:
            # Reported once, not for each omitted file.
            if self._begun == _MOST_FILES + 1:
                with self._lock:
                    self._outcome.append(
                        f"not written: {text}; one run writes {_MOST_FILES} files at most"
                    )
            return
        session = self._session
        trigger: dict[str, Any] = {
            "kind": kind.value,
            "connection": None,
            "cycle": self._last.cycle,
            "now_ns": now_ns,
            "text": text,
        }
        if event is not None:
            trigger["connection"] = session.plan.connection_names[event.connection]
            trigger |= {"before": event.before.event_word, "after": event.after.event_word}
            if event.by and event.after is ConnectionState.RESET:
                trigger |= {
                    "reset_by": event.by,
                    "reset_code": event.reset_code,
                    "reset_text": reset_code_text(event.reset_code),
                }
        utc = self._utc(now_ns)
        head = {
            "utc": utc,
            "version": __version__,
            "interface": "",
            "backend": "emulated",
            "plan": base64.b64encode(session.plan_bytes).decode("ascii"),
            "plan_file": "",
            "plan_sha256": session.plan_sha256,
            "fingerprint": session.plan.fingerprint().to_json()
            | {"version": __version__, "cycle_ns": session.cycle_ns},
            "cycle_ns": session.cycle_ns,
            "trigger": trigger,
        }
        what = trigger["connection"] or kind.value
        self._open = _Open(incident_name(utc, what), now_ns + _AFTER_NS, head)

    def _close(self, opened: _Open) -> None:
        """End the window: complete the head with the facts known now."""
        self._open = None
        session = self._session
        head = (
            opened.head
            | snapshot_json(session.core.snapshot(), session.records)
            | {
                "subdevices": subdevices_json(
                    session.core, session.records, session.absent, session.returns
                ),
                "events": list(self._events),
                "layout": layout_json(
                    session.core,
                    session.plan,
                    session.records,
                    len(self._last.image) if self._last else 0,
                ),
                "fsoe": fsoe_json(session.network),
            }
        )
        rows = list(self._ring.rows)
        if self._background:
            thread = threading.Thread(
                target=self._write, args=(opened.name, head, rows), name="incident"
            )
            self._threads.append(thread)
            thread.start()
        else:
            self._write(opened.name, head, rows)

    def _write(self, name: str, head: dict[str, Any], rows: list[CycleRecord]) -> None:
        done = write_incident(self._folder, name, head, rows)
        written = f"{done.path}: {head['trigger']['text']}" if done.path else ""
        with self._lock:
            if done.path is not None:
                self.files.append(done.path)
            self._outcome += [line for line in (written, done.fault) if line]

    def _tell(self, now_ns: int) -> None:
        with self._lock:
            lines, self._outcome = self._outcome, []
        for line in lines:
            self._session.engine.log(now_ns, "incident", line)

    def _utc(self, now_ns: int) -> str:
        passed = timedelta(microseconds=(now_ns - (self._base_ns or 0)) / 1000)
        return (self._start + passed).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z"
