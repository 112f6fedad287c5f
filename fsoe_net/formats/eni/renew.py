"""Replaces the copies in an existing ENI by those of a network; the rest is unchanged."""

from __future__ import annotations

from fsoe_net.diag.diagnostic import Severity, sort_diagnostics
from fsoe_net.diag.words import counted
from fsoe_net.errors import InputError
from fsoe_net.formats.eni.read import load_eni_images
from fsoe_net.formats.eni.write_copies import replace_copies
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.model.description import Description
from fsoe_net.model.renumber import renumbered_copies


def renewed_eni(bus: Description, path: str, notes: list[str]) -> bytes:
    """Return the ENI with the copies of the bus instead of its own; the rest is unchanged.

    Args:
        bus: Description of the network.
        path: The ENI.
        notes: Takes the numbers of removed and added copies.

    Raises:
        InputError: The ENI cannot be read, or is of another bus.
    """
    out = Collector()
    data = read_bytes(path, out)
    images = None if data is None else load_eni_images(data, out, name=path)
    errors = [d for d in out.diagnostics if d.level is Severity.ERROR]
    if errors:
        raise InputError("nothing written", sort_diagnostics(errors))
    if data is None or images is None:
        raise InputError(f"nothing written: {path} does not say where its process data are")
    copies = renumbered_copies(bus, images.description)
    rows = []
    for copy in copies:
        bits = images.bits_of(copy)
        if bits is None:
            raise InputError(f"nothing written: {path} has no place for the copy of {copy.span}")
        rows.append(bits)
    before = len(images.description.copies)
    notes.append(f"{path}: {counted(len(rows), 'copy')} instead of {before}, all else as it was")
    lacking = len(images.description.subdevices) - len(bus.subdevices)
    if lacking > 0:
        notes.append(f"{lacking} SubDevices of {path} are not in {bus.path}")
    return replace_copies(data, rows, header_bits=images.header_bits)
