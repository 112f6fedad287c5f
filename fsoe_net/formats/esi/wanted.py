"""Reads only the required devices from an ESI of any size."""

from __future__ import annotations

from collections.abc import Iterable

from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.esi.catalogue import EsiCatalogue
from fsoe_net.formats.esi.read import EsiChoice, list_esi, load_esi
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.description import DescribedSubDevice, Description


def load_devices(
    path: str, wanted: Iterable[DescribedSubDevice], out: Collector
) -> Description | None:
    """Read only the required devices from an ESI of any size; ``None`` if it has none of them.

    Args:
        path: The ESI.
        wanted: SubDevices, matched by identity, revision and modules. One without an identity is
            matched by its order number, if the file has exactly one such device.
        out: Takes findings.
    """
    catalogue = list_esi(path, out)
    if catalogue is None:
        return None
    rows: list[DescribedSubDevice] = []
    for choice in sorted(_choices(catalogue, wanted), key=repr):
        found = load_esi(path, out, choice=choice)
        rows += () if found is None else found.subdevices
    if not rows:
        return None
    return Description(span=Span(path, 1, 1), format="esi", path=path, subdevices=tuple(rows))


def _choices(catalogue: EsiCatalogue, wanted: Iterable[DescribedSubDevice]) -> set[EsiChoice]:
    offered: dict[object, set[tuple[int, int]]] = {}
    for row in catalogue.devices:
        identity = (row.vendor, row.product)
        offered.setdefault(identity, set()).add(identity)
        offered.setdefault(row.type.casefold(), set()).add(identity)
    choices = set()
    for sub in wanted:
        own = sub.device.identity
        # By identity if known, otherwise by order number if only one vendor has it.
        same = offered.get(own if own[1] else sub.order.casefold() or None, set())
        if len(same) == 1:
            vendor, product = next(iter(same))
            choices.add(
                EsiChoice(
                    vendor=vendor,
                    product=product,
                    revision=sub.revision,
                    modules=sub.module_ident or None,
                )
            )
    return choices
