"""The power drive system of CiA 402: its states, and the effect of a controlword.

Source of states, transitions and bits: IEC 61800-7-201, as printed in public drive manuals (e.g.
Beckhoff EL7211, Maxon EPOS4, Synapticon SOMANET). Transition numbers are in comments.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

_ENABLE_OPERATION, _FAULT_RESET = 0x0F, 0x80


class PdsState(enum.Enum):
    """State of the power drive system, with its value in the statusword."""

    NOT_READY = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP = 0x07
    FAULT_REACTION = 0x0F
    FAULT = 0x08

    @property
    def words(self) -> str:
        """Its name as in manuals."""
        return _WORDS[self]

    @property
    def key(self) -> str:
        """Its name in scenarios, such as ``switch_on_disabled``."""
        return self.words.lower().replace(" ", "_")


_WORDS = {
    PdsState.NOT_READY: "Not ready to switch on",
    PdsState.SWITCH_ON_DISABLED: "Switch on disabled",
    PdsState.READY: "Ready to switch on",
    PdsState.SWITCHED_ON: "Switched on",
    PdsState.OPERATION_ENABLED: "Operation enabled",
    PdsState.QUICK_STOP: "Quick stop active",
    PdsState.FAULT_REACTION: "Fault reaction active",
    PdsState.FAULT: "Fault",
}


class PowerCommand(enum.Enum):
    """The command in a controlword; there is none if bit 7 is set."""

    NONE = enum.auto()
    SHUTDOWN = enum.auto()
    SWITCH_ON = enum.auto()  # in Operation enabled: disable operation
    ENABLE_OPERATION = enum.auto()
    DISABLE_VOLTAGE = enum.auto()
    QUICK_STOP = enum.auto()


def command_of(controlword: int) -> PowerCommand:
    """Return the command in a controlword.

    ```
    bit          7 3 2 1 0
    shutdown     0 x 1 1 0
    switch on    0 0 1 1 1
    enable       0 1 1 1 1
    disable      0 x x 0 x
    quick stop   0 x 0 1 x
    ```
    """
    # While fault reset is set, the other bits are not a command.
    if controlword & _FAULT_RESET:
        return PowerCommand.NONE
    # From the strongest to the weakest command: bits 1 and 2 are active low.
    if not controlword & 2:
        return PowerCommand.DISABLE_VOLTAGE
    if not controlword & 4:
        return PowerCommand.QUICK_STOP
    if not controlword & 1:
        return PowerCommand.SHUTDOWN
    return PowerCommand.ENABLE_OPERATION if controlword & 8 else PowerCommand.SWITCH_ON


_Table = dict[tuple[PdsState, PowerCommand], PdsState]
_S, _C = PdsState, PowerCommand
_TRANSITIONS: _Table = {
    (_S.SWITCH_ON_DISABLED, _C.SHUTDOWN): _S.READY,  # 2
    (_S.READY, _C.SWITCH_ON): _S.SWITCHED_ON,  # 3
    (_S.READY, _C.ENABLE_OPERATION): _S.SWITCHED_ON,  # 3, and 4 in the next step
    (_S.READY, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 7
    (_S.READY, _C.QUICK_STOP): _S.SWITCH_ON_DISABLED,  # 7
    (_S.SWITCHED_ON, _C.ENABLE_OPERATION): _S.OPERATION_ENABLED,  # 4
    (_S.SWITCHED_ON, _C.SHUTDOWN): _S.READY,  # 6
    (_S.SWITCHED_ON, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 10
    (_S.SWITCHED_ON, _C.QUICK_STOP): _S.SWITCH_ON_DISABLED,  # 10
    (_S.OPERATION_ENABLED, _C.SHUTDOWN): _S.READY,  # 8
    (_S.OPERATION_ENABLED, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 9
    (_S.OPERATION_ENABLED, _C.QUICK_STOP): _S.QUICK_STOP,  # 11
    (_S.QUICK_STOP, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 12
}


@dataclass(slots=True)
class PowerSystem:
    """State of one axis.

    Attributes:
        state: Current state.
        error_code: Error code of the fault (0x603F), 0 if there is none.
        disabling: Whether disable operation was requested; the axis stops first (transition 5).
        stays_stopped: Whether it stays in Quick stop active after a quick stop and can be enabled
            again (0x605A: 5 … 8); otherwise it changes to Switch on disabled.
    """

    state: PdsState = PdsState.NOT_READY
    error_code: int = 0
    disabling: bool = False
    stays_stopped: bool = False
    _was_reset: bool = False

    @property
    def has_torque(self) -> bool:
        """Whether the motor is controlled."""
        return self.state in (
            PdsState.OPERATION_ENABLED,
            PdsState.QUICK_STOP,
            PdsState.FAULT_REACTION,
        )

    def step(self, controlword: int, *, standing: bool, safe_stop: bool) -> None:
        """Make at most one transition.

        Args:
            controlword: Last received controlword.
            standing: Whether the ramp that stops the axis has ended.
            safe_stop: Whether a safety function stops it: Quick stop active without a command.
        """
        reset = bool(controlword & _FAULT_RESET)
        # Bit 7 acts on its rising edge: if held, it must not clear each new fault.
        edge, self._was_reset = reset and not self._was_reset, reset
        if self.state is PdsState.NOT_READY:
            self.state = PdsState.SWITCH_ON_DISABLED  # 1
        elif self.state is PdsState.FAULT:
            if edge:
                self.state, self.error_code = PdsState.SWITCH_ON_DISABLED, 0  # 15
        # The drive first brakes; the state Fault means that there is no torque.
        elif self.state is PdsState.FAULT_REACTION:
            if standing:
                self.state = PdsState.FAULT  # 14
        else:
            self._command(command_of(controlword), standing, safe_stop)

    def _command(self, command: PowerCommand, standing: bool, safe_stop: bool) -> None:
        state = self.state
        new = _TRANSITIONS.get((state, command), state)
        if state is PdsState.OPERATION_ENABLED:
            # A safety function stops the axis without a command; only a stronger command has
            # priority.
            if safe_stop and new is state:
                new = PdsState.QUICK_STOP
            self.disabling = command is PowerCommand.SWITCH_ON
            # The ramp of `disable operation` ends at standstill (option code 0x605C).
            if self.disabling and standing and new is state:
                new = PdsState.SWITCHED_ON  # 5
        elif state is PdsState.QUICK_STOP and new is state and not safe_stop and standing:
            if not self.stays_stopped:
                new = PdsState.SWITCH_ON_DISABLED  # 12
            elif command is PowerCommand.ENABLE_OPERATION:
                new = PdsState.OPERATION_ENABLED  # 16
        if new is not PdsState.OPERATION_ENABLED:
            self.disabling = False
        self.state = new

    def trip(self, error_code: int) -> None:
        """Trigger a fault: with torque, the axis stops first (13)."""
        if self.state is PdsState.FAULT:
            return
        self.state = PdsState.FAULT_REACTION if self.has_torque else PdsState.FAULT
        self.error_code, self.disabling = error_code, False

    def take_torque(self, error_code: int) -> None:
        """Remove the torque for an external reason: no ramp, no command.

        Args:
            error_code: Error code if this is a fault while the axis is controlled; 0: not a fault.
        """
        # The first error is kept: it is the cause, later ones are consequences.
        if self.state is PdsState.FAULT_REACTION or (self.has_torque and error_code):
            self.error_code = self.error_code or error_code
            self.state = PdsState.FAULT
        elif self.state not in (PdsState.FAULT, PdsState.NOT_READY):
            self.state = PdsState.SWITCH_ON_DISABLED
        self.disabling = False
