"""Reads ESI files: their content, and one device. Also the lists of the ``ethercat`` tool."""

from __future__ import annotations

import hashlib
from dataclasses import replace

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.diag.guesses import guesses, one_of
from fsoe_net.diag.words import counted, listed
from fsoe_net.formats.esi.cache import cached_catalogue, keep_catalogue
from fsoe_net.formats.esi.catalogue import EsiCatalogue, EsiRow, scan_esi
from fsoe_net.formats.esi.device import read_esi_device
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.limits import MAX_LARGE_BYTES
from fsoe_net.formats.shared.source import Source, source_bytes
from fsoe_net.formats.shared.xml_text import plain_xml
from fsoe_net.formats.shared.xml_tree import Element, parse_xml
from fsoe_net.model.description import DescribedSubDevice, Description

_MOST_AT_ONCE = 64
_SMALLEST_CACHED = 256 * 1024  # a smaller file is read faster than its cache
_SKIP = frozenset({"Profile", "Eeprom", "Image16x14", "ImageData16x14", "ImageFile16x14"})


@dataclass(frozen=True, slots=True, kw_only=True)
class EsiChoice:
    """Selects a device of a file, and the modules in its slots.

    Attributes:
        vendor: Vendor ID, or ``None`` for any.
        product: Product code, or ``None`` for any.
        revision: Revision number. Without it the newest one is used if the product is given.
        type: Order number such as ``EL1904``; case is ignored.
        modules: Ident of the module of each slot, ``None`` for an empty one; without it the default
            modules of the file.
    """

    vendor: int | None = None
    product: int | None = None
    revision: int | None = None
    type: str = ""
    modules: tuple[int | None, ...] | None = None

    @property
    def is_open(self) -> bool:
        """Whether no device is named."""
        return self.vendor is None and self.product is None and not self.type


def list_esi(
    source: Source,
    out: Collector,
    *,
    name: str = "<esi>",
    cache: bool = True,
) -> EsiCatalogue | None:
    """List the devices and modules of a file, without their dictionaries.

    Args:
        source: Path, or the bytes of the file.
        out: Takes its findings.
        name: Name shown when ``source`` is bytes.
        cache: Whether the list of a large file is cached, by content.
    """
    file = _File.open(source, out, name=name, cache=cache)
    return file.catalogue if file is not None else None


def load_esi(
    source: Source,
    out: Collector,
    *,
    choice: EsiChoice | None = None,
    name: str = "<esi>",
    cache: bool = True,
) -> Description | None:
    """Read one device of a file, or all devices of a small file if none is selected.

    Args:
        source: Path, or the bytes of the file.
        out: Takes FSN135 if the device is missing, FSN136 if another revision is used, FSN137 for
            modules, FSN139 for contradictions, and what `scan_esi` finds.
        choice: The selected device.
        name: Name shown when ``source`` is bytes.
        cache: Whether the list of a large file is cached, by content.

    Returns:
        The devices, or ``None`` with a finding.
    """
    file = _File.open(source, out, name=name, cache=cache)
    if file is None:
        return None
    wanted = choice or EsiChoice()
    rows = _rows_of(file, wanted, out)
    if not rows:
        return None
    subdevices: list[DescribedSubDevice] = []
    for row, notes in rows:
        device = file.device(row, wanted, out)
        if device is not None:
            # A list printed by `ethercat` is a bus in ring order; an ESI of a vendor is not.
            position = len(subdevices) if file.catalogue.is_list and wanted.is_open else None
            subdevices.append(_noted(device, position, notes))
    if not subdevices:
        return None
    return Description(
        format="esi",
        path=file.path,
        subdevices=tuple(subdevices),
        span=Span(file.path, 1, 1),
    )


def _noted(
    device: DescribedSubDevice, position: int | None, notes: tuple[str, ...]
) -> DescribedSubDevice:
    return replace(device, position=position, notes=(*notes, *device.notes))


