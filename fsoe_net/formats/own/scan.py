"""Reads a scan document of ``fsn-master`` (JSON) into the model, every value with its place."""

from __future__ import annotations

import json
import os
import re
from dataclasses import fields, replace
from typing import Any, NoReturn, TypeVar

from fsoe_net.diag.diagnostic import Diagnostic, Severity, Span, sort_diagnostics
from fsoe_net.diag.printable import printable
from fsoe_net.formats.own.schema import check_structure
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.numbers import Reader, own_int, read_int, record_of
from fsoe_net.formats.shared.ring import fits_on_bus
from fsoe_net.formats.shared.yaml_tree import MapNode, SeqNode, parse_yaml
from fsoe_net.model.bus import Entry, Pdo
from fsoe_net.model.scan import (
    Scan,
    ScannedConnection,
    ScannedFsoe,
    ScannedPort,
    ScannedSm,
    ScannedSubDevice,
)

_U8, _U16, _U32 = 0xFF, 0xFFFF, 0xFFFFFFFF
_MAX_DEPTH = 64
_T = TypeVar("_T")
_Row = TypeVar("_Row", Scan, ScannedSubDevice, ScannedSm, Pdo)
_ESCAPE = re.compile(r"\\(?:u([dD][89abAB]\w\w)\\u([dD][c-fC-F]\w\w)|u([dD][89a-fA-F]\w\w)|.)")
_BREAKS = re.compile("[\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff]")
_AGAIN = "scan the bus again: fsoe-net scan --interface IF -o DIR"


def load_scan(path: str | os.PathLike[str]) -> tuple[Scan | None, list[Diagnostic]]:
    """Read a scan document from a file.

    Returns:
        The scan, or ``None`` if it is damaged, and all findings.
    """
    out = Collector()
    data = read_bytes(path, out)
    if data is None:
        return None, sort_diagnostics(out.diagnostics)
    return parse_scan(data, os.fspath(path))


def parse_scan(data: bytes, file: str) -> tuple[Scan | None, list[Diagnostic]]:
    """Read a scan document.

    Args:
        data: The document, UTF-8.
        file: Name shown in findings.

    Returns:
        The scan, or ``None`` if it is damaged, and all findings. Unknown keys are ignored, because
        later versions may add some.
    """
    out = Collector()
    root = _parse(data, file, out)
    if root is None:
        return None, sort_diagnostics(out.diagnostics)
    check_structure(root, "scan", out)
    scan = None if _damaged(out) else _scan(root, out)
    if scan is not None:
        _check_positions(scan, out)
    found = sort_diagnostics(out.diagnostics)
    return (None if _damaged(out) else scan), found


def _damaged(out: Collector) -> bool:
    return any(d.level is Severity.ERROR for d in out.diagnostics)


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is not a number of JSON")


def _parse(data: bytes, file: str, out: Collector) -> MapNode | None:
    """Return the document with places. YAML that is not valid JSON is rejected first."""
    try:
        text = data.decode("utf-8")
        found = json.loads(text, parse_constant=_no_number)
    except json.JSONDecodeError as exc:
        span = Span(file, exc.lineno, exc.colno)
        out.add("FSN102", span, f"no scan document, not valid JSON: {exc.msg}", hint=_AGAIN)
        return None
    except RecursionError:
        out.add("FSN103", Span(file, 1, 1), f"nested deeper than {_MAX_DEPTH} levels", hint=_AGAIN)
        return None
    except ValueError as exc:
        out.add("FSN102", Span(file, 1, 1), f"no scan document: {exc}", hint=_AGAIN)
        return None
    if not isinstance(found, dict):
        out.add("FSN104", Span(file, 1, 1), "not a scan document: not a JSON object", hint=_AGAIN)
        return None
    return parse_yaml(_as_yaml(text).encode(), file, out, of_devices=True)


def _as_yaml(text: str) -> str:
    """Return JSON as YAML: no tabs, no surrogates, no characters that YAML treats as line breaks.

    Lines are unchanged, so that places stay valid. In JSON these characters occur only in strings,
    and raw tabs only between values.
    """
    # JSON escapes a character beyond 0xFFFF as two surrogates, which YAML rejects.
    text = _ESCAPE.sub(_character, text.replace("\t", " "))
    return _BREAKS.sub(lambda m: f"\\u{ord(m.group()):04x}", text)


def _character(match: re.Match[str]) -> str:
    high, low, lone = match.groups()
    if high is not None:
        return chr(0x10000 + ((int(high, 16) & 0x3FF) << 10) + (int(low, 16) & 0x3FF))
    return "\\ufffd" if lone is not None else match.group()


