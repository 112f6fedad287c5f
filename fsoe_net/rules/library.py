"""FSN448, FSN449: devices of a network compared with the device library."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from fsoe_net.diag.diagnostic import Diagnostic, FindingList, Severity, sort_diagnostics
from fsoe_net.model.bus import SubDevice
from fsoe_net.model.layout import DeviceLayout
from fsoe_net.model.library import Library, LibraryDevice, LibraryMapping
from fsoe_net.model.resolve import Resolution
from fsoe_net.rules.context import Context, few


def check_library(
    resolution: Resolution, library: Library, *, found: Iterable[Diagnostic] = (), notes: bool
) -> list[Diagnostic]:
    """Return frames that differ from the library, and library notes, by type.

    Args:
        resolution: The network, resolved.
        library: Devices by identity. Its content is not verified, so none of the findings is an
            error.
        found: Findings so far; a device whose file has an error or warning is skipped.
        notes: Whether to report its notes.
    """
    out = FindingList()
    reported: set[str] = set()
    # A device file with an error differs because of that error.
    wrong = {d.span.file for d in found if d.level is not Severity.INFO}
    for _, device, sub in Context(resolution=resolution).devices():
        known = library.find(*device.identity)
        if known is None:
            continue
        mapping = None if device.path in wrong else _frames(out, sub, device.layout, known)
        if notes and known.name not in reported:
            reported.add(known.name)
            _notes(out, sub, known, mapping)
    return sort_diagnostics(out.diagnostics)


def _frames(
    out: FindingList, sub: SubDevice, layout: DeviceLayout, known: LibraryDevice
) -> LibraryMapping | None:
    """FSN448; return the matching mapping."""
    frames = _sizes((*b.key, b.frame_bytes) for sm in layout.managers for b in sm.blocks)
    fitting = [m for m in known.mappings if m.fits(sub.revision)]
    # A partly known layout cannot be compared.
    if not fitting or not all(sm.complete for sm in layout.managers):
        return None
    if not frames:
        _without_frames(out, sub, fitting[0], known)
        return None
    mapping = next((m for m in fitting if _has(m, frames)), None)
    if mapping is None:
        _other_frames(out, sub, frames, fitting, known)
    return mapping


def _other_frames(
    out: FindingList,
    sub: SubDevice,
    frames: dict[int, list[int]],
    fitting: Sequence[LibraryMapping],
    known: LibraryDevice,
) -> None:
    nearest = fitting[0]
    # Modular devices have other frames by design.
    modular = any(m.module_ident is not None or m.role == "main" for m in fitting)
    source = known.sources.get(nearest.source, nearest.source)
    out.add(
        "FSN448",
        sub.device.span if sub.device is not None else sub.span,
        f"{sub.name} has FSoE frames of {_listed(frames)}; the library has {known.name} with "
        f"{_listed(_stated(nearest))} (unverified; {nearest.name}, from {source})",
        hint="the library may be wrong, or describe other modules: compare with the manual and ESI",
        severity=Severity.INFO if modular else None,
    )


def _without_frames(
    out: FindingList, sub: SubDevice, mapping: LibraryMapping, known: LibraryDevice
) -> None:
    """FSN448 for a SubInstance whose safety PDOs are not mapped; a logic can be without any."""
    if mapping.role == "sub" and mapping.frames:
        out.add(
            "FSN448",
            sub.device.span if sub.device is not None else sub.span,
            f"{sub.name} maps no FSoE frame; the library has {known.name} with "
            f"{_listed(_stated(mapping))} (unverified): with its safety function in use, such a "
            "device stays in PREOP or SAFEOP",
            severity=Severity.INFO,
            hint="map its safety PDOs, if its safety function is used; compare with manual and ESI",
        )


def _has(mapping: LibraryMapping, frames: dict[int, list[int]]) -> bool:
    stated = _stated(mapping)
    # A safety logic has as many frames as its project has connections.
    return stated == frames or (mapping.role == "main" and frames.keys() <= stated.keys())


def _sizes(frames: Iterable[tuple[int, int, int]]) -> dict[int, list[int]]:
    """Return lengths by sync manager. Positions depend on PDOs that a user may choose."""
    found: dict[int, list[int]] = {}
    for sm, _, size in sorted(frames):
        found.setdefault(sm, []).append(size)
    return found


def _stated(mapping: LibraryMapping) -> dict[int, list[int]]:
    return _sizes((f.sm_index, f.byte_offset, f.frame_bytes) for f in mapping.frames)


def _listed(frames: dict[int, list[int]]) -> str:
    return ", ".join(
        f"{few([str(s) for s in sizes])} bytes on SM{sm}" for sm, sizes in sorted(frames.items())
    )


def _notes(
    out: FindingList, sub: SubDevice, known: LibraryDevice, mapping: LibraryMapping | None
) -> None:
    """FSN449: all notes of a device type in one finding."""
    notes = [*known.notes, *(mapping.notes if mapping is not None else ())]
    if not notes or sub.device is None:
        return
    out.add(
        "FSN449",
        sub.device.span,
        f"{sub.name} is {known.name}: {' '.join(notes)}",
        hint=f"`fsoe-net init --list '{known.name}'` shows the source; it is unverified",
    )
