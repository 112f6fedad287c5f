"""The machine of an emulated run: lamps, e-stops, axes, and cables that can be cut."""

from __future__ import annotations

import math
from collections.abc import Iterable

from fsoe_net.errors import InputError
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.safe_bits import bit_names
from fsoe_net.model.safety import ElementKind
from fsoe_net.model.scan import Scan
from fsoe_net.model.signals import Signal
from fsoe_net.project.check import library_of
from fsoe_net.simulate.session import Session
from fsoe_net.studio.document import subdevice_rows
from fsoe_net.studio.live_cabling import Row, cabling_of

_MOST_LAMPS = 8  # of a SubDevice, for each direction
_LABEL_CHARS = 60


class EmulatedMachine:
    """The machine of an emulated run, with cables that can be cut.

    Args:
        session: The run.
        scan: Scan of its first bus, or ``None``.
    """

    def __init__(self, session: Session, scan: Scan | None) -> None:
        self._session = session
        self._cabling = cabling_of(session.resolution, scan)
        self._cut: set[int] = set()
        self._separated: set[str] = set()
        network = session.network
        self._names = bit_names(session.resolution)
        self._inputs = _by_subdevice(network.default_inputs())
        outputs = network.safe_outputs.items()
        self._outputs = _by_subdevice(n for n, port in outputs if port.receives[n].bits == 1)

    def label(self, signal: Signal) -> str:
        """Return the name of a safe signal: of the network, or else of the device file."""
        return (self._names.get(signal.name) or signal.label)[:_LABEL_CHARS]

    def row(self) -> Row:
        """Return the picture, and the e-stops with the logic that each belongs to."""
        resolution, network = self._session.resolution, self._session.network
        facts: dict[str, Row] = {}
        for sub in subdevice_rows(resolution, library_of(resolution.network)):
            name = str(sub["name"])
            device = network.devices.get(name)
            facts[name] = {key: sub[key] for key in ("kind", "type", "about")} | {
                "inputs": [
                    {"name": n, "label": self.label(network.safe_inputs[n].sends[n])}
                    for n in self._inputs.get(name, ())
                ],
                "outputs": [
                    {"name": n, "label": self.label(network.safe_outputs[n].receives[n])}
                    for n in self._outputs.get(name, ())
                ],
                "axes": [] if device is None else [axis.name for axis in device.axes],
            }
        buses = [bus.name for bus in resolution.network.buses]
        return self._cabling.row(facts, buses) | {"stops": self._stops()}

    def _stops(self) -> list[Row]:
        found: dict[tuple[str, str], list[str]] = {}
        for logic in self._session.network.masters:
            for port, name in logic.logic_inputs:
                key = logic.name, port.setup.connection.sub.name
                found.setdefault(key, []).append(name)
        titles = _sensors(self._session.resolution)
        return [
            {"logic": logic, "subdevice": sub, "title": titles.get(sub, ""), "inputs": names}
            for (logic, sub), names in found.items()
        ]

    def view(self) -> Row:
        """Return what changes: values in the order of the lamps, cut cables, axes, logics."""
        network = self._session.network
        values: list[int] = []
        for node in self._cabling.nodes:
            for name in self._inputs.get(node.name, ()):
                port = network.safe_inputs[name]
                values.append(port.sends[name].read(port.safe))
            values += map(network.safe_output, self._outputs.get(node.name, ()))
        return {
            "values": values,
            "cut": sorted(self._cut),
            "separated": sorted(self._separated),
            "axes": [
                [
                    round(wired.axis.context.servo.plant.angle / math.tau % 1, 4),
                    round(wired.axis.context.servo.plant.speed / math.tau * 60, 1),
                    wired.axis.power.state.words,
                ]
                for node in self._cabling.nodes
                if node.name in network.devices
                for wired in network.devices[node.name].axes
            ],
            "logics": [{"name": d.name, "on": d.logic.on} for d in network.masters],
        }

    def set_cable(self, cable: int, *, whole: bool) -> str:
        """Cut or repair a cable.

        Returns:
            Its ends in words.

        Raises:
            InputError: Unknown cable.
        """
        if not 0 <= cable < len(self._cabling.nodes) + len(self._cabling.rings):
            raise InputError(f"unknown cable {cable}")
        (self._cut.discard if whole else self._cut.add)(cable)
        self.apply_cables()
        return self._cabling.cable_text(cable)

    def apply_cables(self) -> None:
        """Unplug each SubDevice that is not reached, and return those that are reached again."""
        session = self._session
        gone = self._cabling.unreached(self._cut)
        for name in gone - session.absent:
            session.set_present(name, False)
            self._separated.add(name)
        for name in self._separated - gone:
            # A part that was pulled by design meanwhile stays away.
            if name not in session.away:
                session.set_present(name, True)
        self._separated &= gone


def _by_subdevice(names: Iterable[str]) -> dict[str, list[str]]:
    """Return the first safe signals of each SubDevice."""
    found: dict[str, list[str]] = {}
    for name in names:
        own = found.setdefault(name.rpartition(".")[0], [])
        if len(own) < _MOST_LAMPS:
            own.append(name)
    return found


def _sensors(resolution: Resolution) -> dict[str, str]:
    """Return the sensors in the safety functions of the network, by SubDevice of the input."""
    found: dict[str, list[str]] = {}
    for function in resolution.network.safety_functions:
        sensors = [e.name for e in function.elements if e.kind is ElementKind.SENSOR]
        for element in function.elements:
            if element.kind is ElementKind.INPUT and element.sub:
                found.setdefault(element.sub, []).extend(sensors)
    return {sub: ", ".join(dict.fromkeys(names))[:_LABEL_CHARS] for sub, names in found.items()}
