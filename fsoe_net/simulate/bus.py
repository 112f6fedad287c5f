"""All emulated devices of a network, and the safe signals by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property

from fsoe_net.fsoe.sub_instance import SubInstance
from fsoe_net.model.bus import Direction, SubDevice
from fsoe_net.model.drives import AXIS_STEP, DriveSetup, drive_axes
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.scenario import LogicChoice
from fsoe_net.model.signals import split_name
from fsoe_net.simulate.device import EmulatedDevice
from fsoe_net.simulate.drive.axis import EmulatedAxis
from fsoe_net.simulate.drive.wiring import WiredAxis
from fsoe_net.simulate.port import Port, main_port, sub_port
from fsoe_net.simulate.setup import FsoeSetup, choose_setups

_CYCLE_NS = 1_000_000  # if no file states a bus cycle
# Input area of modular devices (ETG.5001). Status bits of a safety drive are in other areas
# (0x2xxx, 0x66xx of the drive profile) and are not e-stop buttons.
_INPUT_OBJECTS = range(0x6000, 0x6600)


class EmulatedDevices:
    """Devices in bus order, connections in plan order.

    Args:
        setups: Facts of every connection.
        devices: Devices by SubDevice name.
    """

    def __init__(self, setups: list[FsoeSetup], devices: dict[str, EmulatedDevice]) -> None:
        self.setups = setups
        self.devices = devices
        self.mains: dict[str, Port] = {}
        self.subs: dict[str, Port] = {}
        for device in devices.values():
            for port in device.ports:
                ends = self.mains if port.is_main else self.subs
                ends[port.setup.connection.name] = port

    @cached_property
    def masters(self) -> list[EmulatedDevice]:
        """Devices that contain a MainInstance, and therefore a logic."""
        return [d for d in self.devices.values() if any(p.is_main for p in d.ports)]

    @cached_property
    def safe_inputs(self) -> dict[str, Port]:
        """Safe inputs of all SubInstances by name."""
        return {name: port for port in self.subs.values() for name in port.sends}

    @cached_property
    def safe_outputs(self) -> dict[str, Port]:
        """Safe outputs of all SubInstances by name."""
        return {name: port for port in self.subs.values() for name in port.receives}

    def default_inputs(self) -> list[str]:
        """Return the safe inputs used by the default logic: single bits, without drive status."""
        return [
            name
            for name, port in self.safe_inputs.items()
            if port.sends[name].bits == 1 and port.sends[name].index in _INPUT_OBJECTS
        ]

    def has_safe_input(self, name: str) -> bool:
        """Return whether a safe input with this name exists."""
        return normal_name(name) in self.safe_inputs

    def set_safe_input(self, name: str, value: int) -> None:
        """Set the input of a SubInstance at its terminals; ends mirroring of that value.

        Raises:
            KeyError: Unknown safe input.
        """
        name = normal_name(name)
        port = self.safe_inputs[name]
        if name in port.mirrored:
            port.mirrored.remove(name)
        port.reported.pop(name, None)
        port.sends[name].write(port.safe, value)

    def set_good(self, name: str) -> None:
        """Set a safe input to 1, unless it mirrors the received data.

        Raises:
            KeyError: Unknown safe input.
        """
        name = normal_name(name)
        if name not in self.safe_inputs[name].mirrored:
            self.set_safe_input(name, 1)

    def set_address(self, subdevice: str, address: int) -> None:
        """Set another address for the SubInstances of a SubDevice, for the next Connection.

        Raises:
            ValueError: Not in 1 … 65535.
        """
        for port in self.subs.values():
            instance = port.instance
            if port.setup.connection.sub.name == subdevice and isinstance(instance, SubInstance):
                instance.config = replace(instance.config, address=address)

    def safe_output(self, name: str) -> int:
        """Return the value that a SubInstance passes to its outputs; 0 while it is not valid.

        Raises:
            KeyError: Unknown safe output.
        """
        name = normal_name(name)
        return self.safe_outputs[name].received(name)

    @cached_property
    def axes(self) -> dict[str, WiredAxis]:
        """Emulated axes by name, as in `fsoe_net.model.drives.axis_name`."""
        return {wired.name: wired for device in self.devices.values() for wired in device.axes}

    def choose_drives(self, setups: Mapping[str, DriveSetup]) -> None:
        """Set motor, load and wiring of axes; axes without a setup are unchanged.

        Raises:
            KeyError: Unknown axis or safe output.
        """
        axes = self.axes
        for name, setup in setups.items():
            axes[name].configure(setup, self._port_of)

    def _port_of(self, output: str) -> tuple[Port, str]:
        name = normal_name(output)
        return self.safe_outputs[name], name

    def choose_logic(self, choice: LogicChoice) -> None:
        """Configure the inputs and outputs that every safety master uses.

        Raises:
            KeyError: A name is not a safe input or output.
        """
        inputs = self.default_inputs() if choice.inputs is None else choice.inputs
        outputs = list(self.safe_outputs) if choice.outputs is None else choice.outputs
        # Names are checked before any device is changed: an unknown name leaves the logic
        # unchanged.
        watched = {(n := normal_name(x)): self.safe_inputs[n].setup.connection.name for x in inputs}
        switched = {
            (n := normal_name(x)): self.safe_outputs[n].setup.connection.name for x in outputs
        }
        delays = {normal_name(name): ns for name, ns in choice.delays_ns.items()}
        for device in self.masters:
            device.logic.delays_ns = delays
            # As in a real machine, a safety master controls only its own connections.
            own = {p.setup.connection.name: p for p in device.ports if p.is_main}
            device.logic_inputs = [(own[c], n) for n, c in watched.items() if c in own]
            device.logic_outputs = [(own[c], n) for n, c in switched.items() if c in own]


def normal_name(text: str) -> str:
    """Return the canonical spelling of a signal name."""
    parts = split_name(text)
    return text if parts is None else f"{parts[0]}.0x{parts[1]:04x}:{parts[2]:02x}"


def build_network(resolution: Resolution, session_ids: Callable[[], int]) -> EmulatedDevices:
    """Build a device for every SubDevice with an FSoE end or standard inputs.

    Args:
        resolution: A network without errors.
        session_ids: Source of session ids: random live, counted in virtual time.
    """
    setups = choose_setups(resolution)
    cycle_s = (resolution.network.cycle_ns or _CYCLE_NS) / 1e9
    ports: dict[str, list[Port]] = {}
    for setup in setups:
        c = setup.connection
        ports.setdefault(c.main.name, []).append(main_port(setup, session_ids))
        ports.setdefault(c.sub.name, []).append(sub_port(setup, session_ids))
    devices: dict[str, EmulatedDevice] = {}
    for sub in resolution.network.subdevices:
        # Inputs that are not registered have no place in the image of the MainDevice.
        inputs = {
            sm.sm.index: bytearray(sm.size_bytes)
            for sm in (sub.layout.managers if sub.layout else ())
            if sm.sm.direction is Direction.INPUT and sm.registered
        }
        # A device without FSoE and without inputs has no visible effect.
        if inputs or sub.name in ports:
            own = ports.get(sub.name, [])
            devices[sub.name] = EmulatedDevice(
                name=sub.name, ports=own, inputs=inputs, axes=_axes(sub, own, cycle_s)
            )
    return EmulatedDevices(setups, devices)


def _axes(sub: SubDevice, ports: list[Port], cycle_s: float) -> list[WiredAxis]:
    """Build the axes of a drive; none for other devices."""
    if sub.device is None or sub.layout is None:
        return []
    found = []
    for axis in drive_axes(sub.layout):
        stated = {
            (sdo.index - axis.base, sdo.subindex): sdo.value
            for sdo in sub.device.sdos
            if 0x6000 <= sdo.index - axis.base < 0x6000 + AXIS_STEP
        }
        found.append(WiredAxis(sub.name, EmulatedAxis(axis, stated, cycle_s), ports))
    return found
