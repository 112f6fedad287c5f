"""A description as a ``ros2_control`` block for the package ``fsoe_net_ros``.

Components are the joints of the robot description, or SubDevices if the input has no joints; and
safety connections. The package finds an interface in the plan as ``SUBDEVICE.INTERFACE``; a
``param`` of the component names another SubDevice or another symbol. A joint of `EcCiA402Drive` is
an axis: the package drives its controlword and mode of operation.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import field, replace
from xml.sax.saxutils import escape, quoteattr

from fsoe_net.dataclass import dataclass
from fsoe_net.formats.ros2.control_axis import (
    AXIS_REQUESTS,
    ControlAxis,
    axis_params,
    driven_axes,
    interface_limits,
    is_output_of,
    urdf_limit,
)
from fsoe_net.formats.shared.writers import Written, unique_names
from fsoe_net.model.bus import RobotComponent
from fsoe_net.model.description import DescribedSubDevice, Description
from fsoe_net.model.drives import AXIS_STEP, CONTROLWORD, MODE_OF_OPERATION, drive_axes
from fsoe_net.model.symbols import DeviceSymbol, device_symbols

# Interfaces of ros2_control and ethercat_driver_ros2, by the objects of CiA 402 (IEC 61800-7-201).
_STATES = {
    0x6041: "status_word",
    0x6061: "mode_of_operation_display",
    0x6064: "position",
    0x606C: "velocity",
    0x6077: "effort",
}
_COMMANDS = {
    CONTROLWORD: "control_word",
    MODE_OF_OPERATION: "mode_of_operation",
    0x6071: "effort",
    0x607A: "position",
    0x60FF: "velocity",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Interface:
    """One interface of a component.

    ``symbol`` is its name in the plan without the SubDevice. ``initial`` is the value of an output
    without a command, 0 if not stated.
    """

    is_command: bool
    name: str
    subdevice: str
    symbol: str
    scaled: bool = True
    initial: float = 0.0


@dataclass(slots=True)
class _Component:
    kind: str
    name: str
    interfaces: list[_Interface] = field(default_factory=list)
    stated: RobotComponent | None = None  # in a robot description
    axes: list[ControlAxis] = field(default_factory=list)  # more than one: none is driven

    @property
    def axis(self) -> ControlAxis | None:
        return self.axes[0] if len(self.axes) == 1 else None

    @property
    def requests(self) -> tuple[str, ...]:
        """Commands of its axis that the description has."""
        wanted = self.stated.commands if self.stated is not None and self.axis is not None else ()
        return tuple(name for name in AXIS_REQUESTS if name in wanted)


def write_control(description: Description, *, file: str = "ros2_control.urdf.xacro") -> Written:
    """Return one URDF; a SubDevice with an actual position is a joint, all others are gpios.

    Joints, gpios and sensors of a robot description keep their names. Outputs written by a copy,
    and those that can restart a machine, are not exported as commands.

    Args:
        description: Description to write.
        file: Name of the URDF.
    """
    names = unique_names(description)
    components: dict[tuple[str, str], _Component] = {}
    notes = ["the socket is that of your fsn-master: xacro … socket:=PATH"]
    for number, sub in enumerate(description.subdevices):
        symbols = list(_open_symbols(description, number, sub))
        for made in _components(sub, names[number], symbols):
            known = components.setdefault(
                (made.kind, made.name), replace(made, interfaces=[], axes=[])
            )
            known.axes += made.axes
            known.interfaces += _without_taken(made.interfaces, known.interfaces)
    for component in components.values():
        notes += _notes(component)
    joints = [c for c in components.values() if c.kind == "joint"]
    lines = [
        '<?xml version="1.0"?>',
        "<!-- For fsoe_net_ros: inputs and outputs for controllers, without safety data. -->",
        '<robot name="cell" xmlns:xacro="http://www.ros.org/wiki/xacro">',
        '  <xacro:arg name="socket" default="/run/fsn-master/fsn-master-eth1.sock"/>',
        '  <ros2_control name="cell" type="system">',
        "    <hardware>",
        "      <plugin>fsoe_net_ros/CellSystem</plugin>",
        '      <param name="socket">$(arg socket)</param>',
        '      <param name="start">false</param>',
        "    </hardware>",
    ]
    for component in components.values():
        if component.interfaces:
            lines += _component_lines(component)
    for place, connection in enumerate(description.connections):
        ends = [names[n] for n in (connection.main, connection.sub) if n is not None]
        name = connection.name or "-".join(ends) or f"connection_{place + 1}"
        rows = [
            _Interface(is_command=False, name=row, subdevice=name, symbol=row)
            for row in ("in_data", "state")
        ]
        lines += _component_lines(_Component("sensor", name, rows))
    lines += ["  </ros2_control>", *_links(joints), "</robot>"]
    return Written(files={file: "\n".join(lines) + "\n"}, notes=tuple(notes))


def _links(joints: Sequence[_Component]) -> Iterator[str]:
    """Yield the joints and links that a URDF requires; your own description replaces them."""
    yield '  <link name="world"/>'
    for joint in joints:
        link = _attribute(f"{joint.name}_link")
        kind, limit = urdf_limit(joint.stated)
        yield f"  <link name={link}/>"
        yield f'  <joint name={_attribute(joint.name)} type="{kind}">'
        yield f'    <parent link="world"/><child link={link}/>{limit}'
        yield "  </joint>"


def _component_lines(component: _Component) -> Iterator[str]:
    yield f"    <{component.kind} name={_attribute(component.name)}>"
    subdevices = {row.subdevice for row in component.interfaces}
    serving = subdevices.pop() if len(subdevices) == 1 else component.name
    if serving != component.name:
        yield f'      <param name="subdevice">{_text(serving)}</param>'
    if component.axis is not None:
        for name, value in axis_params(component.axis, component.stated):
            yield f'      <param name="{name}">{_text(value)}</param>'
    for row in component.interfaces:
        side = "command_interface" if row.is_command else "state_interface"
        if (row.subdevice, row.symbol) != (serving, row.name):
            symbol = f"{row.subdevice}.{row.symbol}"
            yield f"      <param name={_attribute(f'{side}/{row.name}')}>{_text(symbol)}</param>"
    for row in component.interfaces:
        side = "command_interface" if row.is_command else "state_interface"
        tag = f"{side} name={_attribute(row.name)}"
        params = "".join(_interface_params(component, row))
        yield f"      <{tag}>{params}</{side}>" if params else f"      <{tag}/>"
    for name in component.requests:
        yield f'      <command_interface name="{name}"/>'
    yield f"    </{component.kind}>"


def _interface_params(component: _Component, row: _Interface) -> Iterator[str]:
    if row.initial:
        yield f'<param name="initial_value">{row.initial:g}</param>'
    # A limit in rad or m does not apply to increments.
    if component.stated is not None and row.is_command and row.scaled:
        limits = interface_limits(component.stated).get(row.name, ())
        for name, value in zip(("min", "max"), limits, strict=False):
            yield f'<param name="{name}">{value!r}</param>'


def _plain(text: str) -> str:
    """Return a text that contains nothing for xacro to evaluate."""
    return text.replace("$(", "$$(").replace("${", "$${")


def _attribute(text: str) -> str:
    return quoteattr(_plain(text))


def _text(text: str) -> str:
    return escape(_plain(text))


def _open_symbols(
    description: Description, number: int, sub: DescribedSubDevice
) -> Iterator[DeviceSymbol]:
    """Yield the inputs, and the outputs that a client may write in every cycle."""
    managers = sub.device.layout.managers
    copied = [
        (copy.destination.sm_index, copy.destination.bit_offset, copy.bits)
        for copy in description.copies
        if copy.destination.subdevice == number
    ]
    for symbol in device_symbols(sub.device.layout):
        first, end = symbol.bit_offset, symbol.bit_offset + symbol.view.bits
        index = managers[symbol.sm].sm.index
        is_copied = any(sm == index and at < end and first < at + bits for sm, at, bits in copied)
        if not symbol.is_output or not (is_copied or symbol.entry.restart_relevant):
            yield symbol


def _components(
    sub: DescribedSubDevice, name: str, symbols: Sequence[DeviceSymbol]
) -> Iterator[_Component]:
    """Yield the components of a SubDevice: those of the description, or one for each axis."""
    axes = max(1, len(drive_axes(sub.device.layout)))
    groups: dict[int | str, list[DeviceSymbol]] = {n: [] for n in range(len(sub.components))}
    for symbol in symbols:
        groups.setdefault(_owner(sub, name, symbol, axes), []).append(symbol)
    for owner, own in groups.items():
        driven = driven_axes(sub, name, own)
        rows = list(_interfaces(name, own, axes))
        if driven:  # it writes its controlword, and has no value without a command
            own = [s for s in own if not is_output_of(s, CONTROLWORD)]
            rows = [replace(row, initial=0.0) for row in _interfaces(name, own, axes)]
        if isinstance(owner, int):
            stated = sub.components[owner]
            wanted = (stated.states, stated.commands)
            rows.sort(key=lambda row: _rank(wanted[row.is_command], row.name))
            yield _Component(stated.kind, stated.name or name, rows, stated, driven)
        else:
            is_joint = any(row.name == "position" and not row.is_command for row in rows)
            yield _Component("joint" if is_joint else "gpio", owner, rows)


def _owner(sub: DescribedSubDevice, name: str, symbol: DeviceSymbol, axes: int) -> int | str:
    """Return the number of the component that a symbol belongs to, or the name of another one.

    ``for`` has precedence. Without it, the first axis belongs to the first component that asks for
    the interface, or to the first component of all.
    """
    names = [c.name for c in sub.components]
    component = symbol.entry.component
    if component:
        return names.index(component) if component in names else component
    axis = _axis_of(symbol, axes)
    if axis or not names:
        return name if axes == 1 else f"{name}_{axis + 1}"
    asking = (
        n
        for n, c in enumerate(sub.components)
        if symbol.stated in (c.commands if symbol.is_output else c.states)
    )
    return next(asking, 0)


def _axis_of(symbol: DeviceSymbol, axes: int) -> int:
    """Return the axis that an object belongs to; 0 for other objects."""
    axis = (symbol.entry.index - 0x6000) // AXIS_STEP
    return axis if 0 <= axis < axes else 0


def _interfaces(subdevice: str, symbols: Sequence[DeviceSymbol], axes: int) -> Iterator[_Interface]:
    """Yield the interfaces of a component.

    The name is from the slave YAML, or else the standard name of an object of an axis, or else from
    the plan.
    """
    all_stated = {(s.is_output, s.stated) for s in symbols}
    taken: set[tuple[bool, str]] = set()
    for symbol in symbols:
        side, index = symbol.is_output, symbol.entry.index - _axis_of(symbol, axes) * AXIS_STEP
        standard = (_COMMANDS if side else _STATES).get(index, "")
        whole = symbol.is_whole and symbol.entry.subindex == 0
        name = symbol.stated
        if not name or (side, name) in taken:
            name = standard if whole and (side, standard) not in all_stated | taken else ""
        taken.add((side, name))
        scaled = (symbol.view.factor, symbol.view.offset) != (1.0, 0.0)
        default = symbol.entry.default if whole and side and not scaled else None
        yield _Interface(
            is_command=side,
            name=name or symbol.name,
            subdevice=subdevice,
            symbol=symbol.name,
            scaled=scaled,
            initial=default if default is not None and math.isfinite(default) else 0.0,
        )


def _rank(wanted: Sequence[str], name: str) -> int:
    """Return the sort key: interfaces that the description names come first, in its order."""
    return wanted.index(name) if name in wanted else len(wanted)


def _without_taken(
    rows: Collection[_Interface], taken: Collection[_Interface]
) -> Iterator[_Interface]:
    names = {(row.is_command, row.name) for row in taken}
    for row in rows:
        # Another SubDevice serves this interface of the component; the full name is unique.
        if (row.is_command, row.name) in names:
            yield replace(row, name=f"{row.subdevice}.{row.symbol}")
        else:
            yield row


def _notes(component: _Component) -> Iterator[str]:
    if len(component.axes) > 1:
        drives = ", ".join(axis.subdevice for axis in component.axes)
        yield f"{component.name}: not an axis, because several drives have it: {drives}"
    if component.stated is not None:
        wanted = {"state": component.stated.states, "command": component.stated.commands}
        for side, names in wanted.items():
            have = {r.name for r in component.interfaces if r.is_command is (side == "command")}
            for name in names:
                if name not in have and name not in component.requests:
                    yield (
                        f"{component.name}: the plan has nothing for the {side}_interface {name}; "
                        "a plugin of the driver may provide it, fsoe_net_ros does not"
                    )
    for row in component.interfaces:
        if component.kind == "joint" and row.name == "position" and not row.scaled:
            side = "command" if row.is_command else "state"
            yield (
                f"{component.name}: the {side} position has no factor, so its unit is that of the "
                "drive, not radians"
            )
