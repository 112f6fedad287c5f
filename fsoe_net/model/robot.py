"""The robot around the bus: interfaces that it offers, and controllers that use them."""

from __future__ import annotations

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import Located, RobotComponent


@dataclass(frozen=True, slots=True, kw_only=True)
class InterfaceUse(Located):
    """A command interface that a controller claims, or a state interface that it reads.

    ``name`` is that of ros2_control: ``axis_1/position``. Its place is that of the joint; the field
    ``interface`` has the place of the interface, if the file names it.
    """

    name: str
    is_command: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Controller(Located):
    """A controller of a controllers.yaml.

    Attributes:
        name: Name of its node.
        type: Type in the form of pluginlib; empty if no file states it.
        uses: Interfaces that it needs, in the order of its parameters.
        is_checked: Whether ``uses`` are all interfaces that this type needs.
    """

    name: str
    type: str
    uses: tuple[InterfaceUse, ...] = ()
    is_checked: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class UpdateRate(Located):
    """``update_rate`` of a controller manager, in Hz."""

    hz: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """Facts of a robot description and its controllers outside the bus.

    Attributes:
        components: Joints, gpios and sensors of all ``ros2_control`` blocks.
        is_closed: Whether the EtherCAT driver is the only hardware, so that no other one can offer
            an interface.
        update_rates: One for each controller manager that states it.
        controllers: Controllers of all files, in their order.
    """

    components: tuple[RobotComponent, ...] = ()
    is_closed: bool = True
    update_rates: tuple[UpdateRate, ...] = ()
    controllers: tuple[Controller, ...] = ()
