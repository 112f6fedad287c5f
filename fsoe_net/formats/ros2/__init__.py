"""URDF and xacro of ethercat_driver_ros2, and controllers that use the robot.

Its YAML is written here and read in `formats.own`.
"""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Signature, Target, Yields

_WRITE = "fsoe_net.formats.ros2.write:write_driver"

FORMAT = Format(
    kind="urdf",
    title="a URDF or xacro of ethercat_driver_ros2",
    expects="XML with the root <robot>",
    yields=Yields.NETWORK,
    signatures=(
        Signature(words="a robot description (URDF)", root="robot"),
        Signature(words="a file of ROS 2 parameters", text=rb"^[ \t]+ros__parameters[ \t]*:"),
    ),
    suffixes=(".urdf", ".xacro"),
    targets=(
        Target(name="driver", write=_WRITE, is_folder=True),
        *(
            Target(name=f"driver-{v}", write=_WRITE, options={"version": v}, is_folder=True)
            for v in ("2025", "2026-06", "2026-08")
        ),
        Target(
            name="ros2-control",
            write="fsoe_net.formats.ros2.write_control:write_control",
            suffixes=(".urdf.xacro",),
        ),
    ),
)
