"""The older ``ethercat_slaves.yaml`` of IgH nodes for ROS."""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Signature, Yields

_TITLE = "an `ethercat_slaves.yaml` of an IgH node for ROS"

FORMAT = Format(
    kind="ros-slaves",
    title=_TITLE,
    expects="YAML with the key `ethercat_slaves`",
    yields=Yields.BUS,
    read="fsoe_net.formats.ros_slaves.read:load_ros_slaves",
    signatures=(Signature(words=_TITLE, text=rb"^[ \t]*ethercat_slaves[ \t]*:"),),
)
