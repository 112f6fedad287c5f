"""The standard program of an emulated run: enables its drives and turns them at a constant speed.

A drive that leaves the state Operation enabled, for example by STO, stops the program of all axes.
They move again only after another start, as on a machine with a start button.
"""

from __future__ import annotations

from fsoe_net.model.drives import CONTROLWORD, MODE_OF_OPERATION
from fsoe_net.simulate.drive.power import PdsState
from fsoe_net.simulate.drive.wiring import WiredAxis
from fsoe_net.simulate.session import Session

_TARGET_VELOCITY = 0x60FF
_PROFILE_VELOCITY = 3  # mode of operation
_REV_PER_S = 0.5  # slow enough to see each turn
_DISABLE = 0
# The controlword that leads from a state to the next one, up to Operation enabled.
_NEXT = {
    PdsState.SWITCH_ON_DISABLED: 6,
    PdsState.READY: 7,
    PdsState.SWITCHED_ON: 15,
    PdsState.OPERATION_ENABLED: 15,
    PdsState.FAULT: 0x80,
}


class AxisProgram:
    """Turns the axes of a run whose process data has controlword, mode and target velocity.

    Args:
        session: The run.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._axes = [
            (axis, outputs)
            for device in session.network.devices.values()
            for axis in device.axes
            if (outputs := self._outputs(device.name, axis)) is not None
        ]
        self._enabled: set[str] = set()
        self.runs = False

    @property
    def can_run(self) -> bool:
        """Whether there is an axis to turn."""
        return bool(self._axes)

    def _outputs(self, subdevice: str, axis: WiredAxis) -> dict[int, int] | None:
        """Return the number of the output for each object; ``None`` if one is not mapped."""
        records = self._session.records
        places = {
            (sm.index, symbol.bit_offset): number
            for number, symbol in enumerate(records.symbols)
            if symbol.output
            and records.subdevices[(sm := records.sync_managers[symbol.sm]).subdevice].name
            == subdevice
        }
        mapped = axis.axis.objects.axis.outputs
        found = {}
        for index in (CONTROLWORD, MODE_OF_OPERATION, _TARGET_VELOCITY):
            if index not in mapped:
                return None
            sm_index, placed = mapped[index]
            found[index] = places[sm_index, placed.bit_offset]
        return found

    def start(self) -> None:
        """Enable the drives and turn them; without FSoE data a drive refuses."""
        self.runs = True
        self._enabled.clear()
        for axis, outputs in self._axes:
            counts = round(_REV_PER_S * axis.axis.setup.counts_per_rev)
            self._session.core.set_output(outputs[MODE_OF_OPERATION], _PROFILE_VELOCITY)
            self._session.core.set_output(outputs[_TARGET_VELOCITY], counts)

    def stop(self) -> None:
        """Disable the drives."""
        self.runs = False
        for _, outputs in self._axes:
            self._session.core.set_output(outputs[CONTROLWORD], _DISABLE)

    def step(self) -> None:
        """Set the controlwords for the next cycle."""
        if not self.runs:
            return
        for axis, outputs in self._axes:
            state = axis.axis.power.state
            if state is PdsState.OPERATION_ENABLED:
                self._enabled.add(axis.name)
            self._session.core.set_output(outputs[CONTROLWORD], _NEXT.get(state, _DISABLE))
            if axis.name in self._enabled and state is not PdsState.OPERATION_ENABLED:
                self.stop()
                return
