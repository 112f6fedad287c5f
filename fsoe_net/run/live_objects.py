"""What FSoE devices tell of themselves over CoE, kept up to date while they live."""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.core import Segment
from fsoe_net.emul import EmulatedDevice, EmulatedNetwork
from fsoe_net.fsoe import State

__all__ = ["LiveObjects"]

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

_Row = tuple[int, int, bytes]


class LiveObjects:
    """Writes objects of all FSoE devices to a segment, when they have changed.

    ``0xF980:01`` … are the addresses of the SubInstances of a device. ``0xE901``, ``0xE911``, … are
    the connections of its MainInstances, at most 16: state, address, connection ID, watchdog in ms,
    each of 16 bits.

    Args:
        segment: Where the devices are.
        network: The devices.
    """

    def __init__(self, segment: Segment, network: EmulatedNetwork) -> None:
        self._segment = segment
        self._devices = [
            (segment.position(name), device)
            for name, device in network.devices.items()
            if device.ports
        ]
        self._told: dict[tuple[int, int, int], bytes] = {}

    def update(self) -> None:
        """Tell what has changed."""
        for position, device in self._devices:
            for index, sub, data in _rows(device):
                key = (position, index, sub)
                if self._told.get(key) != data:
                    self._segment.set_object(position, index, sub, data)
                    self._told[key] = data


def _rows(device: EmulatedDevice) -> Iterator[_Row]:
    addresses = [p.instance.config.address for p in device.ports if not p.is_main][:255]
    if addresses:
        yield _ADDRESSES, 0, bytes([len(addresses)])
    for sub, address in enumerate(addresses, 1):
        yield _ADDRESSES, sub, _word(address)
    mains = [p for p in device.ports if p.is_main]
    for index, port in zip(_CONNECTIONS, mains, strict=False):
        instance, setup = port.instance, port.setup
        state = _STATES[instance.state]
        if instance.state is State.DATA and not instance.data_valid:
            state = _FAILSAFE
        yield index, 0, b"\4"
        values = (state, setup.address, setup.connection_id, setup.watchdog_ms)
        for sub, value in enumerate(values, 1):
            yield index, sub, _word(value)


def _word(value: int) -> bytes:
    return value.to_bytes(2, "little")
