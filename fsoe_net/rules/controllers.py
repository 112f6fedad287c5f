"""FSN477, FSN479, FSN480: interfaces that controllers need against those that the robot offers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from fsoe_net.diag.diagnostic import Related, Span
from fsoe_net.diag.guesses import guesses, near_misses, one_of
from fsoe_net.model.robot import Controller, InterfaceUse, Robot
from fsoe_net.model.robot_graph import served_components
from fsoe_net.rules.context import Context, few


def check_controllers(ctx: Context) -> None:
    """Check the controllers of a robot, if files with them were given."""
    robot = ctx.resolution.network.robot
    if robot is None:
        return
    _missing(ctx, robot)
    _claimed_twice(ctx, robot)
    unchecked = [c for c in robot.controllers if not c.is_checked]
    if unchecked:
        ctx.add(
            "FSN480",
            unchecked[0].span,
            "interfaces of these controllers are not checked: "
            f"{few([f'{c.name} ({c.type})' for c in unchecked])}",
            hint="compare their parameters with the robot description",
        )


def _missing(ctx: Context, robot: Robot) -> None:
    offered = dict(_offered(robot))
    provided = set(_provided(ctx))
    own = {c.name for c in robot.components}
    names = {c.name for c in robot.controllers}
    for controller in robot.controllers:
        # One wrong interface of a list concerns each joint: one finding at its place.
        places: dict[Span, list[InterfaceUse]] = {}
        for use in controller.uses:
            end = use.name.rpartition("/")[0]
            # A controller can be the hardware of another one, and so can other hardware.
            if end.partition("/")[0] in names or (end not in own and not robot.is_closed):
                continue
            if (use.is_command, use.name) not in offered:
                place = use.at("interface") if end in own else use.span
                places.setdefault(place, []).append(use)
        for place, uses in places.items():
            by_channel = (uses[0].is_command, uses[0].name) in provided
            _not_offered(ctx, controller, place, uses, offered, by_channel=by_channel)


def _offered(robot: Robot) -> Iterator[tuple[tuple[bool, str], Span]]:
    for component in robot.components:
        for is_command, name, span in component.interfaces():
            yield (is_command, f"{component.name}/{name}"), span


def _provided(ctx: Context) -> Iterator[tuple[bool, str]]:
    """Yield the interfaces that channels could serve, also where the description lacks them."""
    for node in served_components(ctx.resolution.network.subdevices):
        for is_command in (False, True):
            for channel in node.channels(is_command=is_command):
                yield is_command, f"{node.component.name}/{channel.name}"


def _not_offered(
    ctx: Context,
    controller: Controller,
    place: Span,
    uses: Sequence[InterfaceUse],
    offered: Mapping[tuple[bool, str], Span],
    *,
    by_channel: bool,
) -> None:
    use = uses[0]
    end, _, interface = use.name.rpartition("/")
    ends: dict[str, dict[str, Span]] = {}
    for (is_command, name), span in offered.items():
        if is_command is use.is_command:
            ends.setdefault(name.rpartition("/")[0], {})[name.rpartition("/")[2]] = span
    # The joint is there: its interface is wrong; else the name of the joint.
    known = ends.get(end) or {name: next(iter(own.values())) for name, own in ends.items()}
    # A joint without its prefix is meant for it; an interface with one more word is another one.
    close = near_misses(interface, known) if end in ends else guesses(end, known)
    side = "command" if use.is_command else "state"
    hint = f"add the {side}_interface to the robot description, or correct the name here"
    if by_channel:
        hint = f"write the {side}_interface {interface} in the robot description: a channel has it"
    elif close:
        hint = f"write {one_of(close)}"
    ctx.add(
        "FSN477",
        place,
        f"controller {controller.name} needs {side} interfaces that the robot description does "
        f"not have: {few([u.name for u in uses])}; it cannot be activated",
        hint=hint,
        related=tuple(
            Related(span=known[name], message=f"has {name}") for name in close or [*known][:3]
        ),
    )


def _claimed_twice(ctx: Context, robot: Robot) -> None:
    first: dict[str, tuple[Controller, InterfaceUse]] = {}
    reported: set[tuple[str, str]] = set()
    for controller in robot.controllers:
        for use in (use for use in controller.uses if use.is_command):
            other, place = first.setdefault(use.name, (controller, use))
            pair = (other.name, controller.name)
            if other is controller or pair in reported:
                continue
            reported.add(pair)
            ctx.add(
                "FSN479",
                use.span,
                f"controllers {other.name} and {controller.name} both claim {use.name}: only one "
                "of them can be active",
                hint="fine for alternatives; else give each its own joints",
                related=(Related(span=place.span, message=f"claimed by {other.name}"),),
            )