def _scan(root: MapNode, out: Collector) -> Scan:
    subdevices = tuple(_subdevice(node, out) for node in root.maps("subdevices"))
    changed = root.truth("states_changed")
    return _printable(record_of(Scan, root, out, states_changed=changed, subdevices=subdevices))


def _printable(row: _Row) -> _Row:
    """Return a record with printable texts; the texts come from devices."""
    texts: dict[str, str] = {f.name: getattr(row, f.name) for f in fields(row) if f.type == "str"}
    odd: dict[str, Any] = {
        key: printable(text) for key, text in texts.items() if not text.isprintable()
    }
    return replace(row, **odd) if odd else row


def _check_positions(scan: Scan, out: Collector) -> None:
    """Check that positions count from 0 without a gap, as they are places in the ring."""
    if not fits_on_bus(scan.subdevices, out):
        return
    for number, sub in enumerate(scan.subdevices):
        if sub.position != number:
            out.add(
                "FSN113",
                sub.at("position"),
                f"position {sub.position} stands where position {number} belongs; a scan has every "
                "SubDevice in ring order",
                hint=_AGAIN,
            )
            return


def _subdevice(node: MapNode, out: Collector) -> ScannedSubDevice:
    fsoe = node.get("fsoe")
    numbers = {"position": _U16, "alias": _U16, "al_status": _U16, "al_code": _U16}
    words = dict.fromkeys(("vendor_id", "product_code", "revision", "serial"), _U32)
    row = record_of(
        ScannedSubDevice,
        node,
        out,
        numbers | words,
        mailbox=tuple(map(printable, node.texts("mailbox") or ())),
        dc=_truth(node, "dc"),
        ports=tuple(_port(p, out) for p in node.maps("ports")),
        sms=_list(node, "sms", tuple(_sm(s, out) for s in node.maps("sms"))),
        fsoe=_fsoe(fsoe, out) if isinstance(fsoe, MapNode) else None,
        planned=printable(node.text("planned") or "") or None,
        problems=tuple(map(printable, node.texts("problems") or ())),
    )
    return _printable(row)


def _port(node: MapNode, out: Collector) -> ScannedPort:
    highs = {"port": 3, "link_lost": _U32, "rx_errors": _U32}
    return record_of(ScannedPort, node, out, highs, link=_truth(node, "link"))


def _sm(node: MapNode, out: Collector) -> ScannedSm:
    row = record_of(
        ScannedSm,
        node,
        out,
        index=own_int(node, "sm", _U8, out) or 0,
        start_byte=own_int(node, "start", _U16, out),
        size_bytes=own_int(node, "bytes", _U16, out),
        complete=_truth(node, "complete") is not False,
        pdos=_list(node, "pdos", tuple(_pdo(p, out) for p in node.maps("pdos"))),
    )
    return _printable(row)


def _pdo(node: MapNode, out: Collector) -> Pdo:
    entries = tuple(
        Entry(
            span=row.span,
            fields=row.places(),
            index=own_int(row, "index", _U16, out) or 0,
            subindex=own_int(row, "subindex", _U8, out) or 0,
            bits=own_int(row, "bits", _U16, out) or 0,
        )
        for row in node.maps("entries")
    )
    is_read = isinstance(node.get("entries"), SeqNode)
    return _printable(record_of(Pdo, node, out, {"index": _U16}, entries=entries, is_read=is_read))


def _fsoe(node: MapNode, out: Collector) -> ScannedFsoe:
    address = own_int(node, "address", _U16, out)
    items = node.get("addresses")
    reported = [
        read_int(i, out, what="addresses", low=0, high=_U16, reader=Reader.OWN)
        for i in (items.items if isinstance(items, SeqNode) else ())
    ]
    addresses = dict.fromkeys(a for a in (address, *reported) if a is not None)
    return record_of(
        ScannedFsoe,
        node,
        out,
        address=address,
        addresses=tuple(addresses),
        connections=_connections(node, "connections", out),
        given=_connections(node, "given", out),
    )


def _connections(node: MapNode, key: str, out: Collector) -> tuple[ScannedConnection, ...]:
    highs = dict.fromkeys(("address", "connection_id", "watchdog_ms", "state"), _U16)
    return tuple(
        record_of(
            ScannedConnection, row, out, highs, object_index=own_int(row, "object", _U16, out) or 0
        )
        for row in node.maps(key)
    )


def _list(node: MapNode, key: str, rows: tuple[_T, ...]) -> tuple[_T, ...] | None:
    """Return the rows, or ``None`` if the document has no such list."""
    return rows if isinstance(node.get(key), SeqNode) else None


def _truth(node: MapNode, key: str) -> bool | None:
    return node.truth(key) if key in node.pairs else None
