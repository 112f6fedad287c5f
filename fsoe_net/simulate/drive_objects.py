"""Objects of emulated drives over CoE: SDO settings of a MainDevice, and values for reading."""

from __future__ import annotations

from collections.abc import Callable

from fsoe_net.core.segment import Segment
from fsoe_net.errors import CoreError
from fsoe_net.simulate.bus import EmulatedDevices
from fsoe_net.simulate.drive.axis import EmulatedAxis
from fsoe_net.simulate.drive.objects import WRITABLE, size_bits

_EVERY = 10  # steps of the devices between two updates, because an SDO takes longer


class DriveObjects:
    """Synchronises the dictionary of every axis with the objects of its SubDevice.

    An object of a start-up SDO whose length differs from the profile is ignored.

    Args:
        segment_of: Segment of each device, by its name.
        network: The devices.
    """

    def __init__(self, segment_of: Callable[[str], Segment], network: EmulatedDevices) -> None:
        self._network = network
        self._segment_of = segment_of
        self._rows: list[_AxisRows] | None = None
        self._steps = 0
        for wired in network.axes.values():
            wired.axis.wait_for_sdos()

    def update(self) -> None:
        """Read written values, publish changed ones."""
        if self._rows is None:  # the scenario has selected the motors by now
            self._rows = [
                _AxisRows(segment, segment.position(name), wired.axis)
                for name, device in self._network.devices.items()
                for wired in device.axes
                for segment in [self._segment_of(name)]
            ]
        # Objects are read by SDO, which is slow: updating them in each step would cost more than
        # the drive.
        if self._steps % _EVERY == 0:
            for rows in self._rows:
                rows.update()
        self._steps += 1


class _AxisRows:
    def __init__(self, segment: Segment, position: int, axis: EmulatedAxis) -> None:
        self._segment, self._position, self._axis = segment, position, axis
        self._base = axis.objects.axis.base
        self._taken: list[tuple[int, int]] = []
        self._shown: dict[tuple[int, int], bytes] = {}
        self._kept: set[tuple[int, int]] = set()
        for key in list(axis.objects.dictionary):
            if key[0] not in WRITABLE:
                continue
            self._kept.add(key)
            try:
                self._offer(key)
            # A start-up SDO states this object with another length.
            except CoreError:
                continue
            if not axis.objects.is_mapped(key[0]):  # process data have priority if mapped
                self._taken.append(key)

    def _offer(self, key: tuple[int, int]) -> None:
        index, sub = key
        data = self._bytes(key)
        self._segment.offer_object(self._position, index + self._base, sub, data)

    def _bytes(self, key: tuple[int, int]) -> bytes:
        bits = size_bits(key[0])
        value = self._axis.objects.value(*key) & ((1 << bits) - 1)
        return value.to_bytes(bits // 8, "little")

    def update(self) -> None:
        for key in self._taken:
            index, sub = key
            size = size_bits(index) // 8
            data = self._segment.get_object(self._position, index + self._base, sub, size)
            self._axis.objects.write(key, data)
        for key in self._axis.objects.dictionary:
            if key in self._kept:
                continue
            data = self._bytes(key)
            if self._shown.get(key) != data:
                self._shown[key] = data
                self._show(key, data)

    def _show(self, key: tuple[int, int], data: bytes) -> None:
        try:
            self._segment.set_object(self._position, key[0] + self._base, key[1], data)
        except CoreError:
            return  # the file of the device has another length for it
