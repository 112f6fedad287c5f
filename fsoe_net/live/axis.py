"""A CiA 402 axis in the cycle of ``fsn-master``: see ``docs/howto/program.md``.

The state machine is in the C library (``fsn/axis.h``), not repeated here.
"""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import Any

from fsoe_net.core.module import compiled
from fsoe_net.errors import ControlRefused


class AxisMode(IntEnum):
    """Modes of operation, with the values of object 0x6060."""

    PP = 1
    PV = 3
    HM = 6
    CSP = 8
    CSV = 9
    CST = 10


class AxisState(Enum):
    """States of the drive by CiA 402; ``NO_STATE``: the bits of its statusword are invalid."""

    NOT_READY = 0
    SWITCH_ON_DISABLED = 1
    READY_TO_SWITCH_ON = 2
    SWITCHED_ON = 3
    OPERATION_ENABLED = 4
    QUICK_STOP_ACTIVE = 5
    FAULT_REACTION_ACTIVE = 6
    FAULT = 7
    NO_STATE = 8


class AxisPhase(Enum):
    """State of the axis between its program and its drive.

    ``STOPPED_BY_DRIVE`` and ``TORQUE_OFF`` are expected with SS1, SS2 and STO and are not faults.
    These two, ``NO_ANSWER`` and ``BAD_STATUSWORD`` can only be left with `Axis.enable`.
    """

    OFF = 0
    ENABLING = 1
    ENABLED = 2
    STOPPING = 3
    STOPPED_BY_DRIVE = 4
    TORQUE_OFF = 5
    FAULTED = 6
    RESETTING = 7
    NO_ANSWER = 8
    BAD_STATUSWORD = 9


class AxisJob(Enum):
    """Progress of the last set-point or homing."""

    NONE = 0
    WAITING = 1
    RUNNING = 2
    DONE = 3
    FAILED = 4


