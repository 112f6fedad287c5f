"""Updates for a live page from any source: one thread reads, pages listen, the history is kept."""

from __future__ import annotations

import abc
import contextlib
import itertools
import secrets
import threading
from collections import deque
from collections.abc import Iterable, Iterator, Sequence

from fsoe_net.diag.printable import printable
from fsoe_net.errors import InputError
from fsoe_net.live.result import RunEvent
from fsoe_net.studio.live_rows import Row, event_row

PICTURE_S = 0.05
"""Between two updates while a page listens."""
ALONE_S = 1.0
"""Between two updates while no page listens."""
KEPT_EVENTS = 50_000
MOST_SIGNALS = 20
_SCOPE_MS = 10_000.0
_SCOPE_ROWS = 200_000  # 10 s at the shortest bus cycle


class EventHistory:
    """Events in order, counted from 0; the oldest are dropped if there are too many."""

    def __init__(self) -> None:
        self._rows: deque[tuple[RunEvent, Row]] = deque(maxlen=KEPT_EVENTS)
        self._lock = threading.Lock()
        self._total = 0

    def add(self, events: Iterable[RunEvent]) -> None:
        """Append events."""
        rows = [(event, _printed_row(event_row(event))) for event in events]
        with self._lock:
            self._rows.extend(rows)
            self._total += len(rows)

    def since(self, number: int) -> tuple[Row, int]:
        """Return the events from a number on, the number of dropped ones, the next number."""
        with self._lock:
            gone = self._total - len(self._rows)
            # A page may ask for events that are no longer kept, or for numbers of another source.
            first = min(max(number, gone), self._total)
            total = self._total
            # From the end, because a deque is slow in its middle.
            rows = list(itertools.islice(reversed(self._rows), total - first))
        events = [row for _, row in reversed(rows)]
        return {"first": first, "left_out": gone, "events": events}, total

    def kept(self) -> tuple[tuple[RunEvent, ...], int]:
        """Return the stored events, and the number of dropped ones."""
        with self._lock:
            return tuple(event for event, _ in self._rows), self._total - len(self._rows)


class ScopeRing:
    """Values of some signals in every cycle of the last ten seconds.

    Args:
        names: Names of the signals.
        choice: Number of this selection of signals.
    """

    def __init__(self, names: Sequence[str] = (), choice: int = 0) -> None:
        self.names, self.choice = tuple(names), choice
        self.skipped = 0
        """Missing cycles, because the reader was too slow."""
        self.fault = ""
        self._rows: deque[tuple[float | None, ...]] = deque(maxlen=_SCOPE_ROWS)
        self._lock = threading.Lock()
        self._total = 0

    def add(self, time_ms: float, values: Iterable[float | None]) -> None:
        """Append the values of a cycle, in the order of the names."""
        with self._lock:
            if self._rows and time_ms <= (self._rows[-1][0] or 0.0):
                self._rows.clear()  # another run of the bus
            self._rows.append((time_ms, *values))
            self._total += 1
            while (self._rows[0][0] or 0.0) < time_ms - _SCOPE_MS:
                self._rows.popleft()

    def since(self, choice: int, number: int) -> tuple[Row, int]:
        """Return the rows missing in a page with this selection and number, and the new number.

        A row is a time in milliseconds, followed by the values.
        """
        with self._lock:
            first = max(number if choice == self.choice else 0, self._total - len(self._rows))
            rows = list(itertools.islice(reversed(self._rows), self._total - first))
            total = self._total
        row: Row = {
            "choice": self.choice,
            "signals": [printable(name) for name in self.names],
            "skipped": self.skipped,
            "fault": printable(self.fault),
            "first": first,
            "rows": rows[::-1],
        }
        return row, total


class LiveFeed(abc.ABC):
    """One source of live updates, with its own thread.

    Attributes:
        run: Identifies the run; another run has another value.
        history: Past events.
        scope: Values of the chosen signals.
        listeners: Pages that are listening.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.run = secrets.token_hex(8)
        self.history, self.scope = EventHistory(), ScopeRing()
        self.listeners = 0
        self.picture = 0
        self._view: Row = {}
        self._ending, self._wake = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"live {source}", daemon=True)

    def start(self) -> None:
        """Start reading."""
        self._thread.start()

    def close(self) -> None:
        """Stop; the collected data are kept."""
        self._ending.set()
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join()

    @property
    def closed(self) -> bool:
        """Whether there will be no new data."""
        return self._ending.is_set()

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Count a listening page until the block ends."""
        self.listeners += 1
        self._wake.set()
        try:
            yield
        finally:
            self.listeners -= 1

    def message(self, event: int, choice: int, row: int) -> tuple[Row, int, int, int]:
        """Return the newest update with the data missing in a page, and its new state.

        Args:
            event: Number of the first missing event.
            choice: The selection of signals in the page.
            row: Number of the first missing row of the scope.

        Returns:
            The update, followed by the arguments for the next call.
        """
        # Read once, because `choose` may replace it in the meantime.
        ring = self.scope
        scope, rows = ring.since(choice, row)
        events, known = self.history.since(event)
        return {**self._view, **events, "scope": scope}, known, ring.choice, rows

    def choose(self, names: Sequence[str]) -> None:
        """Show other signals in the scope.

        Raises:
            InputError: Unknown signal, or too many.
        """
        known = {str(row["name"]) for row in self.signals()}
        unknown = [name for name in names if name not in known]
        if unknown:
            raise InputError(f"unknown signal {unknown[0]!r}; the list shows all signals")
        if len(names) > MOST_SIGNALS:
            raise InputError(f"at most {MOST_SIGNALS} signals at once; take one away first")
        self.scope = ScopeRing(tuple(dict.fromkeys(names)), self.scope.choice + 1)
        self._wake.set()

    @abc.abstractmethod
    def signals(self) -> list[Row]:
        """Return the signals available in the scope: ``name``, ``label``, ``unit``."""

    @abc.abstractmethod
    def machine(self) -> Row:
        """Return the picture of SubDevices and cables: facts that stay the same for a plan."""

    @abc.abstractmethod
    def document(self) -> Row:
        """Return the observations as the command would write them."""

    @abc.abstractmethod
    def _run(self) -> None:
        """Read until `close`."""

    def _publish(self, view: Row) -> None:
        base: Row = {"run": self.run, "source": self.source}
        self._view = base | _printed_row(view)
        self.picture += 1


def _printed_row(row: Row) -> Row:
    return {key: printed(value) for key, value in row.items()}


def printed(value: object) -> object:
    """Return plain JSON values with printable texts."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, dict):
        return {key: printed(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [printed(inner) for inner in value]
    return value
