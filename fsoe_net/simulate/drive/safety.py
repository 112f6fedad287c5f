"""Safety functions of an emulated drive: STO, SS1, SLS (IEC 61800-5-2)."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SafeDemand:
    """The current request of the safe data; ``sls_speeds`` are the requested limits in rad/s."""

    sto: bool = False
    ss1: bool = False
    sls_speeds: Sequence[float] = ()
    acknowledge: bool = False


class _Stop(enum.Enum):
    NO = enum.auto()
    RAMP = enum.auto()
    OFF = enum.auto()


@dataclass(slots=True)
class SafeDrive:
    """Effect of the safety functions on the axis.

    STO removes the torque immediately. SS1 stops the axis and then removes the torque, at the
    latest after its time. SLS limits the speed and monitors it after its delay. A violation starts
    an SS1 that remains until it is acknowledged, or until STO was requested and released.

    Args:
        ss1_ns: Longest time of an SS1.
        sls_delay_ns: Time to slow down before the limit is monitored.
    """

    ss1_ns: int
    sls_delay_ns: int
    violated: bool = False
    # A drive begins without torque.
    _stop: _Stop = _Stop.OFF
    _stopping_since_ns: int = 0
    _limit: float | None = None
    _limit_since_ns: int = 0
    _was_acknowledged: bool = False
    _now_ns: int = 0

    @property
    def torque_off(self) -> bool:
        """Whether the torque is off (STO)."""
        return self._stop is _Stop.OFF

    @property
    def stopping(self) -> bool:
        """Whether the axis must stop with a ramp (SS1)."""
        return self._stop is _Stop.RAMP

    @property
    def speed_limit(self) -> float | None:
        """Speed limit of the axis in rad/s."""
        return self._limit

    @property
    def limit_watched(self) -> bool:
        """Whether a speed limit is being monitored."""
        waited_ns = self._now_ns - self._limit_since_ns
        return self._limit is not None and waited_ns >= self.sls_delay_ns

    def step(self, now_ns: int, demand: SafeDemand, speed: float, *, standing: bool) -> None:
        """Process the request.

        Args:
            now_ns: Current time.
            demand: Request in the safe data.
            speed: Speed of the motor in rad/s.
            standing: Whether the ramp that stops the axis has ended.
        """
        self._now_ns = now_ns
        # Supervision first: a violation in this step must stop the axis in this step.
        self._watch(demand, speed)
        # STO acts immediately and has priority over a ramp.
        if demand.sto:
            self._stop = _Stop.OFF
        elif demand.ss1 or self.violated:
            if self._stop is _Stop.NO:
                self._stop, self._stopping_since_ns = _Stop.RAMP, now_ns
            elif self._stop is _Stop.RAMP and (
                # SS1 ends at standstill or after its time, whichever comes first.
                standing or now_ns - self._stopping_since_ns >= self.ss1_ns
            ):
                self._stop = _Stop.OFF
        else:
            self._stop = _Stop.NO

    def _watch(self, demand: SafeDemand, speed: float) -> None:
        edge = demand.acknowledge and not self._was_acknowledged
        self._was_acknowledged = demand.acknowledge
        # An edge: a button that is held would acknowledge each violation.
        if demand.sto or edge:
            self.violated = False
        limit = min(demand.sls_speeds, default=None)
        # A lower limit gives the axis time to brake before it is monitored.
        if limit is not None and (self._limit is None or limit < self._limit):
            self._limit_since_ns = self._now_ns
        self._limit = limit
        if self.limit_watched and limit is not None and abs(speed) > limit * _TOLERANCE:
            self.violated = True


_TOLERANCE = 1.02  # control overshoots slightly; a safe encoder has a limited resolution