class _File:
    """A file with its catalogue."""

    def __init__(self, data: bytes, path: str, sha256: str) -> None:
        self.path = path
        self.catalogue = EsiCatalogue(encoding="utf-8", is_list=False, references=(), rows=())
        self._data = data
        self._sha256 = sha256
        self._modules: dict[tuple[int, int], EsiRow] = {}
        self._parsed: dict[int, Element | None] = {}  # modules, by their first byte

    @classmethod
    def open(
        cls,
        source: Source,
        out: Collector,
        *,
        name: str,
        cache: bool,
    ) -> _File | None:
        data, path = source_bytes(source, out, name, most=MAX_LARGE_BYTES)
        if data is None:
            return None
        sha256 = next((s.sha256 for s in out.sources if s.path == path), "")
        if cache and len(data) >= _SMALLEST_CACHED:
            sha256 = sha256 or hashlib.sha256(data).hexdigest()
        else:
            sha256 = ""
        file = cls(plain_xml(data), path, sha256)
        return file if file._read_catalogue(out) else None

    def _read_catalogue(self, out: Collector) -> bool:
        if self._sha256:
            kept = cached_catalogue(self._sha256, len(self._data))
            if kept is not None and self._fits(kept):
                self.catalogue = kept
                return True
        before = len(out.diagnostics)
        scanned = scan_esi(self._data, self.path, out)
        if scanned is None:
            return False
        self.catalogue = scanned
        # A file with findings is read again each time, so that they are reported each time.
        if self._sha256 and len(out.diagnostics) == before:
            keep_catalogue(self._sha256, scanned)
        return True

    def _fits(self, kept: EsiCatalogue) -> bool:
        tags = {"device": b"<Device", "module": b"<Module"}
        # A part that does not begin at its tag would be read as another device.
        return all(self._data.startswith(tags[r.kind], r.offset) for r in kept.rows)

    def device(self, row: EsiRow, choice: EsiChoice, out: Collector) -> DescribedSubDevice | None:
        """Read a device of the catalogue."""
        element = self._element(row, out)
        if element is None:
            return None
        if not row.vendor:
            hint = "add <Vendor><Id>#x…</Id></Vendor>"
            out.add(
                "FSN110",
                element.span,
                "the vendor ID is missing or 0",
                hint=hint,
                severity=Severity.WARNING,
            )

        def module(ident: int, at: Span) -> Element | None:
            return self._module(ident, row.group, at, out)

        return read_esi_device(
            element, row, out, path=self.path, modules=choice.modules, module=module
        )

    def _module(self, ident: int, group: int, at: Span, out: Collector) -> Element | None:
        modules = self.catalogue.modules if not self._modules else ()
        for row in modules:
            self._modules.setdefault((row.group, row.product), row)
        found = self._modules.get((group, ident))
        if found is not None:
            if found.offset not in self._parsed:
                self._parsed[found.offset] = self._element(found, out)
            return self._parsed[found.offset]
        elsewhere = ", ".join(self.catalogue.references[:4])
        hint = f"the file refers to {elsewhere}; it may be there" if elsewhere else ""
        if not hint:
            known = ", ".join(f"0x{m.product:x}" for m in self.catalogue.modules[:8])
            hint = f"its modules are {known}" if known else "the file describes no modules"
        out.add("FSN137", at, f"module 0x{ident:x} is not in this file", hint=hint)
        return None

    def _element(self, row: EsiRow, out: Collector) -> Element | None:
        """Parse the piece of the file that a row of the catalogue refers to."""
        data, tag = self._data, b"</Device>" if row.kind == "device" else b"</Module>"
        piece = data[row.offset : row.end]
        # The part ends before its closing tag; an element such as <Device/> has no closing tag.
        if data[row.end : row.end + len(tag) - 1] == tag[:-1]:
            piece += tag
        found = Collector()
        element = parse_xml(
            piece,
            self.path,
            found,
            what="an ESI file",
            encoding=self.catalogue.encoding,
            skip=_SKIP,
            begin=Span(self.path, row.line, row.column),
        )
        out.diagnostics.extend(found.diagnostics)
        return element


# -- which device ---------------------------------------------------------------------------------

_Rows = list[tuple[EsiRow, tuple[str, ...]]]


