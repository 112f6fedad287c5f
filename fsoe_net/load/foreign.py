"""What readers of other tools' files share: where the bytes come from, and what kind they are."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from xml.parsers import expat

from fsoe_net.diag import Span
from fsoe_net.load.files import Collector, read_bytes
from fsoe_net.load.xml_tree import Element

__all__ = ["Source", "is_kind", "kind_of", "source_bytes", "text_of", "xml_number"]

Source = str | os.PathLike[str] | bytes

_HEAD_BYTES = 65_536
_MOST_FINDINGS = 500
_XML_KINDS = {
    "EtherCATConfig": "an ENI (EtherCAT network information)",
    "EtherCATInfo": "an ESI (EtherCAT SubDevice information, or `ethercat xml` of one SubDevice)",
    "EtherCATInfoList": "the output of `ethercat xml` for several SubDevices",
    "EtherCATModule": "an ESI module file",
    "EtherCATDict": "an ESI dictionary file",
    "EtherCATMailbox": "an export of start-up commands from TwinCAT",
    "Network": "a network of openethercat, a format of its own",
    "TcSmProject": "a TwinCAT project",
    "TcSmItem": "a part of a TwinCAT project",
    "Project": "a TwinSAFE project export",
    "masters": "a configuration of linuxcnc-ethercat",
    "robot": "a robot description (URDF)",
}
_TEXT_KINDS = (
    (rb"ec_pdo_entry_info_t\b", "the output of `ethercat cstruct`"),
    (rb"^Domain\d+: LogBaseAddr", "the output of `ethercat domains -v`"),
    (rb"SM\d+: PhysAddr 0x", "the output of `ethercat pdos`"),
    (rb"^Watchdog divider:", "the output of `ethercat config -v`"),
    (rb"^[ \t]+Vendor Id: +0x", "the output of `ethercat slaves -v`"),
    (rb"SM\d+ (in|out)puts$|PDO mapping according to", "the output of SOEM `slaveinfo -map`"),
    (rb"^[ \t]*ethercat_slaves[ \t]*:", "an `ethercat_slaves.yaml` of an IgH node for ROS"),
    (
        rb"^[ \t]*(nets|subdevices|vendor_id)[ \t]*:",
        "a YAML file of ethercat_driver_ros2 or fsoe-net",
    ),
)
_NUMBER = re.compile(r"(?:#[xX]|0[xX])([0-9a-fA-F]{1,16})\Z|([0-9]{1,20})\Z")


def source_bytes(source: Source, out: Collector, name: str) -> tuple[bytes | None, str]:
    """Return the content and the name to show for it.

    Args:
        source: A path, or the bytes themselves.
        out: Takes FSN101 when a path cannot be read.
        name: Name shown for bytes that came from no file.
    """
    if isinstance(source, bytes):
        return source, name
    return read_bytes(source, out), os.fspath(source)


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
        if names[0] in _XML_KINDS or len(names) >= 200:
            raise _Found

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    with suppress(_Found, expat.ExpatError, ValueError, LookupError):
        parser.Parse(data[:_HEAD_BYTES], False)
    if not names:
        return ""
    if names[0] == "EtherCATInfo" and re.search(rb"<!-- Slave \d+ -->", data[:_HEAD_BYTES]):
        return "the output of `ethercat xml`"
    for name, given in zip(names, attributes, strict=True):
        if name == "Slave" and "PhysAddr" in given:
            return f"<{names[0]}>, which looks like a project of an ENI builder, not its ENI"
    return _XML_KINDS.get(names[0], f"XML with the root <{names[0][:60]}>")


def kind_of(data: bytes) -> str:
    """Return in words what kind of file these bytes are, by content; empty when it is not known."""
    head = data[:_HEAD_BYTES]
    if re.match(rb"(\xef\xbb\xbf)?\s*<", head) or head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        named = _xml_kind(data)
        if named:
            return named
    for pattern, words in _TEXT_KINDS:
        if re.search(pattern, head, re.MULTILINE):
            return words
    return ""


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
        hint=f"read it as what it is, or give {wanted}",
    )
    return False


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
    match = _NUMBER.match(text)
    value = None if match is None else int(match[1], 16) if match[1] else int(match[2])
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
