"""The maximum number of SubDevices on a bus."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.bus import Located

MOST_SUBDEVICES = 65_535
"""On one bus: EtherCAT addresses have 16 bits, and 0 is not an address."""


def fits_on_bus(subdevices: Sequence[Located], out: Collector) -> bool:
    """Return whether the SubDevices fit on one bus; ``out`` takes FSN103 at the first one too many.

    Args:
        subdevices: SubDevices of one bus, in ring order. A reader may stop at the first one too
            many.
        out: Takes FSN103.
    """
    if len(subdevices) <= MOST_SUBDEVICES:
        return True
    out.add(
        "FSN103",
        subdevices[MOST_SUBDEVICES].span,
        f"this is SubDevice {MOST_SUBDEVICES + 1}; EtherCAT addresses {MOST_SUBDEVICES} on a bus",
        hint="give the file of one bus; a generated file may repeat its SubDevices",
    )
    return False
