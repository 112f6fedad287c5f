"""Reports of FSoE devices about themselves over CoE, kept up to date."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from fsoe_net.core.segment import Segment
from fsoe_net.fsoe.event import State
from fsoe_net.simulate.bus import EmulatedDevices
from fsoe_net.simulate.device import EmulatedDevice
from fsoe_net.simulate.port import Port

_ADDRESSES = 0xF980
_CONNECTIONS = range(0xE901, 0xEA01, 0x10)
_STATES = {
    State.RESET: 100,
    State.SESSION: 101,
    State.CONNECTION: 102,
    State.PARAMETER: 103,
    State.DATA: 104,
}
_FAILSAFE = 105
_VERSION = b"01"
# The number of the module in 0x6nn0 (ETG.5001).
_MODULE = 0x0FF0
_DRIVE = {0x6760: 0x6791, 0x6770: 0x6791}

_Row = tuple[int, int, bytes]


class LiveObjects:
    """Writes changed objects of all FSoE devices to a segment.

    ``0xF980:01`` … are the addresses of the SubInstances of a device. The communication parameters
    of a connection are in the same objects as in real devices, derived from the mapped objects of
    its frame: ``0x9nn1`` for ``0x6nn0`` and ``0x7nn0``, with its state in ``0xAnn0:01``; ``0xE9n1``
    and ``0xEAn0`` for ``0xE6n0`` and ``0xE7n0``; ``0x6791`` for the frame of a CiA 402 drive. The
    first 16 connections of the MainInstances of a device are also in ``0xE901``, ``0xE911``, …
    Subindices: ``:01`` version, ``:02`` address, ``:03`` connection ID, ``:04`` watchdog in ms,
    ``:05`` unique device ID (zeros), ``:06`` side (0 MainInstance, 1 SubInstance), ``:07`` and
    ``:08`` lengths of the communication and application parameters in bytes. A SubInstance has the
    values from its MainInstance, 0 before.

    Source: manuals of several vendors, e.g. Bosch Rexroth ctrlX SAFETY (0x9nn1), SICK microScan3
    (0x9001, 0xA000), Yaskawa SLIO safety modules (0x9001), Beckhoff AX8000 (0xE901), Novanta
    (0x6791), which name ETG.5001.4 and ETG.6100.3.

    Args:
        segment_of: Segment of each device, by name.
        network: The devices.
    """

    def __init__(self, segment_of: Callable[[str], Segment], network: EmulatedDevices) -> None:
        self._devices = [
            (segment, segment.position(name), device)
            for name, device in network.devices.items()
            if device.ports
            for segment in [segment_of(name)]
        ]
        self._reported: list[dict[tuple[int, int], bytes]] = [{} for _ in self._devices]
        self._facts: list[list[object]] = [[] for _ in self._devices]

    def update(self) -> None:
        """Report changes."""
        for number, (segment, position, device) in enumerate(self._devices):
            facts: list[object] = [_facts(port) for port in device.ports]
            if facts == self._facts[number]:  # at almost every step
                continue
            self._facts[number] = facts
            reported = self._reported[number]
            for index, sub, data in _rows(device):
                if reported.get((index, sub)) != data:
                    segment.set_object(position, index, sub, data)
                    reported[index, sub] = data


def _facts(port: Port) -> object:
    """Return all that changes in the rows of a port."""
    own = port.instance
    return own.config.address, own.state, own.connection_id, own.data_valid


def _rows(device: EmulatedDevice) -> Iterator[_Row]:
    # The object has a subindex for each address, at most 255.
    addresses = [p.instance.config.address for p in device.ports if not p.is_main][:255]
    if addresses:
        yield _ADDRESSES, 0, bytes([len(addresses)])
    for sub, address in enumerate(addresses, 1):
        yield _ADDRESSES, sub, _word(address)
    objects: dict[int, Port] = {}
    for port in device.ports:
        index = _parameters_at(port)
        # The first port with an object keeps it: two connections cannot share one.
        if index:
            objects.setdefault(index, port)
    mains = [p for p in device.ports if p.is_main]
    # Without a profile object, connections of a MainInstance are numbered.
    for index, port in zip(_CONNECTIONS, mains, strict=False):
        objects.setdefault(index, port)
    for index, port in objects.items():
        yield from _connection(index, port)


def _parameters_at(port: Port) -> int:
    """Return the object of a connection's parameters; 0 if no profile defines it."""
    connection = port.setup.connection
    sent = connection.to_sub if port.is_main else connection.to_main
    if sent.source.block is None:
        return 0
    command = sent.source.block.command.index
    if command in _DRIVE:
        return _DRIVE[command]
    # Parameters of module n are in 0x9nn1, those of a device without modules in 0xE9n1.
    if command & ~_MODULE in (0x6000, 0x7000):
        return 0x9001 | command & _MODULE
    return 0xE901 | command & 0xF0 if command & ~0xF0 in (0xE600, 0xE700) else 0


def _connection(index: int, port: Port) -> Iterator[_Row]:
    instance, setup = port.instance, port.setup
    # A SubInstance has its parameters only after its MainInstance has sent them.
    given = port.is_main or instance.state is State.DATA
    values = (
        _VERSION,
        _word(instance.config.address),
        _word(setup.main.connection_id if port.is_main else instance.connection_id),
        _word(setup.main.watchdog_ms if given else 0),
        bytes(6),
        _word(0 if port.is_main else 1),
        _word(2),
        _word(len(setup.main.app_parameters)),
    )
    yield index, 0, bytes([len(values)])
    for sub, value in enumerate(values, 1):
        yield index, sub, value
    # The drive profile has no diagnosis object.
    if index < 0x9000:
        return
    state = _STATES[instance.state]
    if instance.state is State.DATA and not instance.data_valid:
        state = _FAILSAFE
    diagnosis = index + 0x100 - 1 if index >= _CONNECTIONS.start else index + 0x1000 - 1
    yield diagnosis, 0, b"\1"
    yield diagnosis, 1, _word(state)


def _word(value: int) -> bytes:
    return value.to_bytes(2, "little")
