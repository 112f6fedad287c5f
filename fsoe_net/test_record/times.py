"""Times of the loss of a SubDevice, out of the events of a running ``fsn-master``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from fsoe_net.fsoe.observed import ConnectionState


class LossTimes:
    """From the first bus cycle without a SubDevice until its connections have left Data.

    ``now_ns`` of these events is the start of the bus cycle that showed them. A connection with
    both ends off the bus shows nothing of its reaction: it only falls silent, and has no time.

    Args:
        own: Names of its connections.
    """

    def __init__(self, own: Iterable[str]) -> None:
        self._own = frozenset(own)
        self._lost_ns: int | None = None
        self._left_ns: dict[str, int] = {}
        self._silent: set[str] = set()
        self.interruptions = 0
        """How often the working counter was incomplete and whole again before the loss."""

    def take(self, event: Mapping[str, Any]) -> None:
        """Take what was reported."""
        kind, now_ns = event.get("event"), event.get("now_ns")
        if not isinstance(now_ns, int):
            return
        if kind == "wkc":
            self._working_counter(bool(event.get("complete")), now_ns)
        elif kind == "connection":
            self._connection(event, now_ns)

    def _working_counter(self, complete: bool, now_ns: int) -> None:
        if not complete:
            self._lost_ns = now_ns if self._lost_ns is None else self._lost_ns
        elif self._lost_ns is not None:
            self._lost_ns = None
            self.interruptions += 1

    def _connection(self, event: Mapping[str, Any], now_ns: int) -> None:
        name = str(event.get("connection"))
        before, after = (
            ConnectionState.from_event(str(event.get(key))) for key in ("before", "after")
        )
        if name not in self._own or not before.in_data or after.in_data:
            return
        if after is ConnectionState.SILENT:
            self._silent.add(name)
        else:
            self._left_ns[name] = now_ns

    @property
    def silent(self) -> list[str]:
        """Connections that only fell silent."""
        return sorted(self._silent - self._left_ns.keys())

    def took_ms(self) -> float | None:
        """Return the time of the slowest connection, ms; ``None`` when it was not seen."""
        if self._lost_ns is None or not self._left_ns:
            return None
        if self._left_ns.keys() | self._silent != self._own:
            return None
        took_ns = max(self._left_ns.values()) - self._lost_ns
        return took_ns / 1e6 if took_ns >= 0 else None
