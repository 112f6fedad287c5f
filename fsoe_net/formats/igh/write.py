"""A description as a C header: tables for the IgH master, or the same tables in plain C.

The tables have the form printed by ``ethercat cstruct``, so they can be read back. They need no
casts. A table that a program does not use gives no warning, because a function uses it.
"""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.errors import InputError
from fsoe_net.formats.shared.writers import (
    Endpoints,
    Written,
    manager_of,
    own_words_lost,
    plain_text,
    unique_names,
)
from fsoe_net.model.bus import Direction, Entry, Pdo, SyncManager
from fsoe_net.model.description import DescribedEnd, DescribedSubDevice, Description

_LONGEST_BITS = 255
_PLAIN_TYPES = """\
#include <stddef.h>
#include <stdint.h>

typedef enum {FSN_DIR_INVALID, FSN_DIR_OUTPUT, FSN_DIR_INPUT} fsn_direction_t;
typedef enum {FSN_WD_DEFAULT, FSN_WD_ENABLE, FSN_WD_DISABLE} fsn_watchdog_mode_t;

typedef struct {
    uint16_t index;
    uint8_t subindex;
    uint8_t bit_length;
} fsn_pdo_entry_info_t;

typedef struct {
    uint16_t index;
    unsigned int n_entries;
    fsn_pdo_entry_info_t *entries;
} fsn_pdo_info_t;

typedef struct {
    uint8_t index;
    fsn_direction_t dir;
    unsigned int n_pdos;
    fsn_pdo_info_t *pdos;
    fsn_watchdog_mode_t watchdog_mode;
} fsn_sync_info_t;
"""
_IGH_TYPES = "#include <ecrt.h>\n#include <stddef.h>\n#include <stdint.h>\n#include <string.h>\n"


def write_c_header(
    description: Description, *, igh: bool = True, file: str = "fsoe_net_bus.h"
) -> Written:
    """Return one header with the tables of all SubDevices and with the copies.

    With IgH: ``ec_sync_info_t`` of each SubDevice, the list of entries to register for the copies,
    and ``fsn_copy_all``, which executes them in the image of the domain. In plain C: the same
    tables with separate types, and the copies as bytes of sync managers.

    Args:
        description: SubDevices, copies.
        igh: Whether the header is for the IgH master.
        file: Name of the file.

    Raises:
        InputError: A copy begins inside a byte or, with IgH, at no entry; an entry is too long.
    """
    return _Header(description, igh=igh).written(file)


