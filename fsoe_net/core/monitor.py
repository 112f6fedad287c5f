"""The passive monitor of the C core."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from fsoe_net.core.module import compiled
from fsoe_net.core.snapshot import DirectionSnapshot
from fsoe_net.errors import PduSizeError
from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict
from fsoe_net.fsoe.parameters import FsoeParameters
from fsoe_net.fsoe.pdu import frame_length

_VERDICTS = tuple(CrcVerdict)
_STATES = tuple(ConnectionState)


class Monitor:
    """Follows both directions of one connection; index 0 is main to sub, 1 is sub to main.

    Args:
        safe_out_bytes: Safe data bytes from main to sub.
        safe_in_bytes: Safe data bytes from sub to main.

    Raises:
        CoreMissing: The compiled part is missing.
    """

    def __init__(self, safe_out_bytes: int, safe_in_bytes: int) -> None:
        ffi, self._lib = compiled()
        self._sizes = frame_length(safe_out_bytes), frame_length(safe_in_bytes)
        self._monitor = ffi.new("struct fsn_monitor *")
        self._lib.fsn_monitor_init(self._monitor, *self._sizes)

    @property
    def state(self) -> ConnectionState:
        """State of the connection as seen from outside."""
        observed: int = self._monitor.status.observed
        return _STATES[observed]

    @property
    def gaps(self) -> int:
        """How often the chain was lost and found without a Reset: frames were not observed."""
        return int(self._monitor.status.gaps)

    @property
    def parameters(self) -> FsoeParameters:
        """The parameters that the main sent in its last start-up."""
        return parameters_of(self._monitor.status.parameters)

    def counts(self, direction: int) -> DirectionSnapshot:
        """Return the current counters of a direction."""
        return direction_snapshot(self._monitor.status.direction[direction])

    def sequence(self, direction: int) -> int:
        """Return the number of the next frame of a direction; 0 if unknown."""
        return int(self._monitor.followed[direction].sequence)

    def frame(self, direction: int, data: bytes, now_ns: int) -> CrcVerdict:
        """Check the image of one direction.

        Args:
            direction: 0 main to sub, 1 sub to main.
            data: The bytes, as long as the frames of this direction.
            now_ns: Time of the observation.

        Raises:
            PduSizeError: No FSoE frame of this direction has this length.
        """
        if len(data) != self._sizes[direction]:
            raise PduSizeError(f"{len(data)} bytes; frames here have {self._sizes[direction]}")
        verdict: int = self._lib.fsn_monitor_frame(self._monitor, direction, data, now_ns)
        return _VERDICTS[verdict]


def direction_snapshot(d: Any) -> DirectionSnapshot:
    """Return the values of a `struct fsn_direction`."""
    return DirectionSnapshot(**{f.name: getattr(d, f.name) for f in fields(DirectionSnapshot)})


def parameters_of(c: Any) -> FsoeParameters:
    """Return the values of a ``struct fsn_parameters``; unknown ones are ``None``."""
    return FsoeParameters(
        connection_id=c.connection_id if c.known & 1 else None,
        address=c.address if c.known & 2 else None,
        watchdog_ms=c.watchdog_ms if c.known & 4 else None,
        app_bytes=c.app_bytes if c.known & 8 else None,
        app_crc=c.app_crc if c.known & 8 else None,
    )
