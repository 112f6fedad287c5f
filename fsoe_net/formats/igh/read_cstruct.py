"""``ethercat cstruct``: C tables with the PDOs of one or more SubDevices.

The comment before the second and later SubDevices gives its number in hexadecimal without a prefix;
the identifiers have it in decimal. Users rename identifiers, so a table is found by the name that
refers to it and by its ``+ offset``, never by its expected name.
"""

from __future__ import annotations

import re
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.terminal_text import Line, Pasted
from fsoe_net.model.bus import Device, Direction, Entry, Pdo, SyncManager, Watchdog
from fsoe_net.model.description import DescribedSubDevice, Description

_HEAD = re.compile(r'/\* *Master (\d+), Slave ([0-9a-f]+)(?:, "(.*)")?')
_IDENTITY = re.compile(r"(Vendor ID|Product code|Revision number): +0x([0-9a-f]{1,8})$")
_TABLE = re.compile(
    r"(?:static +)?(?:const +)?(?:ec|fsn)_(pdo_entry|pdo|sync)_info_t +(\w+)\[\d*\] *= *\{"
)
# People also write such tables by hand: decimal subindexes, // comments, &table[2], short rows.
_HEX = r"(0[xX][0-9a-fA-F]{1,4}|\d{1,5})"
_NOTE = r" *(?:/\*(.*?)\*/|//(.*))?$"
_REFERENCE = r"&?(\w+) *(?:(?:\+|\[) *(\d{1,6}) *\]?)?"
_ENTRY = re.compile(rf"\{{ *{_HEX} *, *{_HEX} *, *(\d{{1,5}}) *,? *\}} *,?{_NOTE}")
_PDO = re.compile(rf"\{{ *{_HEX} *, *(\d{{1,5}}) *, *{_REFERENCE} *,? *\}} *,?{_NOTE}")
_SYNC = re.compile(
    r"\{ *(\d{1,2}) *, *(?:EC|FSN)_DIR_(OUTPUT|INPUT) *(?:, *(\d{1,5}) *,"
    rf" *{_REFERENCE} *(?:, *(?:EC|FSN)_WD_(ENABLE|DISABLE|DEFAULT) *)?)?,? *\}} *,?{_NOTE}"
)
_COMMENT = re.compile(r"//|/\*.*\*/$|\*(?: |/?$)")
_END = re.compile(r"\};$")
_MOST_ROWS = 255  # of one PDO, and of one sync manager
_MOST_ENTRIES = 500_000
_LAST = re.compile(r"\{ *(0xff|0xFF) *(?:, *(?:EC|FSN)_DIR_INVALID[^}]*)?\}")
_NUMBER_OF = re.compile(r"slave_(\d{1,5})_")
_STARTS = ("ec_pdo", "ec_sync", "static ec_", "{", "};", "/* Master", "* Vendor", "* Product")
_DIRECTIONS = {"OUTPUT": Direction.OUTPUT, "INPUT": Direction.INPUT}
_WATCHDOGS = {
    "ENABLE": Watchdog.ENABLE,
    "DISABLE": Watchdog.DISABLE,
    "DEFAULT": Watchdog.DEFAULT,
}


@dataclass(slots=True)
class _Head:
    order: str = ""
    seen: bool = False
    numbers: dict[str, int] = field(default_factory=dict)

    @property
    def is_started(self) -> bool:
        """Whether a comment about a SubDevice has begun."""
        return self.seen or bool(self.numbers)


@dataclass(slots=True)
class _Table:
    kind: str
    name: str
    span: Span
    head: _Head
    rows: list[tuple[re.Match[str], Span]] = field(default_factory=list)
    ended: bool = False


def read_cstruct(text: Pasted) -> Description:
    """Read all tables, then follow ``syncs`` to ``pdos`` to ``entries``."""
    tables = _tables(text)
    if tables and not tables[-1].ended:
        text.cut(text.lines[-1], f"table {tables[-1].name} has no end")
    elif tables and tables[-1].kind != "sync":
        text.cut(text.lines[-1], f"no sync manager table follows {tables[-1].name}")
    rows = _subdevices(tables, text)
    if text.taken > _MOST_ENTRIES:
        what = f"its tables refer to more than {_MOST_ENTRIES} rows"
        text.out.add("FSN103", Span(text.shown, 1, 1), what, hint="is this really a device?")
        rows = []
    return text.described("ethercat-cstruct", rows)


_ROWS = {"pdo_entry": _ENTRY, "pdo": _PDO, "sync": _SYNC}


