"""Converts names of a plan to names of ROS 2 (REP 144, "Topic and Service name mapping to DDS")."""

from __future__ import annotations

import re

from fsoe_net.diag.printable import printable

_MOST = 80  # of a topic's 247 characters; three tokens and a few words fit
_OBJECT = re.compile(r"0x([0-9a-fA-F]{4})(?::([0-9a-fA-F]{2}))?")


def legal_token(name: str) -> str:
    """Return a part of a topic: letters, digits and single underscores, no leading digit.

    ``0x6064:00`` becomes ``object_6064_00``. No token begins with an underscore, because ROS hides
    such names.
    """
    found = _OBJECT.fullmatch(name)
    if found is not None:
        name = f"object_{'_'.join(p for p in found.groups() if p).lower()}"
    token = re.sub(r"_+", "_", re.sub(r"[^A-Za-z0-9]", "_", name)).strip("_")
    if not token:
        return "unnamed"
    return (f"n{token}" if token[0].isdigit() else token)[:_MOST].rstrip("_")


def is_node_name(text: str) -> bool:
    """Return whether ROS accepts it as the name of a node."""
    return legal_token(text) == text


def legal_text(text: str) -> str:
    """Return a text that is valid in a string of a message: no control characters, no NUL."""
    return printable(text).encode("utf-8", "replace").decode("utf-8")
