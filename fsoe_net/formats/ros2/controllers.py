"""Reads the parameters of controllers: which interfaces each of them claims and reads.

Parameter names are those of ros2_controllers (Humble to Rolling) and of the controller manager. A
type that is not in the table is kept without interfaces.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.yaml_tree import MapNode, Node, ScalarNode, SeqNode
from fsoe_net.model.robot import Controller, InterfaceUse, UpdateRate

PARAMETERS = "ros__parameters"
_MANAGER = "controller_manager"
_DEEPEST = 8
_MOST_USES = 4096
"""Interfaces of one controller; a list of joints times a list of interfaces can be very long."""

_Name = tuple[str, Span]
_Uses = Iterator[InterfaceUse]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Parameters:
    """Parameters of a node, which may be in several maps: of its name, and of wildcards."""

    maps: tuple[MapNode, ...]

    def names(self, key: str) -> list[_Name]:
        """Return the texts under a key, a list or one scalar, with their places."""
        for found in (m.get(key) for m in self.maps):
            if isinstance(found, SeqNode):
                return [(i.text, i.span) for i in found.items if isinstance(i, ScalarNode)]
            if isinstance(found, ScalarNode) and not found.is_null:
                return [(found.text, found.span)]
        return []

    def child(self, key: str) -> MapNode | None:
        """Return the map under a key."""
        found = (m.get(key) for m in self.maps)
        return next((node for node in found if isinstance(node, MapNode)), None)

    def truth(self, key: str, *, default: bool) -> bool:
        """Return a boolean, in the words of YAML 1.1."""
        given = next((m for m in self.maps if m.text(key) is not None), None)
        return default if given is None else given.truth(key)


def _each(ends: Sequence[_Name], interfaces: Sequence[_Name], *, is_command: bool) -> _Uses:
    for (end, span), (interface, place) in itertools.product(ends, interfaces):
        yield InterfaceUse(
            span=span,
            fields={"interface": place},
            name=f"{end}/{interface}",
            is_command=is_command,
        )


def _fixed(ends: Sequence[_Name], interface: str, *, is_command: bool) -> _Uses:
    for end, span in ends:
        yield InterfaceUse(span=span, name=f"{end}/{interface}", is_command=is_command)


def _lists(ends: str, interfaces: str, *, is_command: bool) -> Callable[[_Parameters], _Uses]:
    """Return the reader of a list of joints, each with the same interfaces."""
    return lambda p: _each(p.names(ends), p.names(interfaces), is_command=is_command)


def _group(interface: str) -> Callable[[_Parameters], _Uses]:
    return lambda p: _fixed(p.names("joints"), interface, is_command=True)


def _trajectory(p: _Parameters) -> _Uses:
    joints = p.names("joints")
    commanded = p.names("command_joints") or joints
    yield from _each(commanded, p.names("command_interfaces"), is_command=True)
    yield from _each(joints, p.names("state_interfaces"), is_command=False)


def _diff_drive(p: _Parameters) -> _Uses:
    wheels = p.names("left_wheel_names") + p.names("right_wheel_names")
    yield from _fixed(wheels, "velocity", is_command=True)
    if not p.truth("open_loop", default=False):
        feedback = "position" if p.truth("position_feedback", default=True) else "velocity"
        yield from _fixed(wheels, feedback, is_command=False)


def _gpios(p: _Parameters) -> _Uses:
    for key, is_command in (("command_interfaces", True), ("state_interfaces", False)):
        sides = p.child(key)
        for name, node in sides.pairs.items() if sides is not None else ():
            if isinstance(node, MapNode):
                for interface, span in _Parameters(maps=(node,)).names("interfaces"):
                    use = f"{name}/{interface}"
                    yield InterfaceUse(span=span, name=use, is_command=is_command)


_TYPES: dict[str, Callable[[_Parameters], _Uses]] = {
    "joint_state_broadcaster/JointStateBroadcaster": _lists(
        "joints", "interfaces", is_command=False
    ),
    "joint_trajectory_controller/JointTrajectoryController": _trajectory,
    "forward_command_controller/ForwardCommandController": _lists(
        "joints", "interface_name", is_command=True
    ),
    "forward_command_controller/MultiInterfaceForwardCommandController": _lists(
        "joint", "interface_names", is_command=True
    ),
    "position_controllers/JointGroupPositionController": _group("position"),
    "velocity_controllers/JointGroupVelocityController": _group("velocity"),
    "effort_controllers/JointGroupEffortController": _group("effort"),
    "diff_drive_controller/DiffDriveController": _diff_drive,
    "gpio_controllers/GpioCommandController": _gpios,
}


def is_controllers(root: MapNode) -> bool:
    """Whether a document has the parameters of ROS 2 nodes."""
    return next(_nodes(root), None) is not None


def read_controllers(
    roots: Sequence[MapNode], out: Collector
) -> tuple[tuple[UpdateRate, ...], tuple[Controller, ...]]:
    """Return update rates and controllers of all files of a robot.

    Args:
        roots: The documents.
        out: Takes FSN113 for an ``update_rate`` that is not a frequency.
    """
    nodes: dict[str, list[MapNode]] = {}
    for root in roots:
        for name, parameters in _nodes(root):
            nodes.setdefault(name, []).append(parameters)
    # A wildcard applies to each node; parameters of the node itself count first.
    general = [m for name in ("**", "*") for m in nodes.pop(name, ())]
    managers = nodes.pop(_MANAGER, [])
    managers += general
    rates = [rate for m in managers if (rate := _update_rate(m, out)) is not None]
    found = [
        _controller(name, node, _Parameters(maps=(*nodes.get(name, ()), *general)))
        for name, node in _declared(managers, nodes).items()
    ]
    return tuple(rates), tuple(found)


def _declared(
    managers: Sequence[MapNode], nodes: Mapping[str, Sequence[MapNode]]
) -> dict[str, MapNode]:
    """Return where each controller has its type."""
    declared = {
        name: node
        for manager in managers
        for name, node in manager.pairs.items()
        if isinstance(node, MapNode) and node.text("type") is not None
    }
    # A spawner can also take the type from the parameters of the controller.
    for name, maps in nodes.items():
        own = next((m for m in maps if m.text("type") is not None), None)
        if own is not None:
            declared.setdefault(name, own)
    return declared


def _nodes(root: MapNode) -> Iterator[tuple[str, MapNode]]:
    """Yield the parameters of each node by its name without namespaces."""
    waiting: list[tuple[str, Node, int]] = [("", root, 0)]
    while waiting:
        path, node, depth = waiting.pop()
        if not isinstance(node, MapNode):
            continue
        parameters = node.get(PARAMETERS)
        if isinstance(parameters, MapNode):
            yield path.rpartition("/")[2], parameters
        elif depth < _DEEPEST:
            rows = [(f"{path}/{key}", child, depth + 1) for key, child in node.pairs.items()]
            waiting += reversed(rows)


def _controller(name: str, declared: MapNode, parameters: _Parameters) -> Controller:
    kind = declared.text("type") or ""
    read = _TYPES.get(kind)
    # Substitutions of a launch file are not names yet.
    rows = [] if read is None else list(itertools.islice(read(parameters), _MOST_USES + 1))
    is_whole = read is not None and len(rows) <= _MOST_USES
    uses = tuple(use for use in rows[:_MOST_USES] if "$(" not in use.name)
    is_checked = is_whole and len(uses) == len(rows)
    return Controller(
        span=declared.at("type"), name=name, type=kind, uses=uses, is_checked=is_checked
    )


def _update_rate(parameters: MapNode, out: Collector) -> UpdateRate | None:
    text = parameters.text("update_rate")
    if text is None or "$(" in text:
        return None
    try:
        hz = float(text)
    except ValueError:
        hz = math.nan
    if 0 < hz < math.inf:
        return UpdateRate(span=parameters.at("update_rate"), hz=hz)
    out.add(
        "FSN113",
        parameters.at("update_rate"),
        f"update_rate {text[:40]!r} must be a frequency above 0",
        hint="write it in Hz, such as 500",
    )
    return None
