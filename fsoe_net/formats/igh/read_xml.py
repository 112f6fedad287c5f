"""``ethercat xml``: SubDevices as seen by an IgH master, as ESI that is not quite XML.

Names are not escaped, so ``&`` and ``<`` in them break the file; they are escaped here before it is
parsed. Every type is ``Fixed`` and ``Mandatory``, which carries no information.
"""

from __future__ import annotations

import re

from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.eni.read_subdevice import pdo_of
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import text_of, xml_number
from fsoe_net.formats.shared.terminal_text import pasted
from fsoe_net.formats.shared.xml_tree import Element, parse_xml
from fsoe_net.model.bus import Device, Direction, Pdo, SyncManager, Watchdog
from fsoe_net.model.description import DescribedSubDevice, Description

_NAME = re.compile(r"(<Name(?: LcId=\"\d+\")?>)(?!<!\[CDATA\[)(.{0,300}?)(</Name>)")
_TYPE = re.compile(r"(<Type ProductCode=[^>]{0,200}>)(?!<!\[CDATA\[)(.{0,300}?)(</Type>)")
_AMPERSAND = re.compile(r"&(?!(?:amp|lt|gt|quot|apos|#\d{1,7}|#x[0-9a-fA-F]{1,6});)")
_COMMENT = re.compile(r"<!-- Slave (\d{1,5}) -->")
_FIRST = re.compile(r"<\?xml|<EtherCATInfo")


def read_xml(data: bytes, shown: str, out: Collector) -> Description | None:
    """Read the output of ``ethercat xml``; a prompt before or after it is ignored."""
    text = text_of(data)
    begin = _FIRST.search(text)
    if begin is None:
        out.add("FSN140", Span(shown, 1, 1), "no <EtherCATInfo> in this", hint="paste all of it")
        return None
    before = text[: begin.start()]
    body = text[begin.start() :]
    ends = [m.end() for m in re.finditer(r"</EtherCATInfo(?:List)?>", body)]
    if not ends or ("<EtherCATInfoList" in body and "</EtherCATInfoList>" not in body):
        _cut(data, shown, out)
        return None
    # Blanked, because a declaration is only valid at the very beginning; deleting moves columns.
    body = re.sub(r"<\?xml.{0,200}?\?>", lambda m: " " * len(m[0]), body[: ends[-1]])
    # Lines before the XML become empty lines, so that line numbers match the user's file.
    escaped = "\n" * before.count("\n") + _TYPE.sub(_escaped, _NAME.sub(_escaped, body))
    root = parse_xml(
        escaped.encode("utf-8", "replace"), shown, out, what="the output of `ethercat xml`"
    )
    if root is None:
        return None
    infos = root.all("EtherCATInfo") if root.name == "EtherCATInfoList" else [root]
    positions = [int(m[1]) for m in _COMMENT.finditer(body)]
    rows = []
    for number, info in enumerate(infos):
        # Comments give the positions; if a comment is missing, it is unknown which one.
        position = positions[number] if len(positions) == len(infos) else None
        rows += _devices(info, position, shown, out)
    return Description(span=root.span, format="ethercat-xml", path=shown, subdevices=tuple(rows))


def _cut(data: bytes, shown: str, out: Collector) -> None:
    """Report a truncated XML: it gives no description, because its elements are not closed."""
    text = pasted(data, shown, out)
    text.read(lambda line: line.stripped.endswith(">") or None, "", ())
    text.cut(text.lines[-1] if text.lines else None, "</EtherCATInfo> is missing")


def _escaped(match: re.Match[str]) -> str:
    inner = _AMPERSAND.sub("&amp;", match[2]).replace("<", "&lt;")
    return match[1] + inner + match[3]


def _devices(
    info: Element, position: int | None, shown: str, out: Collector
) -> list[DescribedSubDevice]:
    vendor = info.first("Vendor")
    vendor_id = None if vendor is None else xml_number(vendor.first("Id"), out)
    descriptions = info.first("Descriptions")
    group = None if descriptions is None else descriptions.first("Devices")
    rows = []
    for element in group.all("Device") if group is not None else ():
        kind = element.first("Type")
        if kind is None:
            what = "device without Type"
            out.add("FSN141", element.span, what, hint="paste the whole output")
            continue
        rows.append(_device(element, kind, vendor_id or 0, position, shown, out))
    return rows


def _device(
    element: Element,
    kind: Element,
    vendor_id: int,
    position: int | None,
    shown: str,
    out: Collector,
) -> DescribedSubDevice:
    assigned: dict[int, list[Pdo]] = {}
    available: list[Pdo] = []
    for child in element.children:
        if child.name not in ("RxPdo", "TxPdo"):
            continue
        pdo = pdo_of(child, out)
        if pdo is None:
            continue
        sm = child.attributes.get("Sm", "")
        if sm.isascii() and sm.isdigit() and len(sm) < 3:
            assigned.setdefault(int(sm), []).append(pdo)
        else:
            available.append(pdo)
    managers = []
    for number, sm_element in enumerate(element.all("Sm")):
        control = _attribute(sm_element, "ControlByte", out)
        if control & 3 == 2:  # a mailbox
            continue
        managers.append(
            SyncManager(
                span=sm_element.span,
                index=number,
                direction=Direction.OUTPUT if control & 4 else Direction.INPUT,
                watchdog=Watchdog.of(control),
                pdos=tuple(assigned.pop(number, ())),
                start_byte=_attribute(sm_element, "StartAddress", out) & 0xFFFF,
            )
        )
    for pdos in assigned.values():
        available += pdos
    name = element.first("Name")
    device = Device(
        span=element.span,
        path=shown,
        vendor_id=vendor_id,
        product_code=_attribute(kind, "ProductCode", out),
        sync_managers=tuple(managers),
    )
    return DescribedSubDevice(
        span=element.span,
        name="" if name is None else name.words,
        order=kind.words,
        position=position,
        device=device,
        available=tuple(available),
        revision=_attribute(kind, "RevisionNo", out),
        notes=("`ethercat xml` calls every PDO fixed and mandatory; that means nothing",),
    )


def _attribute(element: Element, name: str, out: Collector) -> int:
    given = element.attributes.get(name)
    if given is None:
        return 0
    return xml_number(Element(name, {}, element.span, text=given), out) or 0
