"""Motor and load with inertia, Coulomb and viscous friction; the motion is solved exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(slots=True)
class Plant:
    """One rotating axis; angle in rad, speed in rad/s.

    ``inertia * d(speed)/dt = torque - damping * speed - friction * sign(speed)``; at rest the axis
    does not move until the torque exceeds the friction.
    """

    inertia_kgm2: float
    friction_nm: float
    damping_nms: float
    angle: float = 0.0
    speed: float = 0.0

    def advance(self, torque_nm: float, time_s: float) -> None:
        """Advance with a constant torque: the exact solution, divided at standstill."""
        if self.speed == 0.0:
            if abs(torque_nm) <= self.friction_nm:
                return
            self._move(torque_nm - math.copysign(self.friction_nm, torque_nm), time_s)
            return
        drive_nm = torque_nm - math.copysign(self.friction_nm, self.speed)
        rest_s = self._rest_after(drive_nm)
        if rest_s >= time_s:
            self._move(drive_nm, time_s)
            return
        self._move(drive_nm, rest_s)
        self.speed = 0.0
        self.advance(torque_nm, time_s - rest_s)

    def _rest_after(self, drive_nm: float) -> float:
        """Return the time in seconds until the speed is 0; infinite for never."""
        if drive_nm * self.speed >= 0:
            return math.inf
        if self.damping_nms == 0:
            return -self.speed * self.inertia_kgm2 / drive_nm
        ratio = -self.damping_nms * self.speed / drive_nm
        return self.inertia_kgm2 / self.damping_nms * math.log1p(ratio)

    def _move(self, drive_nm: float, time_s: float) -> None:
        """Move without a change of sign; ``drive_nm`` includes the Coulomb friction."""
        if self.damping_nms == 0:
            rate = drive_nm / self.inertia_kgm2
            self.angle += (self.speed + rate * time_s / 2) * time_s
            self.speed += rate * time_s
            return
        constant_s = self.inertia_kgm2 / self.damping_nms
        final = drive_nm / self.damping_nms
        # expm1, because 1 - exp(x) loses its digits for a short time.
        change = -math.expm1(-time_s / constant_s)
        self.angle += final * time_s + (self.speed - final) * constant_s * change
        self.speed += (final - self.speed) * change
