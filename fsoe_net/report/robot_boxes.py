"""The robot as a graph: controllers, joints, channels and SubDevices, and the lines between them.

An end of a line is wrong if a finding is at its place, so that drawing and check cannot differ.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from fsoe_net.diag.diagnostic import Diagnostic, Severity, Span
from fsoe_net.diag.words import counted, listed
from fsoe_net.document.markup import shortened
from fsoe_net.model.bus import RobotComponent, SubDevice
from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.resolve import Connection, Resolution
from fsoe_net.model.robot import Controller
from fsoe_net.model.robot_graph import RobotChannel, channels_of


class EndState(enum.Enum):
    """Whether an end has a line."""

    BOUND = "bound"
    OPEN = "open"
    WRONG = "unbound"


@dataclass(frozen=True, slots=True, kw_only=True)
class End:
    """An interface: as a controller needs it, as a joint has it, or as a channel provides it.

    ``at`` is the object of a channel, such as ``0x607a:00``; otherwise empty.
    """

    name: str
    is_command: bool
    state: EndState
    at: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotBox:
    """A controller, a joint, gpio or sensor, or a SubDevice; ``about`` is its type or place."""

    name: str
    about: str
    ends: tuple[End, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wire:
    """A line between two ends, each given by the numbers of its box and of its end."""

    left: tuple[int, int]
    right: tuple[int, int]
    is_command: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyWire:
    """An FSoE connection between two SubDevices, given by their numbers."""

    name: str
    main: int
    sub: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotGraph:
    """The boxes of each column, and the lines between.

    Attributes:
        claims: From controllers to the interfaces of components.
        bindings: From interfaces of components to channels of SubDevices.
    """

    controllers: tuple[RobotBox, ...]
    components: tuple[RobotBox, ...]
    subdevices: tuple[RobotBox, ...]
    claims: tuple[Wire, ...]
    bindings: tuple[Wire, ...]
    safety: tuple[SafetyWire, ...]

    @property
    def unbound(self) -> tuple[str, ...]:
        """The ends that are wrong, by box and name."""
        boxes = (*self.controllers, *self.components, *self.subdevices)
        return tuple(
            f"{b.name} {e.name}" for b in boxes for e in b.ends if e.state is EndState.WRONG
        )

    @property
    def words(self) -> str:
        """Its content in one line, as a text alternative."""
        counts = (
            counted(len(self.controllers), "controller"),
            counted(len(self.components), "component"),
            counted(len(self.subdevices), "SubDevice"),
            counted(len(self.safety), "FSoE connection"),
        )
        names = listed([shortened(name, 80) for name in self.unbound], 4)
        return f"{', '.join(counts)}; unbound: {names or 'nothing'}"


_Interface = tuple[str, bool]  # its name, and whether it is a command
_Row = tuple[str, bool, Span, str]  # the same, its place, and the object of a channel


def robot_graph(resolution: Resolution, found: Sequence[Diagnostic]) -> RobotGraph:
    """Return the graph of a network and its robot.

    Args:
        resolution: The network, which may have errors.
        found: Its findings.
    """
    wrong = {d.span for d in found if d.level is not Severity.INFO}
    network = resolution.network
    subs, robot = network.subdevices, network.robot
    controllers = robot.controllers if robot else ()
    components = _components(network)
    channels = [
        [channel for side in (True, False) for channel in channels_of(sub, is_command=side)]
        for sub in subs
    ]
    rows = [_interfaces(component) for component in components]
    bindings = _bindings(components, rows, subs, channels)
    claims = _claims(controllers, components, rows)
    claimed = {line.left for line in claims}
    left, right = (
        _numbers(line.left for line in bindings),
        _numbers(line.right for line in bindings),
    )
    return RobotGraph(
        controllers=tuple(_controller_box(n, c, claimed, wrong) for n, c in enumerate(controllers)),
        components=tuple(
            RobotBox(name=c.name, about=c.kind, ends=_ends(rows[n], left.get(n, set()), wrong))
            for n, c in enumerate(components)
        ),
        subdevices=tuple(
            RobotBox(
                name=sub.name,
                about=_address(sub),
                ends=_ends(map(_row, channels[n]), right.get(n, set()), wrong),
            )
            for n, sub in enumerate(subs)
        ),
        claims=claims,
        bindings=bindings,
        safety=tuple(_safety_wire(c, resolution) for c in resolution.connections),
    )


def _components(network: NetworkConfig) -> list[RobotComponent]:
    """Return each joint, gpio and sensor once, also those without a SubDevice."""
    robot = network.robot
    of_subs = [c for sub in network.subdevices for c in sub.components]
    return list(dict.fromkeys([*(robot.components if robot else ()), *of_subs]))


def _safety_wire(c: Connection, resolution: Resolution) -> SafetyWire:
    numbers = resolution.numbers
    return SafetyWire(name=c.name, main=numbers[c.main.name], sub=numbers[c.sub.name])


def _numbers(ends: Iterable[tuple[int, int]]) -> dict[int, set[int]]:
    """Return the numbers of the ends of each box."""
    found: dict[int, set[int]] = {}
    for box, end in ends:
        found.setdefault(box, set()).add(end)
    return found


def _ends(rows: Iterable[_Row], bound: set[int], wrong: set[Span]) -> tuple[End, ...]:
    return tuple(
        _end(name, is_command, place in wrong, n in bound, at)
        for n, (name, is_command, place, at) in enumerate(rows)
    )


def _row(channel: RobotChannel) -> _Row:
    return channel.name, channel.is_command, channel.span, channel.entry.address


def _end(name: str, is_command: bool, is_wrong: bool, is_bound: bool, at: str = "") -> End:
    state = EndState.BOUND if is_bound else EndState.OPEN
    return End(name=name, is_command=is_command, state=EndState.WRONG if is_wrong else state, at=at)


def _interfaces(component: RobotComponent) -> list[_Row]:
    """Return the interfaces of a component, commands first as in the picture."""
    rows = [(name, is_command, place, "") for is_command, name, place in component.interfaces()]
    return sorted(rows, key=lambda row: not row[1])


def _bindings(
    components: Sequence[RobotComponent],
    rows: Sequence[Sequence[_Row]],
    subs: Sequence[SubDevice],
    channels: Sequence[Sequence[RobotChannel]],
) -> tuple[Wire, ...]:
    lines = []
    numbers = {component: n for n, component in enumerate(components)}
    for n, sub in enumerate(subs):
        places: dict[tuple[str, bool], list[int]] = {}
        for m, channel in enumerate(channels[n]):
            places.setdefault((channel.name, channel.is_command), []).append(m)
        for component in sub.components:
            number = numbers[component]
            for row, (name, is_command, *_) in enumerate(rows[number]):
                lines += [
                    Wire(left=(number, row), right=(n, m), is_command=is_command)
                    for m in places.get((name, is_command), ())
                    if channels[n][m].serves(component)
                ]
    return tuple(lines)


def _claims(
    controllers: Sequence[Controller],
    components: Sequence[RobotComponent],
    rows: Sequence[Sequence[_Row]],
) -> tuple[Wire, ...]:
    offered: dict[_Interface, tuple[int, int]] = {}
    for n, component in enumerate(components):
        for m, (name, is_command, *_) in enumerate(rows[n]):
            offered.setdefault((f"{component.name}/{name}", is_command), (n, m))
    return tuple(
        Wire(left=(n, m), right=offered[use.name, use.is_command], is_command=use.is_command)
        for n, controller in enumerate(controllers)
        for m, use in enumerate(controller.uses)
        if (use.name, use.is_command) in offered
    )


def _controller_box(
    number: int, controller: Controller, claimed: set[tuple[int, int]], wrong: set[Span]
) -> RobotBox:
    ends = []
    for m, use in enumerate(controller.uses):
        is_bound = (number, m) in claimed
        # A finding at a list concerns those of its interfaces that nothing offers.
        is_wrong = not is_bound and not wrong.isdisjoint((use.span, use.at("interface")))
        ends.append(_end(use.name, use.is_command, is_wrong, is_bound))
    kind = controller.type.rpartition("/")[2]
    about = kind if controller.is_checked else f"not checked: {kind}"
    return RobotBox(name=controller.name, about=about, ends=tuple(ends))


def _address(sub: SubDevice) -> str:
    return f"alias {sub.alias}+{sub.position}" if sub.alias else f"position {sub.position}"
