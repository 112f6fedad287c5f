"""Modes of operation of an emulated axis: each sets a reference or a torque in every time step."""

from __future__ import annotations

import abc
import math
from dataclasses import dataclass

from fsoe_net.simulate.drive.objects import AxisObjects
from fsoe_net.simulate.drive.servo import Limits, Servo

TARGET_REACHED, BIT_12, BIT_13 = 1 << 10, 1 << 12, 1 << 13
_SMOOTH = 0.08  # share of the deviation from the expected target that is corrected in a cycle
_NEW_SET_POINT, _AT_ONCE, _RELATIVE = 1 << 4, 1 << 5, 1 << 6


@dataclass(slots=True)
class MotionContext:
    """Context of a mode.

    Attributes:
        origin: Angle in rad at which the axis shows 0.
        counts_per_rad: Counts per rad of the displayed position.
        switches: Negative limit, positive limit, home switch.
    """

    objects: AxisObjects
    servo: Servo
    limits: Limits
    counts_per_rad: float
    torque_nm_per_mille: float
    origin: float = 0.0
    switches: tuple[bool, bool, bool] = (False, False, False)

    def rad(self, index: int, subindex: int = 0) -> float:
        """Return a length, speed or acceleration in rad."""
        return self.objects.value(index, subindex) / self.counts_per_rad

    def ramp(self, index: int) -> float:
        """Return an acceleration, never 0, which would not reach any target."""
        return max(abs(self.rad(index)), 1 / self.counts_per_rad)

    def angle_of(self, counts: int) -> float:
        """Return the angle of a position in counts: the nearest of those with the same 32 bits."""
        shown = self.shown(self.servo.plant.angle)
        away = (counts - shown + (1 << 31)) % (1 << 32) - (1 << 31)
        return (shown + away) / self.counts_per_rad + self.origin

    def shown(self, angle: float) -> int:
        """Return the position in counts, not yet wrapped to 32 bits."""
        return round((angle - self.origin) * self.counts_per_rad)

    def within_limits(self, angle: float) -> float:
        """Return the nearest angle that is within the position limits (0x607D)."""
        low, high = (self.objects.value(0x607D, n) for n in (1, 2))
        # Both are 0 where the setup has no limits.
        if low >= high:
            return angle
        counts = self.counts_per_rad
        return max(low / counts + self.origin, min(high / counts + self.origin, angle))


class ModeBase(abc.ABC):
    """A mode; created again when the mode changes and when operation is enabled."""

    watches_error = False
    """Whether a following error is a fault."""
    minds_switches = False
    """Whether a limit switch stops it, as it has no target for position limits to clip."""

    def __init__(self, context: MotionContext) -> None:
        self.c = context

    @abc.abstractmethod
    def command(self, controlword: int, passed_s: float) -> None:
        """Process the received values.

        Args:
            controlword: Current controlword.
            passed_s: Duration of this step of the device.
        """

    @abc.abstractmethod
    def move(self, step_s: float) -> None:
        """Advance by a time step."""

    @abc.abstractmethod
    def bits(self) -> int:
        """Return the bits of the mode in the statusword."""


class NoMode(ModeBase):
    """No mode: the axis holds its position."""

    def command(self, controlword: int, passed_s: float) -> None:
        """Ignore the command."""

    def move(self, step_s: float) -> None:
        """Stop and hold."""
        ramp = self.c.ramp(0x6084)
        self.c.servo.ramp(0.0, ramp, ramp, step_s)
        self.c.servo.follow(self.c.limits, step_s)

    def bits(self) -> int:
        """Return no bits."""
        return 0


class CyclicPosition(ModeBase):
    """CSP: the target of each cycle.

    A device that is not synchronous with the bus occasionally reads one target twice and misses the
    next one. The target is smoothed so that this does not shake the motor. A target that moves at
    constant speed is followed without lag.
    """

    watches_error = True

    def __init__(self, context: MotionContext) -> None:
        super().__init__(context)
        self._angle, self._speed = context.servo.angle, context.servo.speed
        self._left_s = 0.0
        self._cut = False

    def command(self, controlword: int, passed_s: float) -> None:
        """Read the target and its offset."""
        c = self.c
        wanted = c.angle_of(c.objects.value(0x607A) + c.objects.value(0x60B0))
        target = c.within_limits(wanted)
        self._cut = target != wanted
        if passed_s <= 0:
            return
        # Targets received in a step longer than a cycle are as old as several targets.
        weight = min(1.0, _SMOOTH * passed_s / c.objects.interpolation_s)
        expected = self._angle + self._speed * passed_s
        away = target - expected
        self._angle = expected + weight * away
        self._speed += weight**2 / (2 - weight) * away / passed_s
        self._left_s = passed_s

    def move(self, step_s: float) -> None:
        """Move to the expected target at the end of this step of the device."""
        servo = self.c.servo
        servo.interpolate(self._angle, self._speed, max(self._left_s, step_s), step_s)
        self._left_s -= step_s
        servo.follow(self.c.limits, step_s)
        servo.limited |= self._cut

    def bits(self) -> int:
        """Return bit 12: the target is followed, whatever limits it."""
        return BIT_12


