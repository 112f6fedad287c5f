"""Follows one ``fsn-master`` in a thread, so that a slow or absent one delays no other."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from fsoe_net.errors import EnvironmentFault
from fsoe_net.fleet.labels import reset_code_name
from fsoe_net.live.attachment import Attachment, BusView
from fsoe_net.live.result import RunEvent, RunEventKind

LOOK_S = 1.0
"""Interval of the snapshots."""
MAX_AGE_S = 10.0
"""Age from which a view counts as missing; a request to a healthy process ends earlier."""
RESET_ENDS = ("main", "sub", "unknown")


@dataclass(frozen=True, slots=True)
class ResetCause:
    """What an event reports about a Reset: the connection, the end that began it, and the code.

    ``end`` is one of `RESET_ENDS`, ``code`` one of `labels.RESET_CODES`.
    """

    connection: str
    end: str
    code: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MasterReading:
    """The last view of one master; ``None`` without a recent one."""

    name: str
    view: BusView | None
    resets: Mapping[ResetCause, int] = field(default_factory=dict)

    @property
    def up(self) -> bool:
        """Whether the process answers."""
        return self.view is not None and not self.view.away


class MasterWatcher:
    """Takes a snapshot every second.

    Args:
        name: Name for readers.
        locate: Returns the control socket; a restarted process can have another one.
    """

    def __init__(self, name: str, locate: Callable[[], str]) -> None:
        self.name = name
        self._locate = locate
        self._resets: Counter[ResetCause] = Counter()
        self._last: tuple[float, MasterReading] | None = None

    def reading(self) -> MasterReading:
        """Return the last reading, without a view if it is too old."""
        last = self._last
        if last is None or time.monotonic() - last[0] > MAX_AGE_S:
            return MasterReading(name=self.name, view=None)
        return last[1]

    def look_once(self) -> MasterReading:
        """Take one reading in this thread."""
        try:
            with Attachment(self._locate()) as attached:
                self._take(attached, attached.look(0.0))
        except EnvironmentFault:
            self._last = None
        return self.reading()

    def follow(self, stop: threading.Event) -> None:
        """Take readings until ``stop`` is set."""
        while not stop.is_set():
            try:
                with Attachment(self._locate(), details=True) as attached:
                    self._follow(attached, stop)
            except EnvironmentFault:
                self._last = None
            stop.wait(LOOK_S)

    def _follow(self, attached: Attachment, stop: threading.Event) -> None:
        self._resets.clear()
        while not stop.is_set():
            view = attached.look(LOOK_S, stop)
            self._take(attached, view)
            # The next process can have another socket.
            if view.away:
                return

    def _take(self, attached: Attachment, view: BusView) -> None:
        for event in attached.take_events():
            if event.kind is RunEventKind.RESET:
                self._resets[_cause(event)] += 1
        names = {connection.result.name for connection in view.connections}
        resets = {c: times for c, times in self._resets.items() if c.connection in names}
        self._resets = Counter(resets)
        reading = MasterReading(name=self.name, view=view, resets=resets)
        self._last = (time.monotonic(), reading)


def _cause(event: RunEvent) -> ResetCause:
    return ResetCause(
        connection=event.source,
        end=event.end if event.end in RESET_ENDS else RESET_ENDS[-1],
        code=reset_code_name(event.code),
    )
