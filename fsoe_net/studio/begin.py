"""The initial text of a network without a file."""

from __future__ import annotations

import os

from fsoe_net.formats.own.write import write_network
from fsoe_net.model.description import Description


def empty_network(path: str) -> str:
    """Return a network without SubDevices, named after its folder.

    Args:
        path: The network file to create.
    """
    folder = os.path.basename(os.path.dirname(os.path.abspath(path)))
    empty = Description(format="studio", path="")
    return write_network(empty, name=folder or "network").files["network.yaml"]