class _Header:
    """Writes one header."""

    def __init__(self, description: Description, *, igh: bool) -> None:
        self.notes: list[str] = []
        self._description = description
        self._igh = igh
        self._kind = "ec" if igh else "fsn"
        self._names = unique_names(description)
        places = [s.position for s in description.subdevices]
        known = [p for p in places if p is not None]
        if len(set(known)) == len(places):
            self._numbers = known
        else:
            self._numbers = list(range(len(places)))
            if any(not s.alias for s in description.subdevices):
                self.notes.append("ring positions are not known; the order of the list is written")

    def written(self, file: str) -> Written:
        """Return the file."""
        guard = "FSOE_NET_BUS_H"
        lines = ["/* Tables of a bus, written by fsoe-net. Include it in one source file only. */"]
        lines += [f"#ifndef {guard}", f"#define {guard}", ""]
        lines += [_IGH_TYPES if self._igh else _PLAIN_TYPES]
        for number, sub in enumerate(self._description.subdevices):
            lines += self._tables(sub, number)
        lines += self._list()
        lines += self._igh_copies() if self._igh else self._plain_copies()
        lines += ["", "#endif"]
        lost = [
            f"{self._names[n]}: start-up SDOs are not in this file"
            for n, s in enumerate(self._description.subdevices)
            if s.device.sdos
        ]
        if self._description.connections:
            lost.append("addresses and watchdogs of FSoE connections are not in this file")
        if self._description.cycle_us:
            lost.append("the cycle is not in this file")
        return Written(
            files={file: "\n".join(lines) + "\n"}, notes=(*self.notes, *lost, *self._more())
        )

    def _more(self) -> list[str]:
        notes = own_words_lost(self._description, nets=False)
        if self._description.copies:
            notes.append("copies are C code here, which convert does not read back")
        return notes

    # -- one SubDevice ----------------------------------------------------------------------------

    def _tables(self, sub: DescribedSubDevice, number: int) -> Iterator[str]:
        own = f"slave_{self._numbers[number]}"
        shown = _comment(sub.order or self._names[number]).replace('"', "'")
        yield f'/* Master 0, Slave {self._numbers[number]:x}, "{shown}"'
        yield f" * Vendor ID:       0x{sub.device.vendor_id:08x}"
        yield f" * Product code:    0x{sub.device.product_code:08x}"
        if sub.revision is not None:
            yield f" * Revision number: 0x{sub.revision:08x}"
        yield " */"
        entries: list[str] = []
        pdos: list[str] = []
        syncs: list[str] = []
        for sm in sorted(sub.device.sync_managers, key=lambda s: s.index):
            rows = sub.device.pdos_of(sm)
            table = f"{own}_pdos + {len(pdos)}" if rows else "NULL"
            syncs.append(self._sync(sm, len(rows), table))
            for pdo in rows:
                found = self._entries(pdo, self._names[number])
                table = f"{own}_pdo_entries + {len(entries)}" if found else "NULL"
                pdos.append(f"{{0x{pdo.index:04x}, {len(found)}, {table}}},{_named(pdo.name)}")
                entries += found
        end = self._kind.upper()
        syncs.append(f"{{0xff, {end}_DIR_INVALID, 0, NULL, {end}_WD_DEFAULT}},")
        for kind, rest, table_rows in (
            ("pdo_entry", "pdo_entries", entries),
            ("pdo", "pdos", pdos),
            ("sync", "syncs", syncs),
        ):
            if table_rows:
                yield f"static {self._kind}_{kind}_info_t {own}_{rest}[] = {{"
                yield from (f"    {row}" for row in table_rows)
                yield "};"
                yield ""

    def _sync(self, sm: SyncManager, count: int, table: str) -> str:
        kind = self._kind.upper()
        direction = "OUTPUT" if sm.direction is Direction.OUTPUT else "INPUT"
        watchdog = f"{kind}_WD_{sm.watchdog.value.upper()}"
        return f"{{{sm.index}, {kind}_DIR_{direction}, {count}, {table}, {watchdog}}},"

    def _entries(self, pdo: Pdo, name: str) -> list[str]:
        rows = []
        for entry in pdo.entries:
            if entry.bits > _LONGEST_BITS and not entry.is_gap:
                raise InputError(f"{name}: {entry.address} has {entry.bits} bits; tables hold 255")
            for bits in _pieces(entry.bits):
                row = f"{{0x{entry.index:04x}, 0x{entry.subindex:02x}, {bits}}},"
                rows.append(row + _named("" if entry.is_gap else entry.name))
        return rows

    def _list(self) -> Iterator[str]:
        yield "typedef struct {"
        for field in (
            "const char *name",
            "uint16_t alias",
            "uint16_t position",
            "uint32_t vendor_id",
            "uint32_t product_code",
            "uint16_t assign_activate",
            f"const {self._kind}_sync_info_t *syncs",
        ):
            yield f"    {field};"
        yield "} fsn_subdevice_t;"
        yield ""
        subs = self._description.subdevices
        yield f"#define FSN_SUBDEVICES {len(subs)}u"
        yield ""
        yield "static inline const fsn_subdevice_t *fsn_subdevice(unsigned int number)"
        yield "{"
        rows = []
        for number, sub in enumerate(subs):
            alias, position = self._address(number)
            rows.append(
                f"{_string(self._names[number])}, {alias}, {position}, "
                f"0x{sub.device.vendor_id:08x}, 0x{sub.device.product_code:08x}, "
                f"0x{sub.device.assign_activate & 0xFFFF:04x}, "
                f"slave_{self._numbers[number]}_syncs"
            )
        yield from _row_by_number("fsn_subdevice_t", "FSN_SUBDEVICES", rows)

    def _address(self, number: int) -> tuple[int, int]:
        sub = self._description.subdevices[number]
        return (sub.alias, 0) if sub.alias else (0, self._numbers[number])

    # -- copies -----------------------------------------------------------------------------------

    def _byte(self, end: DescribedEnd, bits: int) -> int:
        manager = manager_of(self._description, end)
        if end.bit_offset % 8 or bits % 8:
            raise InputError(f"{self._names[end.subdevice]}: a copy of parts of bytes")
        if manager is None or end.bit_offset + bits > manager.known_bits:
            name = self._names[end.subdevice]
            raise InputError(f"{name}: a copy runs past what is known of Sm{end.sm_index}")
        return end.bit_offset // 8

    def _igh_copies(self) -> Iterator[str]:
        numbers: dict[tuple[int, int, int], int] = {}
        endpoints = Endpoints(self._description, self._names)
        rows: list[tuple[DescribedEnd, Entry]] = []
        copies = []
        for copy in self._description.copies:
            pair = []
            for end in (copy.source, copy.destination):
                self._byte(end, copy.bits)
                entry = endpoints.at(end)
                key = (end.subdevice, end.sm_index, end.bit_offset)
                # IgH needs each entry once, even if several copies use it.
                if key not in numbers:
                    numbers[key] = len(rows)
                    rows.append((end, entry))
                pair.append(numbers[key])
            copies.append((pair[0], pair[1], copy.bits // 8))
        if not copies:
            return
        yield ""
        yield "/* Filled by ecrt_domain_reg_pdo_entry_list(): bytes in the image of the domain. */"
        yield f"static unsigned int fsn_offsets[{len(rows)}];"
        yield ""
        yield "static inline const ec_pdo_entry_reg_t *fsn_registrations(void)"
        yield "{"
        yield "    static const ec_pdo_entry_reg_t rows[] = {"
        for number, (end, entry) in enumerate(rows):
            alias, position = self._address(end.subdevice)
            device = self._description.subdevices[end.subdevice].device
            yield (
                f"        [{number}] = {{{alias}, {position}, 0x{device.vendor_id:08x}, "
                f"0x{device.product_code:08x}, 0x{entry.index:04x}, 0x{entry.subindex:02x}, "
                f"&fsn_offsets[{number}], NULL}},"
            )
        yield f"        [{len(rows)}] = {{0, 0, 0, 0, 0, 0, NULL, NULL}},"
        yield "    };"
        yield "    return rows;"
        yield "}"
        yield ""
        yield "/* Once in each cycle, between ecrt_domain_process() and ecrt_domain_queue(). */"
        yield "static inline void fsn_copy_all(uint8_t *image)"
        yield "{"
        for source, destination, size in copies:
            yield (
                f"    memcpy(image + fsn_offsets[{destination}], "
                f"image + fsn_offsets[{source}], {size});"
            )
        yield "}"

    def _plain_copies(self) -> Iterator[str]:
        yield ""
        yield "typedef struct {"
        yield "    unsigned int subdevice; /* of fsn_subdevice() */"
        yield "    unsigned int sync_manager;"
        yield "    unsigned int byte; /* in the data of the sync manager */"
        yield "} fsn_end_t;"
        yield ""
        yield "typedef struct {"
        yield "    fsn_end_t source;"
        yield "    fsn_end_t destination;"
        yield "    unsigned int bytes;"
        yield "} fsn_copy_t;"
        yield ""
        yield f"#define FSN_COPIES {len(self._description.copies)}u"
        yield ""
        yield "static inline const fsn_copy_t *fsn_copy(unsigned int number)"
        yield "{"
        rows = []
        for copy in self._description.copies:
            ends = [
                f"{{{e.subdevice}, {e.sm_index}, {self._byte(e, copy.bits)}}}"
                for e in (copy.source, copy.destination)
            ]
            rows.append(f"{ends[0]}, {ends[1]}, {copy.bits // 8}")
        yield from _row_by_number("fsn_copy_t", "FSN_COPIES", rows)


def _row_by_number(kind: str, count: str, rows: list[str]) -> Iterator[str]:
    """Yield the body of a function; a comparison with 0 would cause a compiler warning."""
    if rows:
        yield f"    static const {kind} rows[] = {{"
        yield from (f"        [{number}] = {{{row}}}," for number, row in enumerate(rows))
        yield "    };"
        yield f"    return number < {count} ? &rows[number] : NULL;"
    else:
        yield "    (void)number;"
        yield "    return NULL;"
    yield "}"


def _pieces(bits: int) -> Iterator[int]:
    yield min(bits, _LONGEST_BITS)
    for first in range(_LONGEST_BITS, bits, _LONGEST_BITS):
        yield min(bits - first, _LONGEST_BITS)


def _comment(text: str) -> str:
    """Return a text that cannot end or begin a comment, or continue its line."""
    # `??/` is a trigraph for a backslash, which would continue the line.
    text = plain_text(text).replace("*/", "* /").replace("/*", "/ *").replace("??/", "? ?/")
    return text.replace("\\", "/")


def _named(name: str) -> str:
    text = _comment(name)
    return f" /* {text} */" if text else ""


def _string(text: str) -> str:
    r"""Return a C string; non-ASCII characters are written as bytes in octal."""
    shown = "".join(
        # `?` may begin a trigraph; an octal escape ends after three digits whatever follows.
        chr(b) if 0x20 <= b < 0x7F and chr(b) not in '"\\?' else f"\\{b:03o}"
        for b in plain_text(text).encode("utf-8")
    )
    return f'"{shown}"'
