"""How the bus is wired, by a scan that was given to the page, with names of the network."""

from __future__ import annotations

from fsoe_net.compare.scan_match import match_scan
from fsoe_net.diag.printable import printable
from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.scan import Scan
from fsoe_net.model.wiring import wiring_of


def cables_of(network: NetworkConfig, scan: Scan) -> dict[str, object]:
    """Return the cables as plain JSON values; see ``assets/types.d.ts``.

    Args:
        network: Its SubDevices are found in the scan as ``fsoe-net check --scan`` finds them.
        scan: The bus; of several in the network, the first.
    """
    match = match_scan(network, scan, {})
    names = {there.position: sub.name for sub, there in (*match.other, *match.pairs)}
    names |= {there.position: sub.name for sub, _, there in match.moved}
    for one, there, two, where in match.swapped:
        names |= {there.position: one.name, where.position: two.name}
    others = {there.position for _, there in match.other}
    wiring = wiring_of(scan)
    cables = () if wiring is None else wiring.cables
    ring = None if wiring is None else wiring.ring_from
    return {
        "is_known": wiring is not None,
        "ring_from": None if ring is None else list(ring),
        "nodes": [
            {
                "position": cable.position,
                "parent": cable.parent,
                "port": cable.port,
                "subdevice": names.get(cable.position, ""),
                "is_other": cable.position in others,
                "type": printable(scan.subdevices[cable.position].name.split(" ")[0]),
            }
            for cable in cables
        ],
    }
