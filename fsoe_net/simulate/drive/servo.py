"""Control of one emulated motor: a reference, and the torque that follows it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsoe_net.simulate.drive.plant import Plant

# For an ideal current loop; far below 1 / time step (250 us).
_POSITION_GAIN = 60.0  # 1/s
_SPEED_GAIN = 400.0  # 1/s
_AT_REST = 1e-4  # rad/s: below, friction is not compensated


@dataclass(slots=True)
class Limits:
    """Limits of a reference and of the torque: rad/s, N·m."""

    speed: float
    torque_positive_nm: float
    torque_negative_nm: float


@dataclass(slots=True)
class Servo:
    """Reference (``angle`` in rad, ``speed`` in rad/s) and the cascade that derives the torque.

    Attributes:
        limited: Whether a limit was reached in the last step.
        torque_nm: Torque of the last step.
    """

    plant: Plant
    angle: float = 0.0
    speed: float = 0.0
    rate: float = 0.0
    torque_nm: float = 0.0
    limited: bool = False

    def take_over(self) -> None:
        """Set the reference to the position of the motor."""
        self.angle, self.speed, self.rate = self.plant.angle, self.plant.speed, 0.0

    def take_speed(self) -> None:
        """Set the reference to the speed of the motor, for the ramp that begins here."""
        if abs(self.angle - self.plant.angle) * _POSITION_GAIN > 1.0:
            self.angle = self.plant.angle  # a lag is not caught up
        self.speed = self.plant.speed

    @property
    def error(self) -> float:
        """Following error in rad."""
        return self.angle - self.plant.angle

    # -- references -------------------------------------------------------------------------------

    def interpolate(self, angle: float, speed: float, left_s: float, step_s: float) -> None:
        """Move to an angle that is due in ``left_s`` seconds, ``step_s`` of them now."""
        self.angle += (angle - self.angle) * min(1.0, step_s / left_s)
        self.speed, self.rate = speed, 0.0

    def ramp(self, speed: float, rise: float, fall: float, step_s: float) -> None:
        """Approach a speed; ``rise`` and ``fall``: rad/s² for increasing, decreasing magnitude."""
        before = self.speed
        growing = abs(speed) > abs(before) and speed * before >= 0
        most = (rise if growing else fall) * step_s
        self.speed += max(-most, min(most, speed - before))
        if before * self.speed < 0:
            self.speed = 0.0  # at standstill; the rest is another ramp
        self._settle(before, step_s)

    def profile(self, goal: float, top: float, rise: float, fall: float, step_s: float) -> None:
        """Approach an angle with a trapezoidal speed profile, and stop there."""
        left = goal - self.angle
        # v * step + v² / (2 * fall) = left: highest speed that can still be stopped in time
        stoppable = fall * (math.sqrt(step_s**2 + 2 * abs(left) / fall) - step_s)
        wanted = math.copysign(min(top, stoppable), left)
        before = self.speed
        towards = before * left >= 0
        rising = towards and abs(wanted) > abs(before)
        most = (rise if rising else fall) * step_s
        self.speed += max(-most, min(most, wanted - before))
        if abs(left) < 1e-9 and abs(self.speed) <= fall * step_s:
            self.speed, self.angle = 0.0, goal
        self._settle(before, step_s)

    def _settle(self, before: float, step_s: float) -> None:
        self.rate = (self.speed - before) / step_s
        self.angle += self.speed * step_s

    # -- torque -----------------------------------------------------------------------------------

    def follow(self, limits: Limits, step_s: float) -> None:
        """Control the angle."""
        self.control_speed(self.speed + _POSITION_GAIN * self.error, limits, step_s)

    def control_speed(self, speed: float, limits: Limits, step_s: float) -> None:
        """Control the speed."""
        held = max(-limits.speed, min(limits.speed, speed))
        torque = self._torque_for(held) + self.plant.inertia_kgm2 * self.rate
        self._apply(torque, limits, step_s, limited=held != speed)

    def control_torque(self, torque_nm: float, limits: Limits, step_s: float) -> None:
        """Apply a torque, reduced if the motor would become too fast."""
        most, least = self._torque_for(limits.speed), self._torque_for(-limits.speed)
        held = max(least, min(most, torque_nm))
        self._apply(held, limits, step_s, limited=held != torque_nm)

    def coast(self, time_s: float) -> None:
        """Let the motor turn without torque."""
        self.plant.advance(0.0, time_s)
        self.torque_nm, self.limited = 0.0, False
        self.take_over()

    def _torque_for(self, speed: float) -> float:
        plant = self.plant
        friction = math.copysign(plant.friction_nm, speed) if abs(speed) > _AT_REST else 0.0
        push = plant.inertia_kgm2 * _SPEED_GAIN * (speed - plant.speed)
        return push + friction + plant.damping_nms * speed

    def _apply(self, torque_nm: float, limits: Limits, step_s: float, *, limited: bool) -> None:
        held = max(-limits.torque_negative_nm, min(limits.torque_positive_nm, torque_nm))
        self.limited = limited or held != torque_nm
        self.torque_nm = held
        self.plant.advance(held, step_s)
