"""SubDevices that can be added to a network: types of the device library and of files, whole buses.

Each offer is processed like ``fsoe-net init`` with one SubDevice on the bus, so that its device
file is the same as that of ``init``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from fsoe_net.diag.diagnostic import FindingList, Severity, sort_diagnostics
from fsoe_net.errors import InputError
from fsoe_net.formats.own.library import load_library
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.answers import AnsweredDevice, AnsweredWord, Answers
from fsoe_net.model.bus import Device
from fsoe_net.model.description import DescribedSubDevice, Description
from fsoe_net.model.joined_descriptions import has_layout
from fsoe_net.model.library import DeviceFunction, Library, LibraryDevice
from fsoe_net.model.library_fill import fill_from_library, library_device, library_role
from fsoe_net.proposal.draft import Draft, Inputs, make_draft
from fsoe_net.proposal.gather import Gathered
from fsoe_net.proposal.ring import LIBRARY, DeviceType, list_types

_NO_DATA = "no file here has its process data; add its ESI or a scan"


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer:
    """A SubDevice that can be added.

    Attributes:
        order: Order number or type.
        about: Description; may be empty.
        path: Source of its description: a file, or ``device library``.
        position: Ring position, if a file describes the bus.
        revision: Revision number, if known.
        process_data: Process data of the device library to use; empty for those of its file.
        frames: Bytes of each pair of FSoE frames, to the device and from it; empty if not yet
            known.
        role: ``main`` or ``sub``; empty if it can be both, or is not known.
        functions: Functions of the device, from the device library.
        most_connections: Maximum number of connections that a person chooses; 0 if they are fixed.
        obstacle: Why it cannot be added, and the next step; empty if it can.
        source: Its description.
    """

    order: str
    about: str = ""
    path: str = LIBRARY
    position: int | None = None
    revision: int | None = None
    process_data: str = ""
    frames: tuple[tuple[int, int], ...] = ()
    role: str = ""
    functions: tuple[DeviceFunction, ...] = ()
    most_connections: int = 0
    obstacle: str = ""
    source: DeviceType | DescribedSubDevice = field(repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Addition:
    """Additions to a network for an offer.

    Attributes:
        name: Proposed name.
        position: Ring position, if the offer has one.
        revision: Revision number, if known.
        config: Name of its device file.
        config_text: Content of that file.
        notes: Notes and tasks for the user, in words.
    """

    name: str
    position: int | None
    revision: int | None
    config: str
    config_text: str
    notes: tuple[str, ...]


def list_offers(found: Gathered, out: FindingList) -> tuple[Offer, ...]:
    """Return offers: SubDevices of buses in files, device types in files, the device library.

    Args:
        found: Data of the files; empty for the device library alone.
        out: Takes findings of ESI files; an unreadable one has no offers.
    """
    library, _ = load_library()
    types: list[DeviceType] = []
    for path in found.esis:
        mine = Collector()
        types += list_types([path], (), Library(devices=()), mine)
        out.diagnostics += mine.diagnostics
    types += list_types((), found.types, library, Collector())
    offers: list[Offer] = []
    # A bus contains its SubDevices with positions; types have none.
    if found.buses:
        bus, _, _ = Inputs(found, library, types).ring(Answers())
        for sub in () if bus is None else bus.subdevices:
            row = Offer(
                order=sub.order or sub.name,
                about=sub.name,
                path=found.buses[0].path,
                position=sub.position,
                source=sub,
            )
            offers += _ways(row, sub, library)
    for kind in types:
        row = Offer(
            order=kind.order, about=kind.name, path=kind.path, revision=kind.revision, source=kind
        )
        if kind.is_of_library:
            device = library.find(kind.vendor, kind.product)
            row = replace(row, about="" if device is None else device.about)
        offers += [row] if kind.sub is None else _ways(row, kind.sub, library)
    return tuple(offers)


def addition_of(offer: Offer, lengths: Sequence[tuple[int, int]] = ()) -> Addition:
    """Return the additions of an offer.

    Args:
        offer: The offer.
        lengths: Bytes to the device and from it, of each connection, if a person chooses them.

    Raises:
        InputError: Its file cannot be read, a device file cannot represent it, or it has no such
            connections.
    """
    library, _ = load_library()
    if offer.most_connections:
        library = _with_connections(library, offer, lengths)
    if isinstance(offer.source, DeviceType):
        inputs = Inputs(Gathered(used=[offer.path]), library, [offer.source])
        row = AnsweredDevice(type=offer.source.order, revision=offer.source.revision)
        answers = Answers(subdevices=(row,))
    else:
        bus = Description(format="files", path=offer.path, subdevices=(offer.source,))
        inputs = Inputs(Gathered(buses=[bus], used=[offer.path]), library, [])
        answers = Answers()
    made = make_draft(inputs, answers)
    if made.proposal is not None and offer.process_data:
        name = made.proposal.bus.subdevices[0].name
        word = AnsweredWord(text=offer.process_data)
        made = make_draft(inputs, replace(answers, process_data={name: word}))
    return _made(made, offer)


def _with_connections(
    library: Library, offer: Offer, lengths: Sequence[tuple[int, int]]
) -> Library:
    """Return the library in which the device of an offer has these connections."""
    known = _library_device(offer, library)
    if known is None or known.connections is None:
        raise InputError(f"{offer.order} is not in the device library any more")
    try:
        made = replace(known, mappings=(known.connections.mapping(lengths),))
    except ValueError as exc:
        raise InputError(f"{offer.order}: {exc}") from exc
    return Library(devices=tuple(made if row is known else row for row in library.devices))


def _library_device(offer: Offer, library: Library) -> LibraryDevice | None:
    kind = offer.source
    if isinstance(kind, DeviceType):
        return library.find(kind.vendor, kind.product)
    return library_device(kind, library)


def _made(made: Draft, offer: Offer) -> Addition:
    errors = [d for d in made.findings if d.level is Severity.ERROR]
    if errors or made.proposal is None:
        raise InputError(f"{offer.order} cannot be added", sort_diagnostics(errors))
    written = made.files()
    (config,) = (name for name in written.files if name != "network.yaml")
    sub = made.proposal.bus.subdevices[0]
    proposal = made.proposal
    rows = (
        *proposal.sources[0],
        *proposal.remarks[0],
        *made.notes,
        *proposal.open_devices,
        *written.notes,
    )
    notes = (text.removeprefix(f"{sub.name}: ") for text in rows)
    return Addition(
        name=sub.name,
        position=offer.position,
        revision=sub.revision,
        config=config,
        config_text=written.files[config],
        notes=tuple(dict.fromkeys(notes)),
    )


def _ways(row: Offer, sub: DescribedSubDevice, library: Library) -> list[Offer]:
    """Return an offer for each set of process data that the SubDevice may have."""
    known = library_device(sub, library)
    row = replace(row, revision=sub.revision, functions=known.functions if known else ())
    if has_layout(sub.device):
        frames = _frames(sub.device)
        return [replace(row, frames=frames, role=library_role(sub, frames, library))]
    if known is None:
        return [replace(row, obstacle=_NO_DATA)]
    fill = fill_from_library(sub, "it", library, Answers())
    names = {m.name: m for m in known.mappings}
    choices = [name for name, _ in fill.question.choices] if fill.question else []
    offers = [
        replace(
            row,
            process_data=name,
            frames=_frames(names[name].device(known.identities[0], "")),
            role=names[name].role,
        )
        for name in choices
    ]
    if has_layout(fill.sub.device):
        frames = _frames(fill.sub.device)
        offers = [replace(row, frames=frames, role=library_role(sub, frames, library))]
    if known.connections is not None:
        offers.append(replace(row, role="main", most_connections=known.connections.most))
    # Without process data there is nothing that a network could copy.
    return offers or [replace(row, obstacle=_NO_DATA)]


def _frames(device: Device) -> tuple[tuple[int, int], ...]:
    return tuple((p.taken_bytes, p.sent_bytes) for p in device.layout.frame_pairs)
