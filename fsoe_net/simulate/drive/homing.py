"""Homing of an emulated axis: the position at which it shows the home offset (0x607C)."""

from __future__ import annotations

import enum

from fsoe_net.simulate.drive.modes import BIT_12, BIT_13, TARGET_REACHED, ModeBase, MotionContext

_START = 1 << 4
_NEGATIVE, _POSITIVE, _HOME = 0, 1, 2
# Method: switch, its state after the axis was sent towards it, direction towards it, and the
# direction in which the relevant edge is passed (IEC 61800-7-201, methods without index pulse).
_METHODS = {
    17: (_NEGATIVE, -1, +1),
    18: (_POSITIVE, +1, -1),
    19: (_HOME, +1, -1),
    20: (_HOME, +1, +1),
    21: (_HOME, -1, +1),
    22: (_HOME, -1, -1),
}
# Both use the current position as home; 35 is the older number.
_HERE = (35, 37)


class _Phase(enum.Enum):
    IDLE = enum.auto()
    SEEK = enum.auto()  # fast towards the switch
    LEAVE = enum.auto()  # slowly away from it
    APPROACH = enum.auto()  # slowly onto it
    STOP = enum.auto()
    DONE = enum.auto()
    FAILED = enum.auto()


class Homing(ModeBase):
    """Homing by methods 17 … 22, 35 and 37; any other is a homing error.

    Bit 4 of the controlword starts homing and interrupts it when it is cleared.
    """

    def __init__(self, context: MotionContext) -> None:
        super().__init__(context)
        self._phase = _Phase.IDLE
        self._was_started = True  # an edge before the mode does not count
        self._switch, self._towards, self._passing = _METHODS[17]

    def command(self, controlword: int, passed_s: float) -> None:
        """Start or interrupt."""
        start = bool(controlword & _START)
        if start and not self._was_started:
            self._begin()
        elif not start and self._phase not in (_Phase.DONE, _Phase.FAILED):
            self._phase = _Phase.IDLE
        self._was_started = start

    def _begin(self) -> None:
        method = self.c.objects.value(0x6098)
        if method in _HERE:
            self._set_home(self.c.servo.plant.angle)
            self._phase = _Phase.DONE
        elif method in _METHODS:
            self._switch, self._towards, self._passing = _METHODS[method]
            self._phase = _Phase.LEAVE if self.c.switches[self._switch] else _Phase.SEEK
        else:
            self._phase = _Phase.FAILED

    def move(self, step_s: float) -> None:
        """Advance by a time step."""
        c = self.c
        wanted = self._speed()
        ramp = c.ramp(0x609A)
        c.servo.ramp(wanted, ramp, ramp, step_s)
        c.servo.follow(c.limits, step_s)
        if self._phase is _Phase.STOP and c.servo.speed == 0.0:
            self._phase = _Phase.DONE

    def _speed(self) -> float:
        """Return the speed of the phase; a switch may change the phase."""
        c, towards = self.c, self._towards
        on = c.switches[self._switch]
        fast, slow = abs(c.rad(0x6099, 1)), abs(c.rad(0x6099, 2))
        if self._phase is _Phase.SEEK:
            # The end of travel is before the switch, so this homing method cannot succeed.
            if not on:
                end = c.switches[_POSITIVE if towards > 0 else _NEGATIVE]
                self._phase = _Phase.FAILED if end else _Phase.SEEK
                return 0.0 if end else towards * fast
            # From the switch, the axis first moves away, so that the edge is found at low speed.
            self._phase = _Phase.LEAVE
        if self._phase is _Phase.LEAVE:
            if on:
                return -towards * slow
            # The method needs the edge from the other side: approach it again.
            if self._passing != towards:
                return self._found()
            self._phase = _Phase.APPROACH
        if self._phase is _Phase.APPROACH:
            return self._found() if on else towards * slow
        return 0.0

    def _found(self) -> float:
        self._set_home(self.c.servo.plant.angle)
        self._phase = _Phase.STOP
        return 0.0

    def _set_home(self, angle: float) -> None:
        self.c.origin = angle - self.c.rad(0x607C)

    def bits(self) -> int:
        """Return target reached, attained (12) and error (13)."""
        standing = self.c.servo.speed == 0.0
        idle = self._phase in (_Phase.IDLE, _Phase.DONE, _Phase.FAILED)
        return (
            TARGET_REACHED * (idle and standing)
            | BIT_12 * (self._phase in (_Phase.STOP, _Phase.DONE))
            | BIT_13 * (self._phase is _Phase.FAILED)
        )
