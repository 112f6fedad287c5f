"""The device library: one YAML file for each device in ``fsoe_net/devices``, and the user's own."""

from __future__ import annotations

import functools
import os
import re
from collections.abc import Iterator, Sequence
from typing import cast

from fsoe_net.diag.diagnostic import Diagnostic, Severity, sort_diagnostics
from fsoe_net.diag.guesses import guesses, one_of
from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.own.schema import check_structure
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.numbers import own_int, read_float, record_of
from fsoe_net.formats.shared.yaml_tree import MapNode, ScalarNode, SeqNode, parse_yaml
from fsoe_net.model.bus import Direction, Entry, Pdo, SyncManager
from fsoe_net.model.library import (
    DeviceFunction,
    Library,
    LibraryDevice,
    LibraryFigure,
    LibraryFrame,
    LibraryIdentity,
    LibraryMapping,
    LibraryPattern,
    LibrarySide,
    contradictions,
)

_U8, _U16, _U32 = 0xFF, 0xFFFF, 0xFFFFFFFF
_MAX_ENTRIES = 4096
_WORD = re.compile(
    r"(?:-|([0-9a-fA-F]{4}):([0-9a-fA-F]{2})(?:-([0-9a-fA-F]{2}))?)/([0-9]{1,3})(?:x([0-9]{1,3}))?\Z"
)
_ADDRESS = re.compile(r"([0-9a-fA-F]{4}):([0-9a-fA-F]{2})\Z")


def load_library(
    own: Sequence[str | os.PathLike[str]] = (),
) -> tuple[Library, list[Diagnostic]]:
    """Return the library of the package with the user's own files first.

    Args:
        own: Files of the same form; an entry replaces the device of the same identity.

    Returns:
        The readable devices, and all findings of the user's files.
    """
    from fsoe_net.formats.recognise import refuse_other  # imports all formats: only if needed

    out = Collector()
    mine: list[LibraryDevice] = []
    for given in own:
        path = os.fspath(given)
        data = read_bytes(path, out)
        if data is None or refuse_other(data, "device", path, out):
            continue
        device = parse_library_device(data, path, out)
        if device is not None:
            mine.append(device)
    taken = {(i.vendor_id, i.product_code) for d in mine for i in d.identities}
    rest = [
        d
        for d in builtin_library().devices
        if taken.isdisjoint((i.vendor_id, i.product_code) for i in d.identities)
    ]
    return Library(devices=(*mine, *rest)), sort_diagnostics(out.diagnostics)


@functools.cache
def builtin_library(products: frozenset[int] | None = None) -> Library:
    """Return the library of the package.

    Args:
        products: Relevant product codes: files without any of them are not parsed, which saves
            nearly all the work for most networks. ``None`` for all devices.

    Raises:
        EnvironmentFault: A file of the package is damaged.
    """
    out = Collector()
    devices: list[LibraryDevice] = []
    for name, data in _builtin_files():
        # Looking for the text costs far less than YAML; the package writes codes as 0x%08x.
        if products is not None and not any(b"0x%08x" % p in data for p in products):
            continue
        device = parse_library_device(data, f"devices/{name}", out)
        if device is not None:
            devices.append(device)
    if _damaged(out):
        first = out.diagnostics[0]
        raise EnvironmentFault(f"the device library is damaged: {first.span}: {first.message}")
    return Library(devices=tuple(devices))


def parse_library_device(data: bytes, file: str, out: Collector) -> LibraryDevice | None:
    """Read one device.

    Args:
        data: The YAML document.
        file: Name shown in findings.
        out: Takes FSN102 … FSN116 and FSN140 for the structure, FSN141 for entries that cannot be
            read, FSN139 if the facts contradict each other.

    Returns:
        The device, or ``None`` if it has an error.
    """
    mine = Collector()
    device = None
    root = parse_yaml(data, file, mine)
    if root is not None:
        check_structure(root, "device", mine)
        if not _damaged(mine):
            device = _device(root, mine)
    if device is not None and not _damaged(mine):
        pattern = () if device.connections is None else (device.connections,)
        rows: list[LibraryMapping | LibraryFigure | LibraryPattern]
        rows = [*device.mappings, *pattern, *device.figures]
        for row in rows:
            if row.source not in device.sources:
                near = guesses(row.source, [*device.sources])
                mine.add(
                    "FSN139",
                    row.at("source"),
                    f"{device.name}: source {row.source!r} is not among the sources",
                    severity=Severity.ERROR,
                    hint=f"write {one_of(near or [*device.sources])}"
                    if device.sources
                    else "name it in sources",
                )
        for place, text in contradictions(device):
            mine.add(
                "FSN139",
                place.span,
                f"{device.name}: {text}",
                severity=Severity.ERROR,
                hint="correct the entries or what is stated about them",
            )
    out.diagnostics += mine.diagnostics
    return None if _damaged(mine) else device


def _builtin_files() -> Iterator[tuple[str, bytes]]:
    """Yield name and content of each file of the package."""
    folder = os.path.normpath(os.path.join(__file__, "../../../devices"))
    for name in sorted(os.listdir(folder)):
        if name.endswith(".yaml"):
            with open(os.path.join(folder, name), "rb") as stream:
                yield name, stream.read()