class Axis:
    """One axis, created by `RealTime.axis` and valid as long as that object.

    Call `step` in each cycle, between ``wait`` and ``send``. All values are those of the last step,
    as integers of the drive: factor and offset of the network file do not apply.

    While the axis is not `enabled`, its targets are the actual position, velocity 0 and torque 0.
    After a stop of any kind the program must enable it again.
    """

    def __init__(self, realtime: Any, cycle: Any, options: Any) -> None:
        self._ffi, self._lib = compiled()
        self._realtime, self._cycle = realtime, cycle
        self._pointer = self._ffi.new("struct fsn_realtime_axis *")
        fault = self._ffi.new("struct fsn_realtime_fault *")
        status = self._lib.fsn_realtime_axis_open(realtime(), options, self._pointer, fault)
        if status:
            text = self._ffi.string(fault.text).decode("utf-8", "replace")
            raise ControlRefused(text, self._name(status))
        self._axis = self._ffi.addressof(self._pointer, "axis")

    def _name(self, status: int) -> str:
        return str(self._ffi.string(self._lib.fsn_status_name(status)).decode())

    def _check(self, status: int, what: str, limit: str = "") -> None:
        """Raise the exception for a refusal: the value is outside a limit, or not possible now."""
        if not status:
            return
        if status == self._lib.FSN_E_ARG:
            raise ValueError(f"{what}: {limit}")
        mode = AxisMode(self._axis.outputs.mode).name
        halted = ", halted" if self.halted else ""
        raise ControlRefused(
            f"{what}: not possible now; phase {self._phase_text}, drive {self._state_text}, "
            f"mode {mode}{halted}",
            self._name(status),
        )

    @property
    def _phase_text(self) -> str:
        return str(self._ffi.string(self._lib.fsn_axis_phase_name(self._axis.phase)).decode())

    @property
    def _state_text(self) -> str:
        return str(self._ffi.string(self._lib.fsn_axis_state_name(self._axis.state)).decode())

    def step(self) -> None:
        """Read the inputs of the current cycle, and set the outputs for ``send``."""
        self._lib.fsn_realtime_axis_step(self._pointer, self._realtime(), self._cycle)

    @property
    def phase(self) -> AxisPhase:
        """State of the axis between program and drive."""
        return AxisPhase(self._axis.phase)

    @property
    def state(self) -> AxisState:
        """State of the drive."""
        return AxisState(self._axis.state)

    @property
    def enabled(self) -> bool:
        """Whether targets of the program apply: Operation enabled, and the mode is confirmed."""
        return bool(self._axis.enabled)

    @property
    def halted(self) -> bool:
        """Whether the axis is halted by `halt`."""
        return bool(self._axis.halted)

    @property
    def limited(self) -> bool:
        """Whether the drive limits the motion (bit 11), as with SLS or at its own limits."""
        return bool(self._axis.limited)

    @property
    def reached(self) -> bool:
        """Whether the drive reports that the target is reached (bit 10)."""
        return bool(self._axis.reached)

    @property
    def job(self) -> AxisJob:
        """Progress of the last `move` or `home`."""
        return AxisJob(self._axis.job)

    @property
    def statusword(self) -> int:
        """Complete statusword."""
        return int(self._axis.inputs.statusword)

    @property
    def position(self) -> int:
        """Actual position."""
        return int(self._axis.inputs.position)

    @property
    def velocity(self) -> int:
        """Actual velocity; 0 if 0x606C is not mapped."""
        return int(self._axis.inputs.velocity)

    @property
    def torque(self) -> int:
        """Actual torque; 0 if 0x6077 is not mapped."""
        return int(self._axis.inputs.torque)

    @property
    def controlword(self) -> int:
        """Controlword for the next ``send``."""
        return int(self._axis.outputs.controlword)

    @property
    def target_position(self) -> int:
        """Target position for the next ``send``."""
        return int(self._axis.outputs.position)

    @property
    def target_velocity(self) -> int:
        """Target velocity for the next ``send``."""
        return int(self._axis.outputs.velocity)

    @property
    def target_torque(self) -> int:
        """Target torque for the next ``send``."""
        return int(self._axis.outputs.torque)

    @property
    def mode(self) -> AxisMode:
        """Requested mode; assigning requests another one, which the drive must confirm.

        Raises:
            ValueError: The drive does not support the mode, its objects are not mapped, or its
                limit is 0.
        """
        return AxisMode(self._axis.outputs.mode)

    @mode.setter
    def mode(self, mode: AxisMode) -> None:
        status = self._lib.fsn_axis_set_mode(self._axis, int(mode))
        self._check(status, f"mode {mode.name}", "not mapped, not of this drive, or its limit is 0")

    def enable(self) -> None:
        """Request Operation enabled and end a halt; targets count once `enabled` is true.

        Raises:
            ControlRefused: A fault (`reset` first), Quick stop active (`disable` first), the drive
                reports STO, is still stopping by itself, or is in an invalid state.
        """
        self._check(self._lib.fsn_axis_enable(self._axis), "enable")

    def disable(self) -> None:
        """Request that the drive slows down and switches the torque off."""
        self._lib.fsn_axis_disable(self._axis)

    def quick_stop(self) -> None:
        """Request Quick stop, with the ramp of the drive; not an emergency stop."""
        self._lib.fsn_axis_quick_stop(self._axis)

    def reset(self) -> None:
        """Reset a fault; the axis is off afterwards.

        Raises:
            ControlRefused: Not in a fault, or the fault is being reset.
        """
        self._check(self._lib.fsn_axis_reset(self._axis), "reset")

    def halt(self, halts: bool = True) -> None:
        """Halt, or continue."""
        self._lib.fsn_axis_halt(self._axis, halts)

    def set_position(self, position: int) -> None:
        """CSP: target of the next step and of all later ones until it is set again.

        Raises:
            ValueError: The step from the previous target is larger than ``max_step``; the target is
                unchanged.
            ControlRefused: Not enabled in CSP, or halted.
        """
        limit = f"{self.target_position} and a step of {self._axis.config.max_step} at most"
        self._check(
            self._lib.fsn_axis_set_position(self._axis, position),
            f"target position {position}",
            limit,
        )

    def set_velocity(self, velocity: int) -> None:
        """CSV, PV: target from the next step on.

        Raises:
            ValueError: The value is beyond ``max_velocity``; the target is unchanged.
            ControlRefused: Not enabled in CSV or PV, or halted.
        """
        self._check(
            self._lib.fsn_axis_set_velocity(self._axis, velocity),
            f"target velocity {velocity}",
            f"at most {self._axis.config.max_velocity}",
        )

    def set_torque(self, torque: int) -> None:
        """CST: target from the next step on.

        Raises:
            ValueError: The value is beyond ``max_torque``; the target is unchanged.
            ControlRefused: Not enabled in CST, or halted.
        """
        self._check(
            self._lib.fsn_axis_set_torque(self._axis, torque),
            f"target torque {torque}",
            f"at most {self._axis.config.max_torque}",
        )

    def move(self, position: int, *, at_once: bool = False) -> None:
        """PP: send an absolute set-point; `job` reports its progress.

        Args:
            position: Target position.
            at_once: Whether the drive drops its current set-point.

        Raises:
            ControlRefused: Not enabled in PP, halted, or the previous set-point is not yet
                accepted.
        """
        self._check(self._lib.fsn_axis_move(self._axis, position, at_once), f"move to {position}")

    def home(self) -> None:
        """HM: start homing with the method of the drive; `job` reports its progress.

        Raises:
            ControlRefused: Not enabled in HM, halted, or already homing.
        """
        self._check(self._lib.fsn_axis_home(self._axis), "home")
