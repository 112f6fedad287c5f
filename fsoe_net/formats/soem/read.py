"""Output of SOEM's ``slaveinfo IFACE -map`` into a description.

The size of each direction in bits precedes the map, so truncation is detected to the bit. Lengths
in the map are hexadecimal. PDO numbers are only in maps from the SII.
"""

from __future__ import annotations

import re
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.recognise import is_format
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import Source, source_bytes
from fsoe_net.formats.shared.terminal_text import Line, Pasted, PrintedManager, pasted
from fsoe_net.model.bus import Device, Direction, Entry, Pdo, SyncManager, Watchdog
from fsoe_net.model.description import DescribedSubDevice, Description

_SLAVE = re.compile(r"Slave:(\d{1,5})$")
_NAME = re.compile(r"Name:(.*)$")
_SIZE = re.compile(r"(Output|Input) size: (\d{1,7})bits$")
_IDENTITY = re.compile(r"Man: ([0-9a-f]{8}) ID: ([0-9a-f]{8}) Rev: ([0-9a-f]{8})")
_SM = re.compile(r"SM(\d{1,2}) A:([0-9a-f]{4}) L: *(\d{1,5}) F:([0-9a-f]{8}) Type:(\d)$")
_MAP_SM = re.compile(r"SM(\d{1,2}) (outputs|inputs)$")
_MAP_PDO = re.compile(r"SM(\d{1,3}) ([RT])XPDO 0x([0-9A-Fa-f]{4})(?: (.*))?$")
_ENTRY = re.compile(
    r"(?:\[ *\d{1,5} *\] *)?\[0x([0-9A-Fa-f]{4,8})\.(\d)\] 0x([0-9A-Fa-f]{4}):0x([0-9A-Fa-f]{2}) "
    r"0x([0-9A-Fa-f]{2,4})(?: +(\S+(?: \(\d+\))?)(?: +(.*))?)?$"
)
_OTHER = re.compile(
    r"(State:|Delay:|Has DC:|DCParentport:|Activeports:|Configured address:|FMMU|MBX length|"
    r"CoE details:|Ebus current:|only LRD|PDO mapping according|addr b|End |Calculated|\d+ slaves|"
    r"SOEM |Slaveinfo|Starting|ec_init|Not all)"
)
_STARTS = ("Slave:", "Name:", "Output size:", "Input size:", "Man:", "SM", "[0x")
# The SII has 0xFF as the sync manager of a PDO that is not assigned.
_UNKNOWN_SM = 255


@dataclass(slots=True)
class _Slave:
    number: int
    span: Span
    name: str = ""
    sizes: dict[str, int] = field(default_factory=dict)
    identity: tuple[int, int, int] | None = None
    starts: dict[int, tuple[int, int]] = field(default_factory=dict)
    managers: list[PrintedManager] = field(default_factory=list)

    def bits(self, direction: Direction) -> int:
        """Bits of the map in one direction."""
        return sum(m.bits for m in self.managers if m.direction is direction)


def load_soem_text(source: Source, out: Collector, *, name: str = "<text>") -> Description | None:
    """Read the output of ``slaveinfo -map``.

    Args:
        source: Path, or the bytes.
        out: Takes findings; a truncated text is FSN146.
        name: Name shown when ``source`` is bytes.
    """
    data, shown = source_bytes(source, out, name)
    if data is None or not is_format(data, "soem", shown, out):
        return None
    text = pasted(data, shown, out)
    slaves: list[_Slave] = []
    text.read(lambda line: _take(slaves, line), "`slaveinfo -map`", _STARTS)
    mapped = any(
        line.stripped.startswith("PDO mapping") or _ENTRY.match(line.stripped) for line in text
    )
    if not slaves:
        out.add(
            "FSN140",
            Span(shown, 1, 1),
            "this is not the output of SOEM `slaveinfo -map`",
            hint="paste all that `slaveinfo IFACE -map` prints",
        )
        return None
    _complete(slaves, text, mapped=mapped)
    rows = [_described(s, shown, truncated=text.truncated and s is slaves[-1]) for s in slaves]
    return text.described("soem-slaveinfo", rows)


def _take(slaves: list[_Slave], line: Line) -> bool | None:
    """Process one line; ``None`` for one without facts, false if it is unknown."""
    return _take_known(slaves, line) or (None if _OTHER.match(line.stripped) else False)


def _take_known(slaves: list[_Slave], line: Line) -> bool:
    shown = line.stripped
    if match := _SLAVE.match(shown):
        slaves.append(_Slave(int(match[1]), line.span))
        return True
    if not slaves:
        if not (_MAP_SM.match(shown) or _MAP_PDO.match(shown)):
            return False
        slaves.append(_Slave(0, line.span))  # only the map was pasted
    slave = slaves[-1]
    if match := _ENTRY.match(shown):
        return _take_entry(slave, match, line)
    if match := _MAP_SM.match(shown):
        direction = Direction.OUTPUT if match[2] == "outputs" else Direction.INPUT
        slave.managers.append(PrintedManager(line.span, int(match[1]), direction))
        slave.managers[-1].pdos.append((0, line.span, []))
    elif match := _MAP_PDO.match(shown):
        _take_pdo(slave, match, line)
    else:
        return _take_fact(slave, shown)
    return True


