"""``report`` of a network YAML: the title block of its reports, and a logo."""

from __future__ import annotations

import os
from collections.abc import Iterator

from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.limits import MAX_LOGO_BYTES
from fsoe_net.formats.shared.numbers import record_of
from fsoe_net.formats.shared.yaml_tree import MapNode
from fsoe_net.model.report_facts import Logo, ReportFacts

_MOST_PIXELS = 4000  # on each side; a browser needs four bytes for each pixel
_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"
_NO_FRAME = (0xC4, 0xC8, 0xCC)  # of the markers 0xC0 … 0xCF of JPEG


def report_facts_from_yaml(root: MapNode, out: Collector) -> ReportFacts:
    """Return the facts about reports of a network file; empty if there are none.

    Args:
        root: The network file; its structure has been checked.
        out: Takes FSN169 for a logo that cannot be used.
    """
    node = root.get("report")
    if not isinstance(node, MapNode):
        return ReportFacts()
    path = node.text("logo")
    logo = None if path is None else _logo(path, node.at("logo"), out)
    return record_of(ReportFacts, node, out, logo=logo)


def _logo(path: str, named_at: Span, out: Collector) -> Logo | None:
    folder = os.path.dirname(named_at.file)
    if not _is_inside(folder, path):
        why = f"the logo {path!r} is not in the folder of this file"
        out.add("FSN169", named_at, why, hint="copy it next to this file, and write its name")
        return None
    found = Collector()
    data = read_bytes(os.path.join(folder, path), found, named_at=named_at, most=MAX_LOGO_BYTES)
    # A missing logo must not stop a plan, as other missing files do.
    for refusal in found.diagnostics:
        out.add("FSN169", named_at, refusal.message, hint="correct the path, or delete logo")
    if data is None:
        return None
    out.sources += found.sources
    media, size = _picture(data)
    if size is None:
        why = f"the logo {path!r} is not a valid PNG or JPEG"
        out.add("FSN169", named_at, why, hint="export it as PNG")
        return None
    if not all(0 < side <= _MOST_PIXELS for side in size):
        why = f"the logo {path!r} has {size[0]} x {size[1]} pixels"
        hint = f"scale it to 1 … {_MOST_PIXELS} pixels on each side; 600 x 200 are enough"
        out.add("FSN169", named_at, why, hint=hint)
        return None
    return Logo(media=media, data=data)


def _is_inside(folder: str, path: str) -> bool:
    """Whether a relative path leads to a file in this folder, also through symbolic links."""
    inside = os.path.realpath(folder or ".")
    target = os.path.realpath(os.path.join(inside, path))
    return not os.path.isabs(path) and target.startswith(os.path.join(inside, ""))


def _picture(data: bytes) -> tuple[str, tuple[int, int] | None]:
    """Return the media type, and width and height if the file has them."""
    if data.startswith(_PNG):
        return "image/png", _png_size(data)
    if data.startswith(_JPEG):
        return "image/jpeg", _jpeg_size(data)
    return "", None


def _png_size(data: bytes) -> tuple[int, int] | None:
    """Return width and height.

    Byte  0..7        8..11    12..15   16..19   20..23
        +-----------+--------+--------+--------+--------+
        | signature | length | "IHDR" | width  | height |
        +-----------+--------+--------+--------+--------+
    """
    if len(data) < 24 or data[12:16] != b"IHDR":
        return None
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Return width and height from the first frame header.

    Byte  0      1        2..3     4          5..6     7..8
        +------+--------+--------+-----------+--------+-------+
        | 0xFF | marker | length | precision | height | width |
        +------+--------+--------+-----------+--------+-------+
    """
    for marker, at in _segments(data):
        if 0xC0 <= marker <= 0xCF and marker not in _NO_FRAME and at + 9 <= len(data):
            sides = data[at + 7 : at + 9], data[at + 5 : at + 7]
            return int.from_bytes(sides[0], "big"), int.from_bytes(sides[1], "big")
    return None


def _segments(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield the marker and the place of each segment before the image data."""
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != 0xDA:
        yield data[at + 1], at
        # A length below 2 would stay at this place for ever.
        at += 2 + max(2, int.from_bytes(data[at + 2 : at + 4], "big"))
