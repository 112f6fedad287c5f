"""Symbols of a plan in ROS terms: joints of axes, and a topic for each value.

Independent of DDS.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fsoe_net.live.control_values import Symbol, Value
from fsoe_net.model.drives import AXIS_STEP, MOST_AXES
from fsoe_net.model.names import Names
from fsoe_net.ros2.names import legal_token

# Actual values of CiA 402 (IEC 61800-7-201), and their names in the driver.
_PARTS = {"position": 0x6064, "velocity": 0x606C, "effort": 0x6077}


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """An axis: its name, and the symbols of its actual values; empty if missing.

    ``is_raw``: its position is a count of the drive, without a factor to radians or metres.
    """

    name: str
    position: str
    velocity: str
    effort: str
    is_raw: bool = False

    def values(self, values: Mapping[str, Value]) -> tuple[float, float, float]:
        """Return position, velocity and effort; NaN if missing."""
        names = (self.position, self.velocity, self.effort)
        found = [values.get(name) if name else None for name in names]
        position, velocity, effort = (math.nan if v is None else float(v) for v in found)
        return position, velocity, effort


class SignalKind(enum.Enum):
    """Type of the message for a value: a message of ``std_msgs``."""

    BOOL = "Bool"
    SIGNED = "Int64"
    UNSIGNED = "UInt64"
    REAL = "Float64"

    def python(self, value: Value) -> bool | int | float:
        """Return a value in the type of the message."""
        if self is SignalKind.BOOL:
            return bool(value)
        if self is SignalKind.REAL:
            return math.nan if value is None else float(value)
        return int(value or 0)

    def takes(self, value: float) -> bool:
        """Whether a parameter value has this kind; integers are also valid reals."""
        if isinstance(value, bool) or self is SignalKind.BOOL:
            return isinstance(value, bool) and self is SignalKind.BOOL
        return self is SignalKind.REAL or isinstance(value, int)


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalTopic:
    """A value of the process image and its topic, below the name of the node."""

    symbol: Symbol
    topic: str
    kind: SignalKind

    @property
    def is_settable(self) -> bool:
        """Whether it is an output that a client may write without arming it."""
        return self.symbol.is_output and self.symbol.open and not self.symbol.restart_relevant


def find_joints(symbols: Sequence[Symbol]) -> tuple[Joint, ...]:
    """Return the axes: devices with an actual position, by its object or by the driver's name.

    Axis n of a SubDevice has its objects 0x800 * n higher. An axis has the name of its SubDevice;
    with several axes, their number from 1 is appended. Velocity and effort without a factor are
    omitted, because sensor_msgs/JointState has SI units only.
    """
    found: dict[str, list[dict[str, Symbol | None]]] = {}
    inputs: dict[str, list[Symbol]] = {}
    for symbol in symbols:
        if not symbol.is_output:
            inputs.setdefault(symbol.subdevice, []).append(symbol)
    for subdevice, own in inputs.items():
        for axis in range(MOST_AXES):
            parts = {part: _part(own, part, axis) for part in _PARTS}
            # Axes are numbered without gaps, so the search ends at the first one without a
            # position.
            if parts["position"] is None:
                break
            found.setdefault(subdevice, []).append(parts)
    joints, names = [], Names()
    for subdevice, axes in found.items():
        for number, parts in enumerate(axes, 1):
            # ROS names allow letters, digits and underscores only.
            name = legal_token(subdevice) + (f"_{number}" if len(axes) > 1 else "")
            joints.append(_joint(names.add(name), parts))
    return tuple(joints)


def _joint(name: str, parts: Mapping[str, Symbol | None]) -> Joint:
    position, velocity, effort = (parts[part] for part in _PARTS)
    assert position is not None  # noqa: S101 - an axis has one
    return Joint(
        name=name,
        position=position.name,
        velocity="" if velocity is None or not _has_unit(velocity) else velocity.name,
        effort="" if effort is None or not _has_unit(effort) else effort.name,
        is_raw=not _has_unit(position),
    )


def _has_unit(symbol: Symbol) -> bool:
    return symbol.kind == "real" or (symbol.factor, symbol.offset) != (1.0, 0.0)


def _part(symbols: Sequence[Symbol], part: str, axis: int) -> Symbol | None:
    index = _PARTS[part] + axis * AXIS_STEP
    for symbol in symbols:
        if (symbol.index, symbol.subindex) == (index, 0):
            return symbol
    # The driver's names have no axis number.
    return next((s for s in symbols if s.entry == part), None) if axis == 0 else None


def signal_topics(symbols: Sequence[Symbol]) -> tuple[SignalTopic, ...]:
    """Return a topic for each input and output: ``inputs/SUBDEVICE/ENTRY``, ``outputs/…``."""
    found, topics = [], Names()
    for symbol in symbols:
        side = "outputs" if symbol.is_output else "inputs"
        parts = [legal_token(p) for p in (symbol.subdevice, symbol.entry)]
        topic = topics.add("/".join([side, *parts]))
        found.append(SignalTopic(symbol=symbol, topic=topic, kind=_kind(symbol)))
    return tuple(found)


def _kind(symbol: Symbol) -> SignalKind:
    if symbol.kind == "bool":
        return SignalKind.BOOL
    if _has_unit(symbol):
        return SignalKind.REAL
    return SignalKind.SIGNED if symbol.kind == "signed" else SignalKind.UNSIGNED
