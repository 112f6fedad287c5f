"""The robot as one graph: its joints, gpios and sensors, and the channels that serve them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.model.bus import Device, Entry, EntryView, RobotComponent, SubDevice


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotChannel:
    """A PDO entry with the name of an interface, or an item of its ``data_mapping`` that has one.

    ``part`` is the entry or the item.
    """

    subdevice: SubDevice
    entry: Entry
    part: Entry | EntryView
    name: str
    is_command: bool

    @property
    def span(self) -> Span:
        """The place of the name."""
        return self.part.at("command_interface" if self.is_command else "state_interface")

    def __str__(self) -> str:
        bit = f" bit {self.part.bit}" if isinstance(self.part, EntryView) else ""
        return f"{self.subdevice.name} {self.entry.address}{bit}"

    def serves(self, component: RobotComponent) -> bool:
        """Whether its interface can be one of this component."""
        return self.entry.component in ("", component.name)


@dataclass(frozen=True, slots=True, kw_only=True)
class ServedComponent:
    """A joint, gpio or sensor with all SubDevices that serve it."""

    component: RobotComponent
    subdevices: tuple[SubDevice, ...]

    def __str__(self) -> str:
        return str(self.component)

    def requests(self, *, is_command: bool) -> Iterator[tuple[str, Span]]:
        """Yield the interfaces of one side that the robot description has, with their places."""
        for side, name, place in self.component.interfaces():
            if side is is_command:
                yield name, place

    def channels(self, *, is_command: bool) -> Iterator[RobotChannel]:
        """Yield the channels of one side that serve it."""
        for sub in self.subdevices:
            for channel in channels_of(sub, is_command=is_command):
                if channel.serves(self.component):
                    yield channel


def channels_of(sub: SubDevice, *, is_command: bool) -> Iterator[RobotChannel]:
    """Yield the channels of one side of a SubDevice: commands are in RxPDOs, states in TxPDOs."""
    for entry in _entries(sub.device, is_command=is_command):
        parts: tuple[Entry | EntryView, ...] = (entry, *entry.views)
        for part in parts:
            name = part.command_interface if is_command else part.state_interface
            # An entry has the name of its first item; the item counts.
            if name and not (part is entry and entry.views):
                yield RobotChannel(
                    subdevice=sub, entry=entry, part=part, name=name, is_command=is_command
                )


def _entries(device: Device | None, *, is_command: bool) -> Iterator[Entry]:
    if device is not None:
        for pdo in device.rpdos if is_command else device.tpdos:
            yield from pdo.entries


def served_components(subdevices: Sequence[SubDevice]) -> tuple[ServedComponent, ...]:
    """Return each component of a robot description that a SubDevice serves, in their order."""
    owners: dict[tuple[str, RobotComponent], list[SubDevice]] = {}
    for sub in subdevices:
        for component in sub.components:
            owners.setdefault((sub.system, component), []).append(sub)
    return tuple(
        ServedComponent(component=component, subdevices=tuple(subs))
        for (_, component), subs in owners.items()
    )
