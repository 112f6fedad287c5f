"""One emulated axis: controlword and targets in; motor, safety functions and statusword out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from fsoe_net.model.drives import DriveAxis, DriveSetup
from fsoe_net.simulate.drive.homing import Homing
from fsoe_net.simulate.drive.modes import (
    TARGET_REACHED,
    CyclicPosition,
    CyclicTorque,
    CyclicVelocity,
    ModeBase,
    MotionContext,
    NoMode,
    ProfilePosition,
    ProfileVelocity,
)
from fsoe_net.simulate.drive.objects import AxisObjects
from fsoe_net.simulate.drive.plant import Plant
from fsoe_net.simulate.drive.power import PdsState, PowerSystem
from fsoe_net.simulate.drive.safety import SafeDemand, SafeDrive
from fsoe_net.simulate.drive.servo import Limits, Servo

# The gains in `servo` are chosen for steps of this length.
_STEP_NS = 250_000
_LONGEST_NS = 1_000_000_000  # a device that paused for longer has not moved in the meantime
_HALT = 1 << 8
_VOLTAGE, _REMOTE, _LIMIT_ACTIVE = 1 << 4, 1 << 9, 1 << 11
_AT_REST = 0.02  # rad/s
_MODES: Mapping[int, type[ModeBase]] = {
    0: NoMode,
    1: ProfilePosition,
    3: ProfileVelocity,
    6: Homing,
    8: CyclicPosition,
    9: CyclicVelocity,
    10: CyclicTorque,
}
_MODE_OF_TARGET = {0x607A: 8, 0x60FF: 9, 0x6071: 10}


class FaultCode:
    """Error codes (0x603F) that an emulated axis reports itself (IEC 61800-7-201)."""

    STO = 0x5441  # vendor-specific; drives differ
    COMMUNICATION = 0x7500
    FOLLOWING_ERROR = 0x8611
    POSITION_LIMIT = 0x8612


class EmulatedAxis:
    """One emulated axis; see the module docstring.

    Args:
        axis: Its process data.
        stated: Values of start-up SDOs by index and subindex of axis 0.
        cycle_s: Time between two targets in seconds.

    Attributes:
        power: Its state.
        safe: Its safety functions; without any, the torque is never removed.
        context: Reference and motor.
    """

    def __init__(
        self, axis: DriveAxis, stated: Mapping[tuple[int, int], int], cycle_s: float
    ) -> None:
        self.number = axis.number
        self.objects = AxisObjects(axis, cycle_s)
        self._stated = dict(stated)
        self.configure(DriveSetup())

    def configure(self, setup: DriveSetup) -> None:
        """Apply another motor, load and limits, and switch on."""
        self.setup = setup
        plant = Plant(setup.inertia_kgm2, setup.friction_nm, setup.damping_nms)
        plant.angle = setup.position_rev * math.tau
        self.context = MotionContext(
            objects=self.objects,
            servo=Servo(plant),
            limits=Limits(0.0, 0.0, 0.0),
            counts_per_rad=setup.counts_per_rev / math.tau,
            torque_nm_per_mille=setup.rated_torque_nm / 1000,
        )
        self.safe = SafeDrive(round(setup.ss1_ms * 1e6), round(setup.sls_delay_ms * 1e6))
        self.power_cycle()

    def wait_for_sdos(self) -> None:
        """Apply the values of start-up SDOs only when they arrive through the mailbox."""
        self._stated = {}
        self.objects.start(self.setup, self._stated)

    def power_cycle(self) -> None:
        """Switch off and on; the motor position is unchanged, its speed and home are lost."""
        self.power = PowerSystem()
        self.objects.start(self.setup, self._stated)
        self._mode_number = 0
        self._mode: ModeBase = NoMode(self.context)
        self.context.origin = 0.0
        self.context.servo.plant.speed = 0.0
        self.context.servo.take_over()
        self._error_ns = 0
        self._last_ns: int | None = None
        self._safe_stop = self._torque_taken = False

    # -- one step of the device -------------------------------------------------------------------

    def step(
        self,
        now_ns: int,
        image: Callable[[int], bytes],
        demand: SafeDemand | None,
        *,
        operational: bool,
    ) -> None:
        """Advance the time.

        Args:
            now_ns: Current time.
            image: Returns the outputs of a sync manager.
            demand: Request in the safe data; ``None`` for a drive without safety functions.
            operational: Whether outputs arrive, because the device is in OP.
        """
        if operational:
            self.objects.receive(image)
        self._limit()
        self._sense()
        standing = self._stands()
        if demand is not None:
            speed = self.context.servo.plant.speed
            self.safe.step(now_ns, demand, speed, standing=standing)
        self._transitions(standing, demand is not None, operational)
        passed_ns = 0 if self._last_ns is None else now_ns - self._last_ns
        self._last_ns = now_ns
        self._run(min(passed_ns, _LONGEST_NS))
        self._show()

    def trip(self, error_code: int) -> None:
        """Trigger a fault now."""
        self.power.trip(error_code)

    @property
    def controlword(self) -> int:
        """Last received controlword."""
        return self.objects.value(0x6040)

    def _limit(self) -> None:
        c, setup = self.context, self.setup
        torque = self.objects.value(0x6072) * c.torque_nm_per_mille
        torque = min(torque, setup.max_torque_nm)
        c.limits.torque_positive_nm = c.limits.torque_negative_nm = torque
        # 0x6080 is in revolutions per minute, unlike all other speeds here.
        speed = min(self.objects.value(0x6080), setup.max_rpm) / 60 * math.tau
        if self.safe.speed_limit is not None:
            speed = min(speed, self.safe.speed_limit)
        c.limits.speed = speed

    def _sense(self) -> None:
        revolutions = self.context.servo.plant.angle / math.tau
        low, high = self.setup.limits_rev
        on, off = self.setup.home_switch_rev
        self.context.switches = (revolutions <= low, revolutions >= high, on <= revolutions <= off)

    def _stands(self) -> bool:
        servo = self.context.servo
        return servo.speed == 0.0 and abs(servo.plant.speed) < _AT_REST

    def _transitions(self, standing: bool, has_safety: bool, operational: bool) -> None:
        power, before = self.power, self.power.state
        # A drive that leaves OP with torque on has lost its controller, which is a fault in CiA
        # 402.
        if not operational and power.has_torque and before is not PdsState.FAULT_REACTION:
            power.trip(FaultCode.COMMUNICATION)
        self._safe_stop = has_safety and self.safe.stopping
        # Option codes 5 to 8 of 0x605A: the drive stays in Quick stop active.
        power.stays_stopped = self.objects.value(0x605A) >= 5
        power.step(self.controlword, standing=standing, safe_stop=self._safe_stop)
        # After the transition: removal of the torque by a safety function must override any
        # command.
        self._torque_taken = has_safety and self.safe.torque_off
        if self._torque_taken:
            power.take_torque(FaultCode.STO if self.setup.sto_is_fault else 0)
        if power.state is not before:
            self._changed(before)

    def _changed(self, before: PdsState) -> None:
        servo = self.context.servo
        if self.power.state is PdsState.OPERATION_ENABLED:
            servo.take_over()
            self._start_mode(self._wanted_mode())
        elif before is PdsState.OPERATION_ENABLED and self.power.has_torque:
            servo.take_speed()
        self._error_ns = 0

    def _wanted_mode(self) -> int:
        """Return the requested mode, or the current one if it does not exist."""
        objects = self.objects
        wanted = objects.value(0x6060)
        # The drive is fixed to one mode; the mapped target shows which one.
        if not wanted and not objects.is_mapped(0x6060):
            mapped = filter(objects.is_mapped, _MODE_OF_TARGET)
            wanted = next((_MODE_OF_TARGET[index] for index in mapped), 0)
        return wanted if wanted in _MODES else self._mode_number

    def _start_mode(self, number: int) -> None:
        self._mode_number, self._mode = number, _MODES[number](self.context)

    # -- motion -----------------------------------------------------------------------------------

    def _run(self, passed_ns: int) -> None:
        if self._wanted_mode() != self._mode_number:
            self._start_mode(self._wanted_mode())
        if self.power.state is PdsState.OPERATION_ENABLED:
            self._mode.command(self.controlword, passed_ns / 1e9)
        # Rounded up: equal steps, none of them longer than the limit.
        steps = -(-passed_ns // _STEP_NS)
        for _ in range(steps):
            self._move(passed_ns / steps / 1e9)

    def _move(self, step_s: float) -> None:
        power, servo = self.power, self.context.servo
        if not power.has_torque:
            servo.coast(step_s)
        elif self._brakes():
            ramp = self.context.ramp(0x6085 if self._stops_quickly() else 0x6084)
            servo.ramp(0.0, ramp, ramp, step_s)
            servo.follow(self.context.limits, step_s)
        else:
            self._mode.move(step_s)
            self._watch(step_s)
        self._sense()

    def _stops_quickly(self) -> bool:
        """Whether the quick-stop ramp applies, also for faults and SS1."""
        return self.power.state is not PdsState.OPERATION_ENABLED

    def _brakes(self) -> bool:
        return (
            self.power.state is not PdsState.OPERATION_ENABLED
            or self.power.disabling
            or bool(self.controlword & _HALT)
        )

    def _watch(self, step_s: float) -> None:
        """Supervise the following error and the limit switches."""
        servo, objects = self.context.servo, self.objects
        # Window 0 switches the supervision off.
        window = objects.value(0x6065) / self.context.counts_per_rad
        if self._mode.watches_error and window > 0 and abs(servo.error) > window:
            self._error_ns += round(step_s * 1e9)
            # Only an error that lasts longer than the time-out of 0x6066 is a fault.
            if self._error_ns > objects.value(0x6066) * 1_000_000:
                self._fault(FaultCode.FOLLOWING_ERROR)
        else:
            self._error_ns = 0
        low, high, _ = self.context.switches
        speed = servo.plant.speed
        # Only motion towards the switch is a fault; otherwise the axis could not leave it.
        outwards = (low and speed < -_AT_REST) or (high and speed > _AT_REST)
        if outwards and self._mode.minds_switches:
            self._fault(FaultCode.POSITION_LIMIT)

    def _fault(self, code: int) -> None:
        self.power.trip(code)
        self.context.servo.take_speed()

    # -- observable state
    # ---------------------------------------------------------------------------

    def _show(self) -> None:
        c, servo, power = self.context, self.context.servo, self.power
        turns = c.counts_per_rad
        wanted, actual = (_wrapped(c.shown(angle)) for angle in (servo.angle, servo.plant.angle))
        torque = 1000 / self.setup.rated_torque_nm
        low, high, home = c.switches
        self.objects.publish(
            {
                0x603F: power.error_code,
                0x6041: self._statusword(),
                0x6061: self._mode_number,
                0x6062: wanted,
                0x6063: actual,
                0x6064: actual,
                0x606B: round(servo.speed * turns),
                0x606C: round(servo.plant.speed * turns),
                0x6074: round(servo.torque_nm * torque),
                0x6077: round(servo.torque_nm * torque),
                0x60F4: round(servo.error * turns),
                0x60FC: wanted,
                # Bits 0 … 2: limit and home switches; from bit 16 on: vendor-specific (CiA 402).
                0x60FD: low | high << 1 | home << 2 | self._torque_taken << 31,
            }
        )

    def _statusword(self) -> int:
        word = self.power.state.value | _VOLTAGE | _REMOTE
        # Bit 11 is valid only while there is torque to limit.
        word |= _LIMIT_ACTIVE * (self.power.has_torque and self.context.servo.limited)
        if self.power.state is not PdsState.OPERATION_ENABLED:
            return word
        bits = self._mode.bits()
        if self._brakes():
            # No target is followed; standstill counts as reached.
            bits = bits & ~(TARGET_REACHED | 1 << 12) | TARGET_REACHED * self._stands()
        if self._mode.watches_error and self._error_ns:
            bits |= 1 << 13
        return word | bits


def _wrapped(counts: int) -> int:
    """Return a position wrapped to 32 bits."""
    return (counts + (1 << 31)) % (1 << 32) - (1 << 31)
