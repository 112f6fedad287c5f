"""Client of the control socket of ``fsn-master``: a typed method for each of its requests."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from typing import TypeVar

from fsoe_net.core.bus_documents import (
    BusSnapshot,
    Layout,
    SubDeviceSnapshot,
    read_connections,
    read_layout,
    read_snapshot,
    read_subdevice,
)
from fsoe_net.core.json_object import JsonObject, ReplyObject
from fsoe_net.core.snapshot import ConnectionSnapshot
from fsoe_net.errors import EnvironmentFault
from fsoe_net.live.control_link import ControlLink
from fsoe_net.live.control_values import (
    BusState,
    HistoryMessage,
    ScanReply,
    SdoValue,
    Status,
    Symbol,
    Value,
    Values,
    WatchedCycle,
    read_history,
    read_scan,
    read_sdo,
    read_state,
    read_status,
    read_symbols,
    read_values,
    read_watched,
)
from fsoe_net.live.realtime import RealTime

ACYCLIC_S = 70.0
"""fsn-master ends a mailbox exchange after 60 s; others may be queued before it."""
# A bus of hundreds of SubDevices needs minutes.
SCAN_S = 600.0
_SILENT_S = 5.0
_T = TypeVar("_T")


class Client(ControlLink):
    """A connection to one ``fsn-master``; a context manager. One thread at a time.

    Methods by purpose:

    - State of the bus: `status`, `snapshot`, `connections`, `subdevices`, `symbols`, `layout`,
      `scan`.
    - Values: `get`, `set`, `arm`, `lease`, `renew`; every cycle with `watch` or, in your own loop,
      `watch_on`, `watched` and `watch_off`; `realtime` for a real-time client.
    - Events: `subscribe`, `events`.
    - SDO and the memory of a SubDevice: `sdo_read`, `sdo_write`, `history`, `sii_read`,
      `alias_write`.
    - Control: `start`, `stop`, `restart`, `shutdown`, `hold`, `resume`, `incident`.

    Every method raises `ControlRefused` if the request is refused, with the reason and the next
    step, and `EnvironmentFault` if the connection breaks or no reply arrives.

    Args:
        path: Control socket of ``fsn-master``.
        timeout_s: Timeout of a connection attempt or a reply.

    Raises:
        EnvironmentFault: No answer, no permission to connect, or the peer uses another protocol.
    """

    # -- state of the bus -------------------------------------------------------------------------

    def status(self) -> Status:
        """Return the state of program and bus."""
        return self._read(self.request("status"), read_status)

    def snapshot(self) -> BusSnapshot:
        """Return counters, connections and SubDevices; each page of a large bus is one cycle.

        Raises:
            ControlRefused: The bus is stopped.
        """
        return self._document("snapshot", read_snapshot)

    def connections(self) -> tuple[ConnectionSnapshot, ...]:
        """Return the FSoE connections with their names; errors as in `snapshot`."""
        return self._document("snapshot", read_connections)

    def subdevices(self) -> tuple[SubDeviceSnapshot, ...]:
        """Return the known facts about each SubDevice."""
        return self._document(
            "subdevices", lambda reply: tuple(map(read_subdevice, reply.children("subdevices")))
        )

    def symbols(self) -> tuple[Symbol, ...]:
        """Return the named inputs and outputs, with the writer of each output."""
        return self._read(self.request_all("symbols"), read_symbols)

    def layout(self) -> Layout:
        """Return the layout of the process image."""
        return self._document("layout", read_layout)

    def scan(self) -> ScanReply:
        """Return the SubDevices found on the bus, independent of the plan."""
        return self._read(self.request("scan", timeout_s=SCAN_S), read_scan)

    def _document(self, request: str, read: Callable[[JsonObject], _T]) -> _T:
        return self._read(self.request_all(request), lambda reply: read(ReplyObject(reply)))

    # -- values -----------------------------------------------------------------------------------

    def get(self, *names: str, typed: bool = False) -> Values:
        """Return values of one cycle, raw or with factor and offset."""
        return self._read(self.request("get", *_typed(typed), *names), read_values)

    def set(self, values: Mapping[str, Value | str], *, typed: bool = False) -> int:
        """Write outputs, all in one cycle or none; return their number.

        This client owns them until its lease ends: see `renew`.
        """
        words = [f"{name}={value_text(value)}" for name, value in values.items()]
        return self._read(self.request("set", *_typed(typed), *words), lambda r: int(r["set"]))

    def arm(self, name: str) -> int:
        """Allow one change of an output that can restart a machine; return the time limit in ms."""
        return self._read(self.request("arm", name), lambda r: int(r["for_ms"]))

    def lease(self, lease_ms: int) -> int:
        """Set the silence after which this client's outputs fall back; 0 for never."""
        return self._read(self.request("lease", str(lease_ms)), lambda r: int(r["lease_ms"]))

    def renew(self) -> None:
        """Renew the lease, as every request does."""
        self.request("hello")

    def realtime(self, *outputs: str, misses: int = 3, plan_sha256: str = "") -> RealTime:
        """Enter the cycle with a separate connection: read all inputs, write own outputs.

        Args:
            outputs: Names of the outputs to write; a name may end in ``*``. Without names, the
                client only reads.
            misses: Permitted number of consecutive cycles without new outputs. After one more, the
                outputs take their stop values and the client must enter again.
            plan_sha256: The expected plan, as in `Status.plan_sha256`; empty for any.

        Raises:
            ControlRefused: An output is in use, another plan is loaded, or the bus is stopped.
            CoreMissing: The compiled part is missing.
        """
        return RealTime(
            self.path,
            outputs,
            misses=misses,
            plan_sha256=plan_sha256,
            timeout_s=self._timeout_s,
        )

    # -- values of each cycle ---------------------------------------------------------------------

    def watch(
        self,
        *names: str,
        every: int = 1,
        typed: bool = False,
        image: bool = False,
        duration_s: float | None = None,
    ) -> Iterator[WatchedCycle]:
        """Yield every N-th cycle; arguments as in `watch_on`. Ends after ``duration_s``, if given.

        The time counts from the subscription. Cycles are read at least once.

        ``skipped`` of a cycle is the number of missing cycles before it. Reading does not renew the
        lease; use `renew`.

        Raises:
            EnvironmentFault: No cycle for 5 s.
        """
        self.watch_on(*names, every=every, typed=typed, image=image)
        left_s = math.inf if duration_s is None else duration_s
        until = time.monotonic() + left_s
        try:
            while True:
                # At least one read even if the duration is 0: cycles that have arrived must not be
                # lost.
                found = self.watched(min(_SILENT_S, max(0.0, left_s)))
                # Only a complete silent interval is an error: a read may also end early at the end
                # of the time.
                if not found and left_s >= _SILENT_S:
                    raise EnvironmentFault(
                        f"no cycle has come for {_SILENT_S:g} s on {self.path}; `status` shows "
                        "whether the bus is stopped"
                    )
                yield from found
                left_s = until - time.monotonic()
                if left_s <= 0:
                    return
        finally:
            # A broken connection has no subscription left; `watch_off` would hide the first error.
            if not self.closed:
                self.watch_off()

    def watch_on(
        self, *names: str, every: int = 1, typed: bool = False, image: bool = False
    ) -> None:
        """Subscribe to every N-th cycle; `watched` returns them.

        Args:
            names: Symbols to watch; a name may end in ``*``.
            every: The number N.
            typed: Whether factor and offset are applied.
            image: Whether to return the whole image instead of values.
        """
        form = ["--image"] if image else _typed(typed)
        self.request("watch", str(every), *form, *names)

    def watched(self, wait_s: float = 0.0) -> list[WatchedCycle]:
        """Return the watched cycles received; wait at most ``wait_s`` for the first one."""
        rows, lost = self._wait_cycles(wait_s)
        found = []
        for row in rows:
            dropped, lost = lost, 0
            found.append(self._read(row, lambda r, n=dropped: read_watched(r, n)))  # type: ignore[misc]
        return found

    def watch_off(self) -> None:
        """End the subscription of `watch_on`."""
        self.request("watch", "off")
        self._wait_cycles(0.0)

    # -- SDO and the memory of a SubDevice --------------------------------------------------------

    def sdo_read(self, subdevice: str, index: int, subindex: int, kind: str = "") -> SdoValue:
        """Read an object; ``kind`` as in control-protocol.md, e.g. ``uint16``."""
        words = ["sdo-read", subdevice, f"{index:#06x}", str(subindex), *([kind] if kind else [])]
        return self._read(self.request(*words, timeout_s=ACYCLIC_S), read_sdo)

    def sdo_write(
        self, subdevice: str, index: int, subindex: int, *, kind: str, value: Value | str
    ) -> None:
        """Write an object of a type, e.g. ``uint16``."""
        words = ["sdo-write", subdevice, f"{index:#06x}", str(subindex), kind, value_text(value)]
        self.request(*words, timeout_s=ACYCLIC_S)

    def history(self, subdevice: str) -> tuple[HistoryMessage, ...]:
        """Return the diagnosis history, object 0x10F3."""
        return self._read(
            self.request("history", subdevice, timeout_s=ACYCLIC_S),
            read_history,
        )

    def sii_read(self, subdevice: str) -> bytes:
        """Return the whole SII memory."""
        reply = self.request("sii-read", subdevice, timeout_s=ACYCLIC_S)
        return self._read(reply, lambda r: bytes.fromhex(r["data"]))

    def alias_write(self, subdevice: str, alias: int) -> None:
        """Write the station alias to the SII; it takes effect after a power cycle."""
        self.request("alias-write", subdevice, str(alias), timeout_s=ACYCLIC_S)

    # -- control ----------------------------------------------------------------------------------

    def start(self) -> BusState:
        """Begin to open the bus; `status` and ``state`` events report the progress."""
        return self._read(self.request("start"), read_state)

    def stop(self) -> BusState:
        """Begin to stop the bus; not an emergency stop."""
        return self._read(self.request("stop"), read_state)

    def restart(self) -> BusState:
        """Stop, then start with the same plan."""
        return self._read(self.request("restart"), read_state)

    def shutdown(self) -> BusState:
        """Stop, then end the program."""
        return self._read(self.request("shutdown"), read_state)

    def hold(self) -> BusState:
        """Begin maintenance: no standby takes over until `resume`."""
        return self._read(self.request("hold"), read_state)

    def resume(self) -> BusState:
        """End maintenance."""
        return self._read(self.request("resume"), read_state)

    def incident(self, text: str = "") -> str:
        """Request an incident file; return its name, empty while unknown."""
        reply = self.request("incident", *([text] if text else []))
        return str(reply.get("file") or "")


def value_text(value: Value | str) -> str:
    """Return a value in the notation of a request."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


def _typed(typed: bool) -> list[str]:
    return ["--typed"] if typed else []