class CyclicVelocity(ModeBase):
    """CSV: the speed of each cycle."""

    minds_switches = True

    def __init__(self, context: MotionContext) -> None:
        super().__init__(context)
        self._speed = 0.0

    def command(self, controlword: int, passed_s: float) -> None:
        """Read the target and its offset."""
        self._speed = self.c.rad(0x60FF) + self.c.rad(0x60B1)

    def move(self, step_s: float) -> None:
        """Control the speed."""
        servo = self.c.servo
        # The reference follows the motor, so that the next mode begins at its position.
        servo.angle, servo.speed, servo.rate = servo.plant.angle, self._speed, 0.0
        servo.control_speed(self._speed, self.c.limits, step_s)

    def bits(self) -> int:
        """Return bit 12: the target is followed, whatever limits it."""
        return BIT_12


class CyclicTorque(ModeBase):
    """CST: the torque of each cycle."""

    minds_switches = True

    def __init__(self, context: MotionContext) -> None:
        super().__init__(context)
        self._torque_nm = 0.0

    def command(self, controlword: int, passed_s: float) -> None:
        """Read the target and its offset."""
        objects = self.c.objects
        per_mille = objects.value(0x6071) + objects.value(0x60B2)
        self._torque_nm = per_mille * self.c.torque_nm_per_mille

    def move(self, step_s: float) -> None:
        """Apply the torque."""
        self.c.servo.control_torque(self._torque_nm, self.c.limits, step_s)
        self.c.servo.take_over()

    def bits(self) -> int:
        """Return bit 12: the target is followed, whatever limits it."""
        return BIT_12


class ProfileVelocity(ModeBase):
    """PV: ramps to a speed."""

    minds_switches = True

    def __init__(self, context: MotionContext) -> None:
        super().__init__(context)
        self._speed = 0.0

    def command(self, controlword: int, passed_s: float) -> None:
        """Read the target."""
        limit = self.c.limits.speed
        self._speed = max(-limit, min(limit, self.c.rad(0x60FF)))

    def move(self, step_s: float) -> None:
        """Ramp the speed."""
        c = self.c
        c.servo.ramp(self._speed, c.ramp(0x6083), c.ramp(0x6084), step_s)
        c.servo.follow(c.limits, step_s)

    def bits(self) -> int:
        """Return target reached, and bit 12: the speed is 0."""
        servo = self.c.servo
        reached = servo.speed == self._speed and math.isclose(
            servo.plant.speed, self._speed, rel_tol=0.01, abs_tol=0.05
        )
        return TARGET_REACHED * reached | BIT_12 * (servo.speed == 0.0)


class ProfilePosition(ModeBase):
    """PP: moves to a set-point with a trapezoidal speed profile; one more set-point can wait.

    Bit 4 of the controlword is set with a new set-point. Bit 12 of the statusword acknowledges it
    until bit 4 is cleared and there is room for another one.
    """

    watches_error = True

    def __init__(self, context: MotionContext) -> None:
        super().__init__(context)
        self._goal: float | None = None
        self._next: float | None = None
        self._was_new = True  # an edge before the mode does not count
        self._acknowledged = False

    def command(self, controlword: int, passed_s: float) -> None:
        """Read a new set-point."""
        # A set-point counts on the rising edge of bit 4 after the last one was acknowledged (CiA
        # 402).
        new = bool(controlword & _NEW_SET_POINT)
        if new and not self._was_new and not self._acknowledged:
            self._take(controlword)
        self._was_new = new
        # The acknowledge bit is cleared when bit 4 is cleared and a buffer for the next set-point
        # is free.
        if not new and self._next is None:
            self._acknowledged = False

    def _take(self, controlword: int) -> None:
        c = self.c
        last = c.servo.angle if self._goal is None else self._goal
        if controlword & _RELATIVE:
            goal = last + c.rad(0x607A)
        else:
            goal = c.angle_of(c.objects.value(0x607A))
        goal = c.within_limits(goal)
        self._acknowledged = True
        if controlword & _AT_ONCE or self._reached():
            self._goal, self._next = goal, None
        else:
            self._next = goal

    def _reached(self) -> bool:
        servo = self.c.servo
        return self._goal is None or (servo.angle == self._goal and servo.speed == 0.0)

    def move(self, step_s: float) -> None:
        """Advance by a time step."""
        c = self.c
        if self._next is not None and self._reached():
            self._goal, self._next = self._next, None
        rise, fall = c.ramp(0x6083), c.ramp(0x6084)
        if self._goal is None:
            c.servo.ramp(0.0, rise, fall, step_s)
        else:
            top = min(abs(c.rad(0x6081)), c.limits.speed)
            c.servo.profile(self._goal, top, rise, fall, step_s)
        c.servo.follow(c.limits, step_s)

    def bits(self) -> int:
        """Return target reached and the acknowledgement."""
        settled = self._reached() and abs(self.c.servo.error) * self.c.counts_per_rad < 16
        return TARGET_REACHED * settled | BIT_12 * self._acknowledged
