"""Process data from the device library, for SubDevices whose own files have none."""

from __future__ import annotations

from dataclasses import replace

from fsoe_net.dataclass import dataclass
from fsoe_net.model.answers import Answers, Ask, Question
from fsoe_net.model.description import DescribedSubDevice
from fsoe_net.model.joined_descriptions import has_layout
from fsoe_net.model.library import Library, LibraryDevice, LibraryIdentity, LibraryMapping


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryFill:
    """A SubDevice after a lookup in the library.

    Attributes:
        sub: The SubDevice, with process data if the library has a unique match.
        remarks: Source of the process data, or why there are none.
        question: Question about the mapping, if the library has several.
        wrong: The available mappings, if the answer names none of them.
    """

    sub: DescribedSubDevice
    sources: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    question: Question | None = None
    wrong: tuple[str, ...] = ()


def library_device(sub: DescribedSubDevice, library: Library) -> LibraryDevice | None:
    """Return the library entry of a SubDevice, by identity or else by order number."""
    device = sub.device
    if device.product_code:
        return library.find(*device.identity)
    return library.named(sub.order) if sub.order else None


def library_role(
    sub: DescribedSubDevice, lengths: tuple[tuple[int, int], ...], library: Library
) -> str:
    """Return ``main`` or ``sub`` if the library leaves no doubt, otherwise an empty string.

    Args:
        sub: A SubDevice.
        lengths: Bytes to it and from it, for each pair of its frames.
        library: The devices.
    """
    known = library_device(sub, library)
    if known is None:
        return ""
    roles = set(known.roles)
    if len(roles) > 1:
        # A device that can have both roles: the lengths of its frames show which one it has here.
        roles = {m.role for m in known.mappings if _lengths(m) == sorted(lengths)}
    return roles.pop() if len(roles) == 1 else ""


def _lengths(mapping: LibraryMapping) -> list[tuple[int, int]]:
    outputs = {s.index for s in mapping.sync_managers if s.direction.value == "output"}
    to = [f.frame_bytes for f in mapping.frames if f.sm_index in outputs]
    back = [f.frame_bytes for f in mapping.frames if f.sm_index not in outputs]
    return sorted(zip(to, back, strict=False))


def fill_from_library(
    sub: DescribedSubDevice, name: str, library: Library, answers: Answers
) -> LibraryFill:
    """Add process data to a SubDevice if the library has a single match, or as answered.

    Args:
        sub: A SubDevice.
        name: Its name in the answers.
        library: The devices.
        answers: Answers, which may select the mapping.
    """
    # A layout from the user's files is never replaced by one of the library.
    known = None if has_layout(sub.device) else library_device(sub, library)
    answer = answers.process_data.get(name)
    if known is None:
        return LibraryFill(sub=sub)
    # A revision can exclude mappings, so that fewer are left to ask about.
    fitting = _fitting(sub, known)
    if answer is not None:
        chosen = [m for m in known.mappings if m.name.casefold() == answer.text.casefold()]
        if not chosen:
            return LibraryFill(sub=sub, wrong=tuple(m.name for m in known.mappings))
    else:
        chosen = fitting
    if len(chosen) == 1:
        return _filled(sub, known, chosen[0], answered=answer is not None)
    if not chosen:
        return LibraryFill(
            sub=_identified(sub, known),
            remarks=(
                f"the device library has no process data for this {known.name}",
                *(() if known.mappings else known.notes),
            ),
        )
    # Several match: only a person has the safety project.
    question = Question(
        ask=Ask.PROCESS_DATA,
        subject=name,
        span=sub.span,
        text=f"Which process data does {name} ({known.name}) have?",
        facts=("No file states it; the device library has several.",),
        choices=tuple((m.name, _shown(m, known)) for m in chosen),
    )
    names = ", ".join(f"{m.name!r}" for m in chosen)
    return LibraryFill(
        sub=_identified(sub, known),
        remarks=(f"TODO process data: the device library has {names}",),
        question=question,
    )


def _fitting(sub: DescribedSubDevice, known: LibraryDevice) -> list[LibraryMapping]:
    rows = [m for m in known.mappings if m.fits(sub.revision)]
    # The PDOs of a modular device are those of its modules.
    if sub.module_ident:
        return [m for m in rows if m.module_ident in sub.module_ident]
    return rows


def _shown(mapping: LibraryMapping, known: LibraryDevice) -> str:
    sizes = ", ".join(f"{a} bytes to it and {b} from it" for a, b in _lengths(mapping))
    return f"{sizes} ({known.sources[mapping.source]})"


def _identity(sub: DescribedSubDevice, known: LibraryDevice) -> LibraryIdentity:
    """Return the identity of a SubDevice, or else that of its order number."""
    words = (sub.device.product_code, sub.order.casefold())
    rows = known.identities
    return next(
        (i for i in rows if i.product_code == words[0] or i.order.casefold() == words[1]), rows[0]
    )


def _identified(sub: DescribedSubDevice, known: LibraryDevice) -> DescribedSubDevice:
    row = _identity(sub, known)
    device = replace(sub.device, vendor_id=row.vendor_id, product_code=row.product_code)
    return replace(sub, device=device)


def _filled(
    sub: DescribedSubDevice, known: LibraryDevice, mapping: LibraryMapping, *, answered: bool
) -> LibraryFill:
    own = sub.device
    # Start-up data from the user's files are kept; only the process data are missing there.
    device = replace(
        mapping.device(_identity(sub, known), own.path),
        sdos=own.sdos,
        assign_activate=own.assign_activate,
    )
    chosen = ", as answered" if answered else ""
    return LibraryFill(
        sub=replace(sub, device=device),
        sources=(
            f"process data from the device library ({known.name}, {mapping.name!r}{chosen}), "
            "unverified: compare them with the device",
            f"source: {known.sources[mapping.source]}",
        ),
        remarks=mapping.notes,
    )
