"""YAML and JSON of fsoe-net itself, including slave and transfer YAML, which ROS 2 also uses."""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Signature, Target, Yields

FORMAT = Format(
    kind="yaml",
    title="a network, transfer or slave YAML",
    expects="YAML with the key `nets`, `subdevices` or `vendor_id`",
    yields=Yields.NETWORK,
    signatures=(
        Signature(
            words="a YAML file of ethercat_driver_ros2 or fsoe-net",
            text=rb"^[ \t]*(nets|subdevices|vendor_id)[ \t]*:",
        ),
    ),
    suffixes=(".yaml", ".yml"),
    targets=(
        Target(
            name="network",
            write="fsoe_net.formats.own.write:write_network",
            suffixes=(".yaml", ".yml"),
        ),
    ),
)
