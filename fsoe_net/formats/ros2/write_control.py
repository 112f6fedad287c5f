"""A description as a ``ros2_control`` block for the package ``fsoe_net_ros``.

Its components are SubDevices and safety connections, its interfaces the symbols of the plan: the
package finds them by ``COMPONENT.INTERFACE``.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

from fsoe_net.formats.shared.writers import Written, unique_names
from fsoe_net.model.bus import Direction, Entry
from fsoe_net.model.description import DescribedSubDevice, Description

__all__ = ["write_control"]

_MOST_BITS = 64
_ACTUAL_POSITION = "0x6064:00"


def write_control(description: Description, *, file: str = "ros2_control.urdf.xacro") -> Written:
    """Return one URDF; a SubDevice with an actual position is a joint, every other one a gpio.

    Outputs that a copy writes, and those that can restart a machine, are no commands.

    Args:
        description: What is written.
        file: Name of the URDF.
    """
    names = unique_names(description)
    lines = [
        '<?xml version="1.0"?>',
        "<!-- For fsoe_net_ros: what controllers may read and write beside safety. -->",
        '<robot name="cell" xmlns:xacro="http://www.ros.org/wiki/xacro">',
        '  <xacro:arg name="socket" default="/run/fsn-master/fsn-master-eth1.sock"/>',
        '  <ros2_control name="cell" type="system">',
        "    <hardware>",
        "      <plugin>fsoe_net_ros/CellSystem</plugin>",
        '      <param name="socket">$(arg socket)</param>',
        '      <param name="start">false</param>',
        "    </hardware>",
    ]
    joints = []
    for number, sub in enumerate(description.subdevices):
        rows = list(_interfaces(description, number, sub))
        if not rows:
            continue
        states = {name for kind, name in rows if kind == "state"}
        is_joint = bool({_ACTUAL_POSITION, "position"} & states)
        joints += [names[number]] * is_joint
        lines += _component("joint" if is_joint else "gpio", names[number], rows)
    for place, connection in enumerate(description.connections):
        ends = [names[n] for n in (connection.main, connection.sub) if n is not None]
        name = connection.name or "-".join(ends) or f"connection_{place + 1}"
        lines += _component("sensor", name, [("state", "in_data"), ("state", "state")])
    lines += ["  </ros2_control>", *_links(joints), "</robot>"]
    notes = ["the socket is that of your fsn-master: xacro … socket:=PATH"]
    return Written(files={file: "\n".join(lines) + "\n"}, notes=tuple(notes))


def _links(joints: list[str]) -> Iterator[str]:
    """Yield joints and links as a URDF needs them; your own description replaces them."""
    yield '  <link name="world"/>'
    for name in joints:
        yield f"  <link name={_attribute(name + '_link')}/>"
        yield f'  <joint name={_attribute(name)} type="continuous">'
        yield f'    <parent link="world"/><child link={_attribute(name + "_link")}/>'
        yield "  </joint>"


def _attribute(text: str) -> str:
    """Return a name in quotes; xacro evaluates nothing in it."""
    return quoteattr(text.replace("$(", "$$(").replace("${", "$${"))


def _component(kind: str, name: str, rows: list[tuple[str, str]]) -> Iterator[str]:
    yield f"    <{kind} name={_attribute(name)}>"
    for side, interface in rows:
        yield f"      <{side}_interface name={_attribute(interface)}/>"
    yield f"    </{kind}>"


def _interfaces(
    description: Description, number: int, sub: DescribedSubDevice
) -> Iterator[tuple[str, str]]:
    """Yield ``state`` or ``command`` and the name of each symbol, as the plan calls it."""
    taken: set[str] = set()
    for manager in sub.device.layout.managers:
        is_output = manager.sm.direction is Direction.OUTPUT
        copied = [
            (copy.destination.bit_offset, copy.destination.bit_offset + copy.bits)
            for copy in description.copies
            if (copy.destination.subdevice, copy.destination.sm_index) == (number, manager.sm.index)
        ]
        for placed in manager.placed:
            entry, first = placed.entry, placed.bit_offset
            last = max(first, placed.end_bit - 1)
            in_frame = manager.block_at(first) is not None or manager.block_at(last) is not None
            if not entry.registered or in_frame or not 0 < entry.bits <= _MOST_BITS:
                continue
            closed = entry.restart_relevant or any(a <= last and first < b for a, b in copied)
            for interface in _views(entry):
                name = _unused(interface, entry, taken)
                if not is_output:
                    yield "state", name
                elif not closed:
                    yield "command", name


def _views(entry: Entry) -> list[str]:
    if entry.views:
        return [v.command_interface or v.state_interface or entry.name or "" for v in entry.views]
    own = "data_mapping" not in entry.fields
    named = (entry.command_interface or entry.state_interface) if own else None
    return [named or entry.name or ""]


def _unused(interface: str, entry: Entry, taken: set[str]) -> str:
    """Return the name that the plan gives: the interface, else the address, else with a number."""
    number = 2
    names = [n for n in (interface, entry.address) if n]
    while all(name in taken for name in names):
        names.append(f"{entry.address}-{number}")
        number += 1
    name = next(n for n in names if n not in taken)
    taken.add(name)
    return name
