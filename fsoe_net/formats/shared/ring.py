"""How many SubDevices a bus can have."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.bus import Located

MOST_SUBDEVICES = 65_535
"""Of one bus: addresses of EtherCAT have 16 bits, and 0 is none."""


def fits_on_bus(subdevices: Sequence[Located], out: Collector) -> bool:
    """Return whether one bus can have so many SubDevices; ``out`` takes FSN103 at the first above.

    Args:
        subdevices: Those of one bus, in ring order. A reader may stop at the first above.
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
