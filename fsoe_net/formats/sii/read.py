"""SII images: identity, sync managers and PDOs in the EEPROM of a SubDevice.

Words are little-endian. A header of 0x40 words is followed by categories, each a type, a length in
words and a body; type 0xFFFF ends them:

    +-------------+------------+-------------+---------+------+--------+------+-----+--------+
    | 0 config, 4 | 7 checksum | 8 vendor, A | ... 3F  | type | length | body | ... | 0xFFFF |
    |   alias     |            |   product … | version |      |        |      |     |        |
    +-------------+------------+-------------+---------+------+--------+------+-----+--------+
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import field

import crcmod

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.errors import InputError
from fsoe_net.formats.recognise import beginning
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.limits import MAX_SII_BYTES
from fsoe_net.formats.shared.source import Source, source_bytes
from fsoe_net.formats.sii.hex_text import binary_of, is_hex_text
from fsoe_net.formats.sii.parts import sii_general, sii_pdos, sii_strings
from fsoe_net.model.bus import Device, Direction, Pdo, SyncManager
from fsoe_net.model.description import DescribedSubDevice, Description, OfferedPdo, TypeFacts

_HEADER_BYTES = 0x80
_IDENTITY_BYTES = 0x20
_END = 0xFFFF
_VIRTUAL_SM = 0x04  # in the enable byte of a sync manager
_STRINGS, _GENERAL, _FMMU, _SM, _TX, _RX, _DC = 10, 30, 40, 41, 50, 51, 60
_REPEATED = frozenset({_STRINGS, _GENERAL, _FMMU, _SM, _DC})
_COE = 0x04
_READ_AGAIN = "read it again, e.g. ethercat sii_read -p 0 > image.bin"
_SM_OUTPUTS, _SM_INPUTS = 3, 4


_crc8 = crcmod.mkCrcFun(0x107, initCrc=0xFF, rev=False, xorOut=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SiiManager:
    """A sync manager of the SII. ``use``: 1, 2 mailbox, 3 outputs, 4 inputs, 0 none."""

    start: int
    length: int
    control: int
    enable: int
    use: int

    @property
    def direction(self) -> Direction:
        """The writer; from the control byte if ``use`` is not stated."""
        if self.use in (1, _SM_OUTPUTS):
            return Direction.OUTPUT
        if self.use in (2, _SM_INPUTS):
            return Direction.INPUT
        return Direction.OUTPUT if self.control & 0x0C == 0x04 else Direction.INPUT


@dataclass(slots=True, kw_only=True)
class SiiImage:
    """Content of an image. Not frozen: filled category by category."""

    vendor: int
    product: int
    revision: int
    serial: int
    alias: int
    protocols: int = 0
    strings: list[str] = field(default_factory=list)
    general: tuple[int, int] | None = None
    managers: tuple[SiiManager, ...] = ()
    pdos: list[OfferedPdo] = field(default_factory=list)
    assign_activate: tuple[int, ...] = ()
    broken: bool = False

    def text(self, number: int) -> str:
        """Return a string by its number from 1, or ``None``."""
        return self.strings[number - 1] if 0 < number <= len(self.strings) else ""

    def names(self) -> tuple[str, str]:
        """Return the name and the order number of the device, if present."""
        name, order = self.general or (0, 0)
        return self.text(name), self.text(order)


def sii_checksum(data: bytes) -> int:
    """Return the checksum of the first 14 bytes: CRC-8, polynomial 0x07, initial value 0xFF."""
    crc: int = _crc8(data[:14])
    return crc


def load_sii(source: Source, out: Collector, *, name: str = "<sii>") -> Description | None:
    """Read an SII image.

    Args:
        source: The file or its bytes: binary, Intel HEX or a dump, whatever its suffix.
        out: Takes FSN138 for an image that is empty, truncated or damaged, FSN139 for PDOs on
            missing sync managers, FSN140 for text.
        name: Name shown when ``source`` is bytes.

    Returns:
        One device without a ring position, or ``None`` with a finding. Truncation after the
        identity is reported; the rest is returned as truncated.
    """
    data, path = source_bytes(source, out, name, most=MAX_SII_BYTES)
    data = None if data is None else _binary(data, path, out)
    if data is None:
        return None
    span = Span(path)
    image = read_sii(data, span, out)
    if image is None:
        return None
    device = describe_sii(image, path, span, out)
    return Description(
        format="sii",
        path=path,
        subdevices=(device,),
        truncated=device.truncated,
        span=span,
    )


def read_sii(data: bytes, span: Span, out: Collector) -> SiiImage | None:
    """Read an image into its categories; see `load_sii`."""
    if not _is_image(data, span, out):
        return None
    alias, checksum = struct.unpack_from("<H4xH", data, 8)
    vendor, product, revision, serial = struct.unpack_from("<4I", data, 0x10)
    right = sii_checksum(data) == checksum & 0xFF
    image = SiiImage(
        vendor=vendor,
        product=product,
        revision=revision,
        serial=serial,
        alias=alias,
        protocols=int.from_bytes(data[0x38:0x3A], "little"),
    )
    if not right:
        message = (
            f"the checksum in word 7 is 0x{checksum & 0xFF:02x}, the configuration gives "
            f"0x{sii_checksum(data):02x}"
        )
        hint = _shift_hint(data) or "the SubDevice would ignore it; " + _READ_AGAIN
        out.add("FSN138", span, message, hint=hint, severity=Severity.WARNING)
    _categories(data, image, span, out)
    return image


def read_sii_categories(data: bytes, span: Span, out: Collector) -> SiiImage:
    """Read an image of which only the categories are reliable, such as a reconstructed one.

    Args:
        data: The image, with a header.
        span: Its place.
        out: Takes FSN138 for damaged categories.
    """
    image = SiiImage(vendor=0, product=0, revision=0, serial=0, alias=0)
    _categories(data, image, span, out)
    return image


def _binary(data: bytes, path: str, out: Collector) -> bytes | None:
    """Return the image that a text file contains; reject any other content."""
    if is_hex_text(data[:256]):
        try:
            return binary_of(data)
        except InputError as exc:
            hint = "paste or save the whole dump, unchanged; or give the binary image"
            out.add("FSN138", Span(path, 1, 1), f"a damaged dump of an image: {exc}", hint=hint)
            return None
    found = beginning(data)
    if found is not None:
        hint = found.next_step or _READ_AGAIN
        out.add("FSN140", Span(path, 1, 1), f"this is {found.words}, not an SII image", hint=hint)
        return None
    return data


def _is_image(data: bytes, span: Span, out: Collector) -> bool:
    if len(data) < _IDENTITY_BYTES:
        message = f"{len(data)} bytes are too short for an SII image"
        out.add("FSN138", span, message, hint=_READ_AGAIN)
    elif not data.strip(b"\0") or not data.strip(b"\xff"):
        message = f"the image holds nothing but 0x{data[0]:02x}"
        hint = "the EEPROM is not programmed, or could not be read; " + _READ_AGAIN
        out.add("FSN138", span, message, hint=hint)
    elif data[:64].isascii() and data[:64].decode().isprintable():
        hint = "give the image, or what `hexdump -C` or `xxd` prints of it, alone in a file"
        out.add("FSN140", Span(span.file, 1, 1), "this is text, not an SII image", hint=hint)
    elif data[0x10:0x18] == bytes(8):
        message = "vendor ID and product code are both 0"
        hint = _shift_hint(data) or "the EEPROM is not programmed; " + _READ_AGAIN
        out.add("FSN138", span, message, hint=hint)
    else:
        return True
    return False


def _shift_hint(data: bytes) -> str:
    """Return a hint with the byte at which a complete image begins, if there is one."""
    for at in range(1, min(len(data) - _IDENTITY_BYTES, 256)):
        piece = data[at : at + _IDENTITY_BYTES]
        likely = piece[15] == 0 and any(piece[:8]) and any(piece[0x10:0x14])
        if likely and any(piece[0x14:0x18]) and sii_checksum(piece) == piece[14]:
            return f"an image begins at byte {at}; leave out what is before"
    return ""


def _categories(data: bytes, image: SiiImage, span: Span, out: Collector) -> None:
    rows = list(_bodies(data, image, span, out))
    seen: set[int] = set()
    # PDOs have the numbers of their names, which may follow.
    for kind, at, body in sorted(rows, key=lambda row: row[0] != _STRINGS):
        if kind in _REPEATED & seen:
            message = f"category {kind} at byte 0x{at - 4:x} is there twice"
            hint = "the first one is used"
            out.add("FSN138", span, message, hint=hint, severity=Severity.WARNING)
        else:
            seen.add(kind)
            _category(kind, body, at, image, span, out)


def _bodies(
    data: bytes, image: SiiImage, span: Span, out: Collector
) -> Iterator[tuple[int, int, bytes]]:
    """Yield type, place and body of each category."""
    at = _HEADER_BYTES
    while True:
        if at + 2 > len(data):
            return _cut(image, span, out, f"it ends at byte {len(data)} without an end mark")
        kind = int.from_bytes(data[at : at + 2], "little")
        if kind == _END:
            return None
        words = int.from_bytes(data[at + 2 : at + 4], "little")
        if kind == 0 and words == 0:
            if any(data[at:]):
                _cut(image, span, out, f"the categories end in zeros at byte 0x{at:x}")
            return None  # zeros to the end: nothing more was programmed
        begin, end = at + 4, at + 4 + 2 * words
        if end > len(data):
            message = (
                f"category {kind} at byte 0x{at:x} has {words} words, "
                f"{max(len(data) - begin, 0)} bytes are left"
            )
            return _cut(image, span, out, message)
        yield kind, begin, data[begin:end]
        at = end


def _cut(image: SiiImage, span: Span, out: Collector, message: str) -> None:
    image.broken = True
    hint = _READ_AGAIN
    out.add("FSN138", span, f"the image is cut off or damaged: {message}", hint=hint)


def _category(kind: int, body: bytes, at: int, image: SiiImage, span: Span, out: Collector) -> None:
    fault = ""
    if kind == _STRINGS:
        image.strings, fault = sii_strings(body)
    elif kind == _GENERAL:
        image.general = sii_general(body)
        fault = "" if image.general is not None or not body else "it is too short"
    elif kind == _SM:
        image.managers = _sync_managers(body)
        fault = "its length is not a multiple of 8 bytes" if len(body) % 8 else ""
    elif kind == _DC:
        # Each clock mode has 24 bytes, with AssignActivate at 14.
        rows = range(0, len(body) - 23, 24)
        image.assign_activate = tuple(int.from_bytes(body[n + 14 : n + 16], "little") for n in rows)
    elif kind in (_TX, _RX):
        direction = Direction.INPUT if kind == _TX else Direction.OUTPUT
        read, fault = sii_pdos(body, direction, image.text, span)
        image.pdos += read
    if fault:
        image.broken = True
        message = f"category {kind} at byte 0x{at - 4:x} is damaged: {fault}"
        hint = "what could be read is used; " + _READ_AGAIN
        out.add("FSN138", span, message, hint=hint)


def _sync_managers(body: bytes) -> tuple[SiiManager, ...]:
    return tuple(
        SiiManager(start=start, length=length, control=control, enable=enable, use=use)
        for start, length, control, _, enable, use in struct.iter_unpack(
            "<HHBBBB", body[: len(body) & ~7]
        )
    )


# -- into the model -------------------------------------------------------------------------------


def describe_sii(image: SiiImage, path: str, span: Span, out: Collector) -> DescribedSubDevice:
    """Return the device data in an image.

    Args:
        image: The image.
        path: Its source.
        span: Its place.
        out: Takes FSN139 for PDOs on missing sync managers.
    """
    notes: list[str] = []
    assigned, available = _placed_pdos(image, span, notes, out)
    if not image.pdos and image.protocols & _COE and not image.broken:
        notes.append("the SII holds no PDOs; they are in the object dictionary or the ESI only")
    if len(image.assign_activate) > 1:
        notes.append(f"of {len(image.assign_activate)} clock modes the first is taken")
    managers = tuple(
        _manager(index, image, tuple(assigned.get(index, ())), span)
        for index in sorted({*range(len(image.managers)), *assigned})
    )
    name, order = image.names()
    device = Device(
        path=path,
        vendor_id=image.vendor,
        product_code=image.product,
        assign_activate=image.assign_activate[0] if image.assign_activate else 0,
        sync_managers=managers,
        span=span,
    )
    return DescribedSubDevice(
        name=name,
        order=order,
        alias=image.alias,
        device=device,
        available=tuple(available),
        revision=image.revision,
        serial=image.serial,
        truncated=image.broken,
        notes=tuple(notes),
        facts=TypeFacts(
            default_bytes={
                n: m.length
                for n, m in enumerate(image.managers)
                if m.length and m.use not in (1, 2)
            }
        ),
        span=span,
    )


def _placed_pdos(
    image: SiiImage, span: Span, notes: list[str], out: Collector
) -> tuple[dict[int, list[Pdo]], list[Pdo]]:
    """Return the PDOs by sync manager, and those without one."""
    assigned: dict[int, list[Pdo]] = {}
    available: list[Pdo] = []
    for row in image.pdos:
        # Virtual PDOs are placed on a virtual sync manager, such as a register of the clock.
        elsewhere = row.virtual and not _is_virtual(row.sm, image)
        if elsewhere:
            notes.append(f"PDO 0x{row.index:04x} is virtual: no place in the process data")
        if row.sm is None or elsewhere:
            available.append(row.pdo)
            continue
        _check_place(row, row.sm, image, span, out)
        assigned.setdefault(row.sm, []).append(row.pdo)
    return assigned, available


def _is_virtual(sm: int | None, image: SiiImage) -> bool:
    if sm is None or sm >= len(image.managers):
        return False
    return bool(image.managers[sm].enable & _VIRTUAL_SM)


def _check_place(pdo: OfferedPdo, sm: int, image: SiiImage, span: Span, out: Collector) -> None:
    what = f"PDO 0x{pdo.index:04x} goes to SM{sm}"
    if sm >= len(image.managers):
        message = f"{what}, which the image does not set up"
    elif image.managers[sm].use in (1, 2):
        message = f"{what}, which is a mailbox"
    elif image.managers[sm].use and image.managers[sm].direction is not pdo.direction:
        message = f"{what}, which has the other direction"
    else:
        return
    out.add("FSN139", span, message, hint="compare with the ESI, or read the PDOs online")


def _manager(index: int, image: SiiImage, pdos: tuple[Pdo, ...], span: Span) -> SyncManager:
    row = image.managers[index] if index < len(image.managers) else None
    if row is not None:
        direction = row.direction
    else:
        output = any(p.sm == index and p.direction is Direction.OUTPUT for p in image.pdos)
        direction = Direction.OUTPUT if output else Direction.INPUT
    return SyncManager(
        index=index,
        direction=direction,
        declared=row is not None,
        pdos=pdos,
        start_byte=row.start if row is not None else None,
        span=span,
    )
