"""Values of one emulated axis: process data if an object is mapped, otherwise its dictionary.

Positions are counts, speeds counts/s, accelerations counts/s², torques per mille of the rated one.
Indices are those of axis 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from fsoe_net.model.drives import DriveAxis, DriveSetup
from fsoe_net.model.signals import write_bits

_SIGNED = frozenset(
    {0x605A, 0x6060, 0x6061, 0x6062, 0x6063, 0x6064, 0x606B, 0x606C, 0x6071, 0x6074, 0x6077}
    | {0x607A, 0x607C, 0x607D, 0x6098, 0x60C2, 0x60B0, 0x60B1, 0x60B2, 0x60F4, 0x60FC, 0x60FF}
)
_BITS = {
    **dict.fromkeys((0x603F, 0x6040, 0x6041, 0x605A, 0x6066, 0x6071, 0x6072, 0x6074), 16),
    **dict.fromkeys((0x6077, 0x60B2), 16),
    **dict.fromkeys((0x6060, 0x6061, 0x6098, 0x60C2), 8),
}
# Objects that a MainDevice may also write by SDO; it only reads the others.
WRITABLE = frozenset(
    {0x6040, 0x605A, 0x6060, 0x6065, 0x6066, 0x6071, 0x6072, 0x607A, 0x607C, 0x607D, 0x6080}
    | {
        0x6081,
        0x6083,
        0x6084,
        0x6085,
        0x6098,
        0x6099,
        0x609A,
        0x60B0,
        0x60B1,
        0x60B2,
        0x60C2,
        0x60FF,
    }
)
_COUNTS = (1 << 31) - 1


def size_bits(index: int) -> int:
    """Return the length of an object in the profile."""
    return _BITS.get(index, 32)


def _counts(value: float) -> int:
    return int(max(-_COUNTS, min(_COUNTS, round(value)))) if math.isfinite(value) else 0


def _defaults(setup: DriveSetup) -> dict[tuple[int, int], int]:
    cpr = setup.counts_per_rev
    ramp, quick = _counts(setup.acceleration_rev_s2 * cpr), _counts(setup.quick_stop_rev_s2 * cpr)
    values = {
        0x603F: 0,
        0x6040: 0,
        0x6041: 0,
        0x605A: 2,  # quick stop ramp, then Switch on disabled
        0x6060: 0,
        0x6061: 0,
        0x6062: 0,
        0x6064: 0,
        0x6065: _counts(setup.following_error_rev * cpr),
        0x6066: _counts(setup.following_error_ms),
        0x606B: 0,
        0x606C: 0,
        0x6071: 0,
        0x6072: _counts(1000 * setup.max_torque_nm / setup.rated_torque_nm),
        0x6074: 0,
        0x6077: 0,
        0x607A: 0,
        0x607C: 0,
        0x6080: _counts(setup.max_rpm),
        0x6081: _counts(setup.max_rpm / 60 * cpr),
        0x6083: ramp,
        0x6084: ramp,
        0x6085: quick,
        0x6098: 37,  # the current position is home
        0x609A: ramp,
        0x60B0: 0,
        0x60B1: 0,
        0x60B2: 0,
        0x60F4: 0,
        0x60FD: 0,
        0x60FF: 0,
        0x6502: 0b11_1010_0101,  # modes 1, 3, 6, 8, 9, 10
    }
    rows = {(index, 0): value for index, value in values.items()}
    low, high = setup.limits_rev
    rows[0x607D, 1], rows[0x607D, 2] = _counts(low * cpr), _counts(high * cpr)
    rows[0x6099, 1], rows[0x6099, 2] = _counts(cpr), _counts(cpr / 10)
    return rows


def _interpolation(cycle_s: float) -> dict[tuple[int, int], int]:
    """Return a bus cycle as the interpolation time period: value and power of ten."""
    # The coarsest unit that fits exactly: 0x60C2:01 has only 8 bits.
    exponent = next(e for e in (-3, -4, -5, -6) if e == -6 or _is_whole(cycle_s, e))
    return {(0x60C2, 1): min(255, max(1, round(cycle_s / 10**exponent))), (0x60C2, 2): exponent}


def _is_whole(time_s: float, exponent: int) -> bool:
    units = time_s / 10**exponent
    return round(units) >= 1 and math.isclose(units, round(units))


@dataclass(slots=True)
class AxisObjects:
    """Values of one axis; see the module docstring.

    Args:
        axis: Its process data.
        cycle_s: Bus cycle, for 0x60C2.

    Attributes:
        dictionary: Values by index and subindex, including mapped objects.
    """

    axis: DriveAxis
    cycle_s: float
    dictionary: dict[tuple[int, int], int] = field(default_factory=dict)
    _outputs: list[tuple[int, int, int, tuple[int, int]]] = field(default_factory=list)
    _inputs: list[tuple[int, int, int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for index, (sm, placed) in self.axis.outputs.items():
            key = index, placed.entry.subindex
            self._outputs.append((sm, placed.bit_offset, placed.entry.bits, key))
        for index, (sm, placed) in self.axis.inputs.items():
            self._inputs.append((sm, placed.bit_offset, placed.entry.bits, index))

    def start(self, setup: DriveSetup, stated: Mapping[tuple[int, int], int]) -> None:
        """Set the values after power-on.

        Args:
            setup: Set-up of the axis.
            stated: Values of start-up SDOs, by index and subindex of axis 0.
        """
        self.dictionary = _defaults(setup) | _interpolation(self.cycle_s)
        # Start-up SDOs also set objects that this axis does not have.
        self.dictionary |= {key: v for key, v in stated.items() if key in self.dictionary}

    def value(self, index: int, subindex: int = 0) -> int:
        """Return a value: as last received, or from the dictionary."""
        return self.dictionary.get((index, subindex), 0)

    def write(self, key: tuple[int, int], data: bytes) -> None:
        """Store the bytes of an SDO by index and subindex."""
        self.dictionary[key] = int.from_bytes(data, "little", signed=key[0] in _SIGNED)

    def is_mapped(self, index: int) -> bool:
        """Whether the MainDevice sends an object in each cycle."""
        return index in self.axis.outputs

    @property
    def interpolation_s(self) -> float:
        """Time between two targets according to 0x60C2, in seconds."""
        units, exponent = self.value(0x60C2, 1) & 0xFF, self.value(0x60C2, 2)
        return max(1, units) * 10.0 ** max(-6, min(0, exponent))

    def receive(self, image: Callable[[int], bytes]) -> None:
        """Read the outputs.

        Args:
            image: Returns the process data of a sync manager.
        """
        for sm, bit, bits, key in self._outputs:
            value = int.from_bytes(image(sm), "little") >> bit & ((1 << bits) - 1)
            if key[0] in _SIGNED and value >> (bits - 1):
                value -= 1 << bits
            self.dictionary[key] = value

    def publish(self, values: Mapping[int, int]) -> None:
        """Set the displayed values of the axis, by index."""
        for index, value in values.items():
            self.dictionary[index, 0] = value

    def inputs(self) -> list[tuple[int, int, int, int]]:
        """Return the mapped displayed values: sync manager, first bit, bits, value."""
        return [
            (sm, bit, bits, self.dictionary[index, 0])
            for sm, bit, bits, index in self._inputs
            if (index, 0) in self.dictionary
        ]


def put(data: bytearray, bit: int, bits: int, value: int) -> None:
    """Write a signed or unsigned value, truncated to its bits."""
    write_bits(data, bit, bits, value & ((1 << bits) - 1))
