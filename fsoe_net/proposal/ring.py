"""A ring from answers: device types of ESI, SII, slave YAML and the device library, in order.

It is used if no file describes the bus.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fsoe_net.diag.guesses import guesses, one_of
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.ring import fits_on_bus
from fsoe_net.model.answers import AnsweredDevice
from fsoe_net.model.bus import Device
from fsoe_net.model.description import DescribedSubDevice, Description
from fsoe_net.model.joined_descriptions import has_layout
from fsoe_net.model.library import Library

_MOST_NAMES = 2000

LIBRARY = "device library"


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceType:
    """One device type that can be on the ring.

    ``sub`` is ``None`` for a device of an ESI, which is read on demand.
    """

    order: str
    name: str
    vendor: int
    product: int
    revision: int | None
    path: str
    sub: DescribedSubDevice | None = None

    @property
    def is_of_library(self) -> bool:
        """Whether it is from the device library, not from a file of the user."""
        return self.path == LIBRARY


def list_types(
    esis: Sequence[str], types: Sequence[Description], library: Library, out: Collector
) -> list[DeviceType]:
    """Return the device types of the files and the library, files first.

    Args:
        esis: ESI files, of any size.
        types: Descriptions of device types.
        library: Devices that need no file.
        out: Takes findings of the ESI files.
    """
    from fsoe_net.formats.esi.read import list_esi

    rows = [
        DeviceType(
            order=s.order or _known(s, library) or s.name or Path(t.path).stem,
            name=s.name,
            vendor=s.device.vendor_id,
            product=s.device.product_code,
            revision=s.revision,
            path=t.path,
            sub=s,
        )
        for t in types
        for s in t.subdevices
    ]
    for path in esis:
        catalogue = list_esi(path, out)
        rows += [
            DeviceType(
                order=r.type,
                name=r.name,
                vendor=r.vendor,
                product=r.product,
                revision=r.revision,
                path=path,
            )
            for r in (() if catalogue is None else catalogue.rows)
            if r.kind == "device"
        ]
    for device in library.devices:
        rows += [
            DeviceType(
                order=i.order,
                name=device.name,
                vendor=i.vendor_id,
                product=i.product_code,
                revision=None,
                path=LIBRARY,
                sub=DescribedSubDevice(
                    order=i.order,
                    device=Device(path="", vendor_id=i.vendor_id, product_code=i.product_code),
                ),
            )
            for i in device.identities
        ]
    return rows


def _known(sub: DescribedSubDevice, library: Library) -> str:
    """Return the order number of an identity, if the library has it."""
    own = sub.device.identity
    device = library.find(*own)
    rows = () if device is None else device.identities
    words = (i.order for i in rows if (i.vendor_id, i.product_code) == own)
    return next((w for w in words if w[:1].isalpha()), "")


def ring_of(
    answers: Sequence[AnsweredDevice], types: Sequence[DeviceType], out: Collector
) -> Description | None:
    """Return the ring described by answers.

    Args:
        answers: Types in ring order.
        types: Available types.
        out: Takes FSN155 for an unknown type or revision, FSN156 for an occupied position, and
            findings of the ESI.

    Returns:
        SubDevices with positions, or ``None`` if a type is unknown.
    """
    subs: list[DescribedSubDevice] = []
    good, position = True, 0
    for row in answers:
        # Positions only increase: anything else is a typing error in the answers.
        if row.position is not None and row.position < position:
            out.add(
                "FSN156",
                row.at("position"),
                f"position {row.position} follows position {position - 1}",
                hint="list the SubDevices in ring order",
            )
            good = False
        # A given position leaves a gap for SubDevices that are not listed.
        position = max(position, row.position or 0)
        found = _type_of(row, types, out)
        if found is None:
            good = False
            continue
        for number in range(row.count):
            name = row.name or found.order
            if row.name and row.count > 1:
                name = f"{row.name}_{number + 1}"
            subs.append(replace(found, name=name, position=position, span=row.span))
            position += 1
    if not good or not answers or not fits_on_bus(subs, out):
        return None
    path = answers[0].span.file
    return Description(span=answers[0].span, format="answers", path=path, subdevices=tuple(subs))


def _type_of(
    row: AnsweredDevice, types: Sequence[DeviceType], out: Collector
) -> DescribedSubDevice | None:
    rows = _types_of(row, types, out)
    if not rows:
        return None
    # A type with process data is preferred to a newer revision without.
    newest = max(rows, key=_layout_then_revision)
    notes: tuple[str, ...] = ()
    if len({t.revision for t in rows}) > 1:
        taken = f"0x{newest.revision or 0:08x}"
        notes = (f"TODO revision {taken}: the newest of {len(rows)} in {newest.path}",)
    sub = newest.sub if newest.sub is not None else _read(newest, out)
    if sub is None:
        return None
    return replace(
        sub,
        order=newest.order,
        revision=sub.revision if row.revision is None else row.revision,
        notes=(*notes, *sub.notes),
    )


def _types_of(row: AnsweredDevice, types: Sequence[DeviceType], out: Collector) -> list[DeviceType]:
    """Return the device types that match an answer; none, with FSN155, if it is unknown."""
    wanted = row.type.casefold()
    same = [t for t in types if wanted in (t.order.casefold(), t.name.casefold())]
    if not same:
        _unknown_type(row, types, out)
        return []
    # Files of the user have precedence over the library.
    files = [t for t in same if not t.is_of_library]
    if row.revision is None or not files:
        return files or same
    rows = [t for t in files if t.revision == row.revision]
    if not rows:
        there = sorted({f"0x{t.revision:08x}" for t in files if t.revision is not None})
        out.add(
            "FSN155",
            row.at("revision"),
            f"no {row.type} of revision 0x{row.revision:08x} is in these files",
            hint=f"there are: {', '.join(there) or 'none with a revision'}",
        )
    return rows


def _unknown_type(row: AnsweredDevice, types: Sequence[DeviceType], out: Collector) -> None:
    names = list(dict.fromkeys(t.order for t in types))[:_MOST_NAMES]
    close = [repr(c) for c in guesses(row.type.upper(), names, cutoff=0.5)]
    hint = "give its ESI; leave out SubDevices without process data: position: continues the list"
    if close:
        hint = f"did you mean {one_of(close)}? else {hint}"
    message = f"no file and no device library contains {row.type!r}"
    out.add("FSN155", row.at("type"), message, hint=hint)


def _layout_then_revision(row: DeviceType) -> tuple[bool, int]:
    return row.sub is not None and has_layout(row.sub.device), row.revision or 0


def _read(row: DeviceType, out: Collector) -> DescribedSubDevice | None:
    from fsoe_net.formats.esi.read import EsiChoice, load_esi

    choice = EsiChoice(vendor=row.vendor, product=row.product, revision=row.revision)
    read = load_esi(row.path, out, choice=choice)
    return None if read is None or not read.subdevices else read.subdevices[0]