def _tables(text: Pasted) -> list[_Table]:
    tables: list[_Table] = []
    head = _Head()

    def take(line: Line) -> bool | None:
        nonlocal head
        shown = line.stripped
        table = tables[-1] if tables and not tables[-1].ended else None
        if match := _HEAD.search(shown):
            head = _Head(order=match[3] or "", seen=True)
        elif match := _IDENTITY.search(shown):
            head.numbers[match[1]] = int(match[2], 16)
        elif match := _TABLE.search(shown):
            if table is not None:
                text.cut(line, f"table {table.name} has no end")
                table.ended = True
            tables.append(_Table(match[1], match[2], line.span, head))
        elif table is not None:
            return _in_table(line, table, text)
        elif not _COMMENT.match(shown):
            # In a header, a bracket can also end something else.
            return None if shown in ("{", "}", "};") else False
        return True

    text.read(take, "`ethercat cstruct`", _STARTS)
    if head.is_started and (not tables or tables[-1].head is not head):
        text.cut(text.lines[-1], "nothing follows the comment of its last SubDevice")
    return tables


def _in_table(line: Line, table: _Table, text: Pasted) -> bool | None:
    """Process a line of an open table; ``None`` for a line that ends the text."""
    shown = line.stripped
    if _END.match(shown):
        table.ended = True
    elif match := _ROWS[table.kind].match(shown):
        table.rows.append((match, line.span))
    elif _COMMENT.match(shown) or (table.kind == "sync" and _LAST.match(shown)):
        pass
    elif shown.startswith("{"):
        text.cut(line, f"{shown[:60]!r} is not a row of table {table.name}")
        return None
    else:
        return False
    return True


def _number(text: str) -> int:
    return int(text, 16) if text[:2] in ("0x", "0X") else int(text)


def _subdevices(tables: list[_Table], text: Pasted) -> list[DescribedSubDevice]:
    rows = []
    entries: dict[str, _Table] = {}
    pdos: dict[str, _Table] = {}
    last: _Table | None = None
    for table in tables:
        if table.kind == "pdo_entry":
            entries[table.name], last = table, table
        elif table.kind == "pdo":
            pdos[table.name], last = table, table
        else:
            rows.append(_described(table, pdos, entries, text))
            last = None
    if last is not None:
        # Only the tables before the truncation: the PDOs are known, but not their sync managers.
        found = [_pdo(m, s, entries, text) for m, s in last.rows] if last.kind == "pdo" else []
        rows.append(_row(last, (), text, truncated=True, available=tuple(found)))
    return rows


def _described(
    table: _Table, pdos: dict[str, _Table], entries: dict[str, _Table], text: Pasted
) -> DescribedSubDevice:
    managers = []
    for match, span in table.rows:
        count, start = int(match[3] or 0), int(match[5] or 0)
        mailbox = match[4] == "NULL" and int(match[1]) < 2
        if mailbox:
            continue
        rows = _slice(pdos.get(match[4] or ""), start, count, match[4] or "NULL", span, text)
        managers.append(
            SyncManager(
                span=span,
                index=int(match[1]),
                direction=_DIRECTIONS[match[2]],
                watchdog=_WATCHDOGS[match[6] or "DEFAULT"],
                pdos=tuple(_pdo(m, s, entries, text) for m, s in rows),
            )
        )
    return _row(table, tuple(managers), text, truncated=text.truncated and not table.ended)


def _slice(
    table: _Table | None, start: int, count: int, name: str, span: Span, text: Pasted
) -> list[tuple[re.Match[str], Span]]:
    if not count or name == "NULL":
        return []
    rows = [] if table is None else table.rows[start : start + count][:_MOST_ROWS]
    # Tables may refer to the same rows any number of times.
    text.taken += len(rows)
    if text.taken > _MOST_ENTRIES:
        return []
    if len(rows) < count:
        text.out.add(
            "FSN147",
            span,
            f"{count} rows from {start} on are wanted of {name}; it has "
            f"{0 if table is None else len(table.rows)}",
            hint="paste the whole output; a table or a part of one is missing",
        )
    return rows


def _pdo(match: re.Match[str], span: Span, entries: dict[str, _Table], text: Pasted) -> Pdo:
    name = match[3] or "NULL"
    rows = _slice(entries.get(name), int(match[4] or 0), int(match[2]), name, span, text)
    found = [
        Entry(
            span=place,
            index=_number(row[1]),
            subindex=_number(row[2]),
            bits=int(row[3]),
            name=(row[4] or row[5] or "").strip() if _number(row[1]) else "",
        )
        for row, place in rows
    ]
    return Pdo(span=span, index=_number(match[1]), entries=tuple(found))


def _row(
    table: _Table,
    managers: tuple[SyncManager, ...],
    text: Pasted,
    *,
    truncated: bool,
    available: tuple[Pdo, ...] = (),
) -> DescribedSubDevice:
    numbers = table.head.numbers
    named = _NUMBER_OF.search(table.name)
    device = Device(
        path=text.shown,
        vendor_id=numbers.get("Vendor ID", 0),
        product_code=numbers.get("Product code", 0),
        sync_managers=managers,
    )
    return DescribedSubDevice(
        span=table.span,
        order=table.head.order,
        position=int(named[1]) if named else None,
        device=device,
        available=available,
        revision=numbers.get("Revision number"),
        truncated=truncated,
        notes=() if numbers else ("this text has no identity",),
    )
