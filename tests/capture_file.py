"""The packets of a capture file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fsoe_net.formats.capture.packets import CaptureReader


def read_capture(path: str | Path) -> Iterator[tuple[int, bytes]]:
    """Yield the packets of a capture: time in nanoseconds since 1970, bytes from the MAC on."""
    with open(path, "rb") as file:
        for time_ns, _, data in CaptureReader(str(path), file):
            yield time_ns, data
