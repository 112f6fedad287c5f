"""Drives by CiA 402 (IEC 61800-7-201, ETG.6010): their axes in process data, and their plant.

A drive is a device with a controlword. The objects of axis n are 0x800 * n higher; axes are
numbered from 0 without gaps.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.model.bus import Device, Direction, Entry, Located
from fsoe_net.model.layout import DeviceLayout, Placed

CIA402_PLUGIN = "ethercat_generic_plugins/EcCiA402Drive"
"""Plugin of ethercat_driver_ros2 that runs the state machine of axis 0 itself."""
GENERIC_PLUGINS = ("ethercat_generic_plugins/GenericEcSlave", CIA402_PLUGIN)
"""Plugins that connect interfaces by the names in a slave YAML."""
ROS_PACKAGE_DRIVER = "fsoe_net_ros/EthercatDriver"
"""Hardware plugin of this project that reads a description for ethercat_driver_ros2."""
CONTROLWORD = 0x6040
MODE_OF_OPERATION = 0x6060
TARGET_POSITION = 0x607A
PLUGIN_OUTPUTS = (CONTROLWORD, MODE_OF_OPERATION, TARGET_POSITION)
"""Outputs that `CIA402_PLUGIN` writes without a command."""
AXIS_STEP = 0x800
MOST_AXES = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveAxis:
    """Process data of one axis outside FSoE frames, by the object that axis 0 would have.

    ``outputs`` and ``inputs`` hold the number of a sync manager and the first entry with that
    object, by object (index without the offset of the axis).
    """

    number: int
    outputs: Mapping[int, tuple[int, Placed]]
    inputs: Mapping[int, tuple[int, Placed]]

    @property
    def base(self) -> int:
        """The offset added to the objects of axis 0."""
        return self.number * AXIS_STEP


def drive_axes(layout: DeviceLayout) -> tuple[DriveAxis, ...]:
    """Return the axes of a device; none if it has no controlword."""
    sides: dict[Direction, dict[int, tuple[int, Placed]]] = {side: {} for side in Direction}
    for sm in layout.managers:
        for placed in sm.placed:
            # Inside an FSoE frame the same index belongs to the safety profile.
            if placed.entry.is_gap or sm.sm.direction is None or sm.block_at(placed.bit_offset):
                continue
            found = sides[sm.sm.direction]
            # The first entry counts, as for a driver.
            found.setdefault(placed.entry.index, (sm.sm.index, placed))
    outputs, inputs = sides[Direction.OUTPUT], sides[Direction.INPUT]
    axes = []
    for number in range(MOST_AXES):
        base = number * AXIS_STEP
        if CONTROLWORD + base not in outputs:
            break  # 0x7040 alone is an output of a terminal (ETG.5001)
        axes.append(DriveAxis(number=number, outputs=_of(outputs, base), inputs=_of(inputs, base)))
    return tuple(axes)


def driver_facts(driver: str) -> dict[str, Any]:
    """Return the keys that only the driver uses, with their values, of a device or an entry."""
    return dict(json.loads(driver)) if driver else {}


def switches_states(plugin: str | None, driver: str) -> bool:
    """Return whether a drive is enabled by its plugin; ``driver`` as in `driver_facts`."""
    by_itself = driver_facts(driver).get("auto_state_transitions", True)
    return plugin == CIA402_PLUGIN and bool(by_itself)


def is_controlword(index: int) -> bool:
    """Return whether an object is the controlword of an axis."""
    return index in range(CONTROLWORD, CONTROLWORD + MOST_AXES * AXIS_STEP, AXIS_STEP)


def with_mode(device: Device, mode: int, span: Span) -> Device:
    """Return a device whose axis 0 gets this mode of operation as default in every cycle.

    Args:
        device: Content of the slave YAML.
        mode: Value of 0x6060.
        span: The place that states it.
    """

    def changed(entry: Entry) -> Entry:
        if (entry.index, entry.subindex) != (MODE_OF_OPERATION, 0):
            return entry
        return replace(entry, default=float(mode), fields={**entry.fields, "default": span})

    rpdos = tuple(replace(p, entries=tuple(map(changed, p.entries))) for p in device.rpdos)
    return replace(device, rpdos=rpdos)


def _of(entries: Mapping[int, tuple[int, Placed]], base: int) -> dict[int, tuple[int, Placed]]:
    return {i - base: e for i, e in entries.items() if 0x6000 <= i - base < 0x6000 + AXIS_STEP}


def axis_name(subdevice: str, number: int) -> str:
    """Return ``drive`` for axis 0 and ``drive.2`` for axis 2, the names used by people."""
    return f"{subdevice}.{number}" if number else subdevice


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSetup(Located):
    """An emulated axis: motor, load, limits, and the safe outputs that act on it.

    Lengths are revolutions of the motor. ``limits_rev`` are position limits; ``home_switch_rev`` is
    the range in which the switch is on. ``sto``, ``ss1`` and ``sls`` name safe outputs whose value
    0 requests the function; ``None`` for the objects of the drive profile in the frame of the same
    device. ``sls_rpm`` belongs to the outputs of ``sls`` in their order; the last applies to all
    others.
    """

    counts_per_rev: float = 65536
    rated_torque_nm: float = 1.0
    max_torque_nm: float = 3.0
    inertia_kgm2: float = 0.001
    friction_nm: float = 0.05
    damping_nms: float = 0.001
    max_rpm: float = 3000
    acceleration_rev_s2: float = 50
    quick_stop_rev_s2: float = 200
    following_error_rev: float = 0.5
    following_error_ms: float = 10
    position_rev: float = 0
    limits_rev: tuple[float, float] = (-math.inf, math.inf)
    home_switch_rev: tuple[float, float] = (math.inf, math.inf)
    sto: str | None = None
    ss1: str | None = None
    sls: tuple[str, ...] | None = None
    sto_is_fault: bool = False
    ss1_ms: float = 500
    sls_rpm: tuple[float, ...] = (250,)
    sls_delay_ms: float = 500