def _rows_of(file: _File, choice: EsiChoice, out: Collector) -> _Rows:
    """Return the selected rows with the assumptions made; empty with a finding."""
    devices = file.catalogue.devices
    whole = Span(file.path, 1, 1)
    if not devices:
        hint = "a file of modules only is named by the ESI of the device"
        out.add("FSN135", whole, "the file describes no device", hint=hint)
        return []
    if choice.is_open:
        if len(devices) <= _MOST_AT_ONCE:
            return [(row, ()) for row in devices]
        message = f"the file describes {counted(len(devices), 'device')}; none was chosen"
        hint = "name one by product code or type; or give a file of the bus, too, which names them"
        out.add("FSN135", whole, message, hint=hint)
        return []
    same = [row for row in devices if _is_wanted(row, choice)]
    if not same:
        hint = _nearest(devices, choice)
        out.add("FSN135", whole, f"{_spoken(choice)} is not in this file", hint=hint)
        return []
    row, notes = _of_revision(same, choice, out, file.path)
    return [(row, notes)] if row is not None else []


def _is_wanted(row: EsiRow, choice: EsiChoice) -> bool:
    return (
        choice.vendor in (None, row.vendor)
        and choice.product in (None, row.product)
        and choice.type.casefold() in ("", row.type.casefold())
    )


def _of_revision(
    rows: list[EsiRow], choice: EsiChoice, out: Collector, path: str
) -> tuple[EsiRow | None, tuple[str, ...]]:
    """Return the device of the revision, or of the nearest lower one, with a remark."""
    if choice.revision is None:
        return _newest(rows)
    exact = next((r for r in rows if r.revision == choice.revision), None)
    if exact is not None:
        return exact, ()
    # By convention a device also works with the description of a lower revision, not of a higher.
    row = _nearest_lower(rows, choice.revision)
    wanted = f"revision 0x{choice.revision:08x} of {rows[0].type or 'the device'}"
    known = ", ".join(sorted({f"0x{r.revision:08x}" for r in rows if r.revision is not None})[:8])
    if row is None:
        message = f"{wanted} is not in this file, and no lower one"
        span = Span(path, rows[0].line, rows[0].column)
        out.add("FSN135", span, message, hint=f"it has {known}; take a newer device or older file")
        return None, ()
    taken = "an entry without a revision" if row.revision is None else f"0x{row.revision:08x}"
    message = f"{wanted} is not in this file; {taken} is taken"
    hint = f"it has {known or 'none'}; look for a newer file of the vendor"
    out.add("FSN136", Span(path, row.line, row.column), message, hint=hint)
    return row, (f"{message}, the nearest lower one",)


def _newest(rows: list[EsiRow]) -> tuple[EsiRow, tuple[str, ...]]:
    last = max(rows, key=lambda r: -1 if r.revision is None else r.revision)
    count = len({r.revision for r in rows})
    if count == 1:
        return last, ()
    return last, (f"the newest of {count} revisions is taken, 0x{last.revision or 0:08x}",)


def _nearest_lower(rows: list[EsiRow], revision: int) -> EsiRow | None:
    """Return the device of the highest lower revision, or else one without a revision."""
    lower = [r for r in rows if r.revision is not None and r.revision < revision]
    if lower:
        return max(lower, key=lambda r: r.revision or 0)
    return next((r for r in rows if r.revision is None), None)


def _spoken(choice: EsiChoice) -> str:
    parts = [choice.type] if choice.type else []
    if choice.product is not None:
        parts.append(f"product 0x{choice.product:08x}")
    if choice.vendor is not None:
        parts.append(f"of vendor 0x{choice.vendor:08x}" if parts else f"vendor 0x{choice.vendor:x}")
    return " ".join(parts)


def _nearest(devices: tuple[EsiRow, ...], choice: EsiChoice) -> str:
    """Return a hint with the probable meaning."""
    others = [r for r in devices if choice.product is not None and r.product == choice.product]
    if others:
        same = dict.fromkeys(f"{r.type} of vendor 0x{r.vendor:08x}" for r in others)
        return f"it has {listed(list(same), 4)}"
    close = guesses(choice.type, [r.type for r in devices]) if choice.type else ()
    if close:
        return f"did you mean {one_of(close)}?"
    types = ", ".join(dict.fromkeys(r.type for r in devices[:8]))
    return f"it describes {types}" + (" and more" if len(devices) > 8 else "")
