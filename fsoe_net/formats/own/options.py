"""How references in the files of a network are followed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from fsoe_net.dataclass import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadOptions:
    """Options for following references.

    Args:
        packages: ROS package name to folder, for ``$(find pkg)`` and ``package://pkg``.
        xacro_args: Values of ``$(arg name)``.
        xacro_env: Names of the environment variables that ``$(env name)`` may read.
        trust_xacro: Expand xacro without confinement; the file can then do everything that the user
            can do.
        master: Number or name of the EtherCAT master to read if a file has several.
    """

    packages: Mapping[str, str] = field(default_factory=dict)
    xacro_args: Mapping[str, str] = field(default_factory=dict)
    xacro_env: tuple[str, ...] = ()
    trust_xacro: bool = False
    master: str = ""