def _damaged(out: Collector) -> bool:
    return any(d.level is Severity.ERROR for d in out.diagnostics)


def _device(root: MapNode, out: Collector) -> LibraryDevice | None:
    identities = tuple(
        record_of(LibraryIdentity, row, out, {"vendor_id": _U32, "product_code": _U32})
        for row in root.maps("identities")
    )
    if not identities:
        out.add("FSN141", root.at("identities"), "no identity", hint="add vendor and product code")
        return None
    sources = root.get("sources")
    pairs = sources.pairs if isinstance(sources, MapNode) else {}
    pattern = root.get("connections")
    return record_of(
        LibraryDevice,
        root,
        out,
        identities=identities,
        sources={k: n.text.strip() for k, n in pairs.items() if isinstance(n, ScalarNode)},
        mappings=tuple(_mapping(row, out) for row in root.maps("mappings")),
        functions=tuple(DeviceFunction(word) for word in root.texts("functions") or ()),
        connections=_connections(pattern, out) if isinstance(pattern, MapNode) else None,
        figures=tuple(_figure(row, out) for row in root.maps("figures")),
        notes=_notes(root),
    )


def _mapping(node: MapNode, out: Collector) -> LibraryMapping:
    return record_of(
        LibraryMapping,
        node,
        out,
        {"revision_from": _U32, "revision_to": _U32, "module_ident": _U32},
        sync_managers=tuple(_manager(row, out) for row in node.maps("sync_managers")),
        frames=tuple(
            record_of(
                LibraryFrame,
                row,
                out,
                {"frame_bytes": _U8, "safe_bytes": _U8},
                sm_index=own_int(row, "sm", 15, out) or 0,
                byte_offset=own_int(row, "byte", _U16, out) or 0,
            )
            for row in node.maps("frames")
        ),
        restart_relevant=_addresses(node, out),
        notes=_notes(node),
    )


def _connections(node: MapNode, out: Collector) -> LibraryPattern:
    # The schema has checked that both sides are maps.
    return record_of(
        LibraryPattern,
        node,
        out,
        {"most": _U8, "step": _U8},
        outputs=_side(cast(MapNode, node.get("outputs")), out),
        inputs=_side(cast(MapNode, node.get("inputs")), out),
    )


def _side(node: MapNode, out: Collector) -> LibrarySide:
    return record_of(
        LibrarySide,
        node,
        out,
        {"pdo": _U16, "object": _U16, "data": _U16},
        sm_index=own_int(node, "sm", 15, out) or 0,
    )


def _manager(node: MapNode, out: Collector) -> SyncManager:
    front = own_int(node, "first_byte", _U16, out) or 0
    padding = Entry(span=node.at("first_byte"), index=0, subindex=0, bits=8)
    # PDOs whose entries are not known come first: padding keeps the offset of what follows.
    unknown = (Pdo(span=node.at("first_byte"), index=0, entries=(padding,) * front),)
    return SyncManager(
        span=node.span,
        fields=node.places(),
        index=own_int(node, "sm", 15, out) or 0,
        direction=Direction(node.text("direction") or "output"),
        pdos=(unknown if front else ())
        + tuple(
            Pdo(
                span=row.span,
                fields=row.places(),
                index=own_int(row, "index", _U16, out) or 0,
                entries=_entries(row, out),
            )
            for row in node.maps("pdos")
        ),
    )


def _entries(node: MapNode, out: Collector) -> tuple[Entry, ...]:
    found: list[Entry] = []
    span = node.at("entries")
    for word in (node.text("entries") or "").split():
        match = _WORD.match(word)
        if match is None:
            hint = "write 6000:01/8, a run 6001:01-04/1, padding -/4 or -/1x8"
            out.add("FSN141", span, f"entry {word[:40]!r} cannot be read", hint=hint)
            return ()
        index, low, high, bits, times = match.groups()
        first = int(low or "0", 16)
        for sub in range(first, int(high or low or "0", 16) + 1):
            entry = Entry(span=span, index=int(index or "0", 16), subindex=sub, bits=int(bits))
            found += [entry] * int(times or 1)
        if len(found) > _MAX_ENTRIES:
            out.add("FSN141", span, f"more than {_MAX_ENTRIES} entries", hint="split the PDO")
            return ()
    return tuple(found)


def _addresses(node: MapNode, out: Collector) -> tuple[tuple[int, int], ...]:
    found: list[tuple[int, int]] = []
    items = node.get("restart_relevant")
    for item in items.items if isinstance(items, SeqNode) else ():
        match = _ADDRESS.match(item.text) if isinstance(item, ScalarNode) else None
        if match is None:
            out.add("FSN141", item.span, "no address of an entry", hint='write "F788:00"')
        else:
            found.append((int(match[1], 16), int(match[2], 16)))
    return tuple(found)


def _figure(node: MapNode, out: Collector) -> LibraryFigure:
    if not node.truth("unverified"):
        out.add(
            "FSN116",
            node.at("unverified"),
            "a figure of the library is never verified here",
            hint="write unverified: true",
        )
    value = read_float(node.get("value"), out, what="value") or 0.0
    return record_of(LibraryFigure, node, out, value=value)


def _notes(node: MapNode) -> tuple[str, ...]:
    return tuple(text.strip() for text in node.texts("notes") or ())
