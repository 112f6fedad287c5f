"""Joints of a ``ros2_control`` block that the package ``fsoe_net_ros`` drives by CiA 402."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import RobotComponent
from fsoe_net.model.description import DescribedSubDevice
from fsoe_net.model.drives import CONTROLWORD, MODE_OF_OPERATION, driver_facts, switches_states
from fsoe_net.model.symbols import DeviceSymbol

AXIS_REQUESTS = ("reset_fault", "home")
"""Commands of an axis that are not outputs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlAxis:
    """An axis by its SubDevice, with its mode and a switch of its plugin."""

    subdevice: str
    mode: float | None
    resets_faults: bool


def is_output_of(symbol: DeviceSymbol, index: int) -> bool:
    """Whether a symbol is the output of a whole object."""
    return symbol.is_output and (symbol.entry.index, symbol.entry.subindex) == (index, 0)


def driven_axes(
    sub: DescribedSubDevice, name: str, symbols: Sequence[DeviceSymbol]
) -> list[ControlAxis]:
    """Return the axis of a plugin that changes states by itself; it drives the first one only.

    Args:
        sub: The SubDevice.
        name: Its name in the plan.
        symbols: Symbols of one of its components.
    """
    has_controlword = any(is_output_of(s, CONTROLWORD) for s in symbols)
    if not switches_states(sub.plugin, sub.device.driver) or not has_controlword:
        return []
    switches = driver_facts(sub.device.driver)
    modes = [s.entry.default for s in symbols if is_output_of(s, MODE_OF_OPERATION)]
    mode = next((m for m in modes if m is not None and math.isfinite(m)), None)
    resets = bool(switches.get("auto_fault_reset", False))
    return [ControlAxis(subdevice=name, mode=mode, resets_faults=resets)]


def interface_limits(joint: RobotComponent) -> dict[str, tuple[float, float]]:
    """Return the lowest and highest command of a joint by interface, as its URDF states them."""
    sides = {"velocity": joint.max_velocity, "effort": joint.max_effort}
    found = {name: (-most, most) for name, most in sides.items() if most}
    return found if joint.limits is None else found | {"position": joint.limits}


def urdf_limit(joint: RobotComponent | None) -> tuple[str, str]:
    """Return type and limit tag of a joint; it is continuous if its positions have no limit.

    The tag is empty without a limit. URDF requires velocity and effort in it, 0 if not stated.
    """
    if joint is None or not interface_limits(joint):
        return "continuous", ""
    rows = {"velocity": joint.max_velocity, "effort": joint.max_effort}
    if joint.limits is not None:
        rows |= dict(zip(("lower", "upper"), joint.limits, strict=True))
    tag = "".join(f' {name}="{value!r}"' for name, value in rows.items())
    return "continuous" if joint.limits is None else joint.joint_type, f"<limit{tag}/>"


def axis_params(axis: ControlAxis, joint: RobotComponent | None) -> Iterator[tuple[str, str]]:
    """Yield the params of an axis; a limit that the joint does not state has none."""
    yield "axis", axis.subdevice
    if axis.mode is not None:
        yield "mode_of_operation", f"{axis.mode:g}"
    if axis.resets_faults:
        yield "auto_fault_reset", "true"
    if joint is not None and joint.max_velocity:
        yield "max_velocity", repr(joint.max_velocity)
    if joint is not None and joint.max_effort:
        yield "max_effort", repr(joint.max_effort)
