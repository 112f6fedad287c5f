"""A description as transfer YAML for ethercat_driver_ros2, with its slave YAMLs."""

from __future__ import annotations

from typing import Literal

from fsoe_net.formats.own.write import NetworkFiles
from fsoe_net.formats.shared.writers import Written, quoted
from fsoe_net.model.description import Description

_Version = Literal["2025", "2026-06", "2026-08", "newest"]
_PLUGIN = "ethercat_generic_plugins/GenericEcSlave"


def write_driver(
    description: Description, *, file: str = "transfers.yaml", version: _Version = "newest"
) -> Written:
    """Return a transfer YAML, which declares its modules, with their slave YAMLs.

    Args:
        description: Description to write.
        file: Name of the transfer YAML.
        version: Version of the driver: that of 2025 spells some keys differently.

    Raises:
        InputError: A copy does not begin at an entry, or a device does not fit into a slave YAML.
    """
    word = "safety" if version == "2025" else "transfer"
    files = NetworkFiles(description)
    lines = [f"{word}_modules:" if description.subdevices else f"{word}_modules: []"]
    for sub, called, place, config in files.rows():
        lines += [
            f"  - name: {quoted(called)}",
            f"    plugin: {_PLUGIN}",
            f"    parameters: {{{place}, slave_config: {config}}}",
        ]
        if sub.revision is not None:
            files.notes.append(f"{called}: revision 0x{sub.revision:08x} is not in these files")
    lines += files.nets(f"{word}_master")
    if description.cycle_us:
        rate = 1e6 / description.cycle_us
        files.notes.append(f"the cycle is not in these files; set control_frequency to {rate:g}")
    if files.configs:
        files.notes.append("the driver needs an absolute path in each slave_config")
    return files.written(file, lines)
