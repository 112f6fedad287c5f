"""What readers of other tools' files share: where the bytes come from, and what kind they are."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from xml.parsers import expat

from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.files import MAX_FILE_BYTES, Collector, read_bytes
from fsoe_net.formats.shared.unreadable import NEXT_STEPS, unreadable_kind
from fsoe_net.formats.shared.xml_text import plain_xml
from fsoe_net.formats.shared.xml_tree import Element

__all__ = [
    "XML_KINDS",
    "Source",
    "esi_number",
    "is_kind",
    "kind_of",
    "next_step",
    "source_bytes",
    "text_of",
    "xml_number",
]

Source = str | os.PathLike[str] | bytes

_HEAD_BYTES = 65_536
_MOST_FINDINGS = 500
XML_KINDS = {
    "EtherCATConfig": "an ENI (EtherCAT network information)",
    "EtherCATInfo": "an ESI (EtherCAT SubDevice information, or `ethercat xml` of one SubDevice)",
    "EtherCATInfoList": "the output of `ethercat xml` for several SubDevices",
    "EtherCATModule": "an ESI module file",
    "EtherCATDict": "an ESI dictionary file",
    "EtherCATDiag": "texts of ESI diagnosis messages, without a device",
    "EtherCATMailbox": "an export of start-up commands from TwinCAT",
    "Network": "a network of openethercat, a format of its own",
    "TcSmProject": "a TwinCAT project",
    "TcSmItem": "a TwinCAT project part",
    "TreeItem": "a tree item of TwinCAT",
    "Project": "a TwinSAFE project export",
    "SafetyDeviceDesc": "a TwinSAFE alias device",
    "safetyApplication": "a TwinSAFE group",
    "masters": "a configuration of linuxcnc-ethercat",
    "robot": "a robot description (URDF)",
}
_XML_BEGIN = re.compile(rb"(\xef\xbb\xbf)?\s*<|\xff\xfe|\xfe\xff|\0<")
_TEXT_KINDS = (
    (rb"\b(?:ec|fsn)_(?:pdo_entry|sync)_info_t\b", "the output of `ethercat cstruct`"),
    (rb"^Domain\d+: LogBaseAddr", "the output of `ethercat domains -v`"),
    (rb"SM\d+: PhysAddr 0x", "the output of `ethercat pdos`"),
    (rb"^Watchdog divider:", "the output of `ethercat config -v`"),
    (rb"^[ \t]+Vendor Id: +0x", "the output of `ethercat slaves -v`"),
    (
        rb"^[ \t]*\d{1,5} +\d{1,5}:\d{1,5} +(INIT|PREOP|BOOT|SAFEOP|OP|\?\?\?)(\+ERROR)? ",
        "the output of `ethercat slaves`",
    ),
    (rb"SM\d+ (in|out)puts$|PDO mapping according to", "the output of SOEM `slaveinfo -map`"),
    (rb"^[ \t]*ethercat_slaves[ \t]*:", "an `ethercat_slaves.yaml` of an IgH node for ROS"),
    (
        rb"^[ \t]*(nets|subdevices|vendor_id)[ \t]*:",
        "a YAML file of ethercat_driver_ros2 or fsoe-net",
    ),
)


def source_bytes(
    source: Source, out: Collector, name: str, *, most: int = MAX_FILE_BYTES
) -> tuple[bytes | None, str]:
    """Return the content and the name to show for it.

    Args:
        source: A path, or the bytes themselves.
        out: Takes FSN101 when a path cannot be read.
        name: Name shown for bytes that came from no file.
        most: Largest size of a file in bytes.
    """
    if isinstance(source, bytes):
        return source, name
    return read_bytes(source, out, most=most), os.fspath(source)


def text_of(data: bytes) -> str:
    """Return text that came from a terminal, a mail or an editor; never fails."""
    for mark, encoding in ((b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
        if data.startswith(mark):
            return data.decode(encoding, "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


class _Found(Exception):
    """The root element is known."""


def _xml_kind(data: bytes) -> str:
    names: list[str] = []
    attributes: list[dict[str, str]] = []

    def start(name: str, given: dict[str, str]) -> None:
        names.append(name)
        attributes.append(given)
        if names[0] in XML_KINDS or len(names) >= 200:
            raise _Found

    for encoding in (None, "iso-8859-1"):  # the second for text that is not what it claims
        parser = expat.ParserCreate(encoding)
        parser.StartElementHandler = start
        if not names:
            with suppress(_Found, expat.ExpatError, ValueError, LookupError):
                parser.Parse(plain_xml(data[:_HEAD_BYTES]), False)
    if not names:
        return ""
    if names[0] == "EtherCATInfo" and re.search(rb"<!-- Slave \d+ -->", data[:_HEAD_BYTES]):
        return "the output of `ethercat xml`"
    for name, given in zip(names, attributes, strict=True):
        if name == "Slave" and "PhysAddr" in given:
            return f"<{names[0]}>, which looks like a project of an ENI builder, not its ENI"
    return XML_KINDS.get(names[0], f"XML with the root <{names[0][:60]}>")


def kind_of(data: bytes) -> str:
    """Return in words what kind of file these bytes are, by content; empty when it is not known."""
    head = data[:_HEAD_BYTES]
    if unreadable := unreadable_kind(head[:1024]):
        return unreadable
    if _XML_BEGIN.match(head):
        named = _xml_kind(data)
        if named:
            return named
    for pattern, words in _TEXT_KINDS:
        if re.search(pattern, head, re.MULTILINE):
            return words
    return ""


def next_step(words: str) -> str:
    """Return what to do with a file that `kind_of` names and nothing reads; empty for others."""
    return NEXT_STEPS.get(words, "")


def is_kind(data: bytes, wanted: str, shown: str, out: Collector) -> bool:
    """Return whether the bytes may be the wanted kind; else FSN140 says which they are.

    Args:
        data: The file.
        wanted: What it should be: how the words of `kind_of` begin.
        shown: Name of the file.
        out: Takes FSN140.
    """
    if not data.strip():
        out.add("FSN140", Span(shown, 1, 1), "the file is empty", hint="export it again")
        return False
    kind = kind_of(data)
    if kind.startswith(wanted) or not kind:
        return True
    out.add(
        "FSN140",
        Span(shown, 1, 1),
        f"this is {kind}, not {wanted}",
        hint=next_step(kind) or f"read it as what it is, or give {wanted}",
    )
    return False


def esi_number(text: str) -> int | None:
    """Return the number of a ``HexDecValue``: ``#x1a00``, ``0x1A00``, ``6656`` or ``0006656``."""
    word = text.strip()
    if len(word) > 40:
        return None
    sign = -1 if word[:1] == "-" else 1
    word = word.removeprefix("-") if sign < 0 else word.removeprefix("+")
    digits = word[2:] if word[:2].lower() in ("#x", "0x") else word
    base = 10 if digits is word else 16
    if not digits.isascii() or not digits.isalnum():
        return None
    try:
        return sign * int(digits, base)
    except ValueError:
        return None


def xml_number(
    element: Element | None, out: Collector, *, high: int = 0xFFFFFFFF, low: int = 0
) -> int | None:
    """Return the number an element holds: decimal, ``#x1a00`` or ``0x1a00``.

    Leading zeros are decimal, as in the tools that write them.

    Args:
        element: The element; ``None`` gives ``None`` silently.
        out: Takes FSN141.
        high: Largest allowed value.
        low: Smallest allowed value.
    """
    if element is None:
        return None
    text = element.text.strip()
    value = esi_number(text)
    if value is None or not low <= value <= high:
        if len(out.diagnostics) >= _MOST_FINDINGS:
            return None
        shown = text if len(text) <= 40 else text[:37] + "..."
        why = "is no number" if value is None else f"is outside {low} ... {high}"
        out.add(
            "FSN141",
            element.value_span,
            f"<{element.name}> {shown!r} {why}",
            hint="write 5632 or #x1600" if value is None else "correct the number",
        )
        return None
    return value