def _take_entry(slave: _Slave, match: re.Match[str], line: Line) -> bool:
    index = int(match[3], 16)
    entry = Entry(
        span=line.span,
        index=index,
        subindex=int(match[4], 16),
        bits=int(match[5], 16),
        type_name=match[6] or "",
        name=(match[7] or "").strip() if index else "",
    )
    return bool(slave.managers) and slave.managers[-1].add(entry)


def _take_pdo(slave: _Slave, match: re.Match[str], line: Line) -> None:
    number = int(match[1])
    manager = next((m for m in slave.managers if m.index == number), None)
    if manager is None:
        direction = Direction.OUTPUT if match[2] == "R" else Direction.INPUT
        manager = PrintedManager(line.span, number, direction)
    else:
        # It moves to the end, since the entries that follow go to the last sync manager.
        slave.managers.remove(manager)
    slave.managers.append(manager)
    manager.pdos.append((int(match[3], 16), manager.span, []))


def _take_fact(slave: _Slave, shown: str) -> bool:
    if match := _SM.match(shown):
        slave.starts[int(match[1])] = (int(match[2], 16), int(match[4], 16))
    elif match := _SIZE.match(shown):
        slave.sizes[match[1]] = int(match[2])
    elif match := _IDENTITY.match(shown):
        slave.identity = (int(match[1], 16), int(match[2], 16), int(match[3], 16))
    elif match := _NAME.match(shown):
        slave.name = match[1].strip()
    else:
        return False
    return True


def _complete(slaves: list[_Slave], text: Pasted, *, mapped: bool) -> None:
    """Compare the bits of each map with the sizes that precede it."""
    if not mapped and not any(line.stripped.startswith("End slaveinfo") for line in text):
        text.cut(text.lines[-1], "it ends before the map")
        return
    if not mapped:
        text.out.add(
            "FSN147",
            slaves[0].span,
            "this is the output of `slaveinfo` without a map",
            hint="call it with -map: slaveinfo IFACE -map",
        )
        return
    for slave in slaves:
        _compare_sizes(slave, text, is_last=slave is slaves[-1])
    last = slaves[-1]
    if last.managers and not last.sizes and not last.managers[-1].pdos[-1][2]:
        text.cut(text.lines[-1], f"nothing follows SM{last.managers[-1].index}")
    elif not last.managers and len(slaves) > 1 and not last.sizes:
        text.cut(text.lines[-1], "nothing follows its last SubDevice")


def _compare_sizes(slave: _Slave, text: Pasted, *, is_last: bool) -> None:
    for word, direction in (("Output", Direction.OUTPUT), ("Input", Direction.INPUT)):
        want, got = slave.sizes.get(word), slave.bits(direction)
        if want is None or want == got:
            continue
        # A paste is truncated only at its end; a difference elsewhere means changed lines.
        if is_last and got < want:
            text.cut(text.lines[-1], f"{got} of {want} bits of {word.lower()}s are there")
        else:
            text.out.add(
                "FSN147",
                slave.span,
                f"the map of SubDevice {slave.number} has {got} bits of {word.lower()}s, its "
                f"size is {want}",
                hint="paste the output again, unchanged",
            )


def _described(slave: _Slave, shown: str, *, truncated: bool) -> DescribedSubDevice:
    managers: list[SyncManager] = []
    available: list[Pdo] = []
    notes = []
    for manager in slave.managers:
        if manager.index == _UNKNOWN_SM:
            available += manager.built().pdos or ()
            continue
        manager.start_byte, flags = slave.starts.get(manager.index, (None, None))
        if flags is not None:
            manager.watchdog = Watchdog.of(flags)
        # Each sync manager begins with an unnumbered PDO, which stays empty if PDOs are numbered.
        manager.pdos = [pdo for pdo in manager.pdos if pdo[2]]
        managers.append(manager.built())
    if any(p.index == 0 for m in managers for p in m.pdos or ()):
        notes.append("this text has no PDO numbers: each sync manager is one PDO here")
    vendor, product, revision = slave.identity or (0, 0, None)
    if slave.identity is None:
        notes.append("this text has no identity")
    device = Device(
        path=shown, vendor_id=vendor, product_code=product, sync_managers=tuple(managers)
    )
    return DescribedSubDevice(
        span=slave.span,
        name=slave.name,
        # SOEM counts from 1; here 0 means a map that was pasted without its list.
        position=slave.number - 1 if slave.number else None,
        device=device,
        available=tuple(available),
        revision=revision,
        truncated=truncated,
        notes=tuple(notes),
    )
