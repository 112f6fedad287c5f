"""Emulated devices on a bus of plain dictionaries: no core, no thread, no clock."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from fsoe_net.formats.own.network import load_network
from fsoe_net.fsoe.event import Event, EventKind
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.model.scenario import LogicChoice
from fsoe_net.simulate.bus import EmulatedDevices, build_network

ROOT = Path(__file__).parents[2]
ESTOP = ROOT / "examples" / "estop" / "network.yaml"
ROBOT = ROOT / "examples" / "el6910" / "network.yaml"
MS = 1_000_000

Tamper = Callable[[bytes], bytes | None]


def load(path: Path) -> Resolution:
    """Load a network that is known to be good."""
    network = load_network([path]).network
    assert network is not None
    return resolve(network)


@dataclass
class Io:
    """Process data of one SubDevice."""

    data: dict[int, bytearray]
    in_op: bool = True

    def operational(self) -> bool:
        return self.in_op

    def read_outputs(self, sm: int) -> bytes:
        return bytes(self.data[sm])

    def write_inputs(self, sm: int, data: bytes) -> None:
        assert len(data) == len(self.data[sm])
        self.data[sm][:] = data


@dataclass
class Bench:
    """A bus that copies every transfer once per millisecond.

    ``tamper`` sees each frame by the name of its source and may change or lose it.
    """

    resolution: Resolution
    network: EmulatedDevices
    io: dict[str, Io]
    now_ns: int = 0
    tamper: dict[str, Tamper] = field(default_factory=dict)
    unplugged: set[str] = field(default_factory=set)
    events: list[tuple[str, Event]] = field(default_factory=list)

    def run(self, cycles: int) -> None:
        for _ in range(cycles):
            self.now_ns += MS
            self._copy()
            for name, device in self.network.devices.items():
                device.step(self.now_ns, self.io[name])
            for ends in (self.network.mains, self.network.subs):
                for port in ends.values():
                    end = "main" if port.is_main else "sub"
                    self.events += [(end, e) for e in port.instance.take_events()]

    def press(self, pressed: bool) -> None:
        for device in self.network.masters:
            device.logic.pressed = pressed

    def click(self) -> None:
        """Press reset for two cycles and let the new outputs arrive."""
        self.press(True)
        self.run(2)
        self.press(False)
        self.run(4)

    def reset_codes(self, end: str) -> list[int]:
        kind = EventKind.RESET_LOCAL
        return [e.code for who, e in self.events if who == end and e.kind is kind]

    def _copy(self) -> None:
        for row in self.resolution.transfers:
            source, destination = row.transfer.source.module, row.transfer.destination.module
            if self.unplugged & {source, destination}:
                continue
            assert row.source.sm is not None
            assert row.destination.sm is not None
            size = row.transfer.size_bytes
            at, to = row.source.byte_offset, row.destination.byte_offset
            frame: bytes | None = bytes(
                self.io[source].data[row.source.sm.sm.index][at : at + size]
            )
            if source in self.tamper and frame is not None:
                frame = self.tamper[source](frame)
            if frame is not None:
                self.io[destination].data[row.destination.sm.sm.index][to : to + size] = frame


def bench(path: Path, choice: LogicChoice | None = None) -> Bench:
    """Build a network of devices with good inputs."""
    resolution = load(path)
    numbers = itertools.count(0x1234, 0x1357)
    network = build_network(resolution, lambda: next(numbers) & 0xFFFF)
    network.choose_logic(choice or LogicChoice())
    for name in network.default_inputs():
        network.set_good(name)
    io = {}
    for sub in resolution.network.subdevices:
        assert sub.layout is not None
        sizes = {sm.sm.index: bytearray(sm.size_bytes) for sm in sub.layout.managers}
        io[sub.name] = Io(sizes)
    return Bench(resolution=resolution, network=network, io=io)
