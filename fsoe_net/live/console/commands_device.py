"""Commands of the console for single SubDevices: objects, SII, alias, history, scan."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fsoe_net.diag.words import counted
from fsoe_net.errors import ConsoleError
from fsoe_net.live.client import Client
from fsoe_net.live.console.command import CommandContext, CommandForm, table, usage
from fsoe_net.live.console.names import number, object_address, shown
from fsoe_net.live.control_values import ScanReply


def _sdo(context: CommandContext, words: Sequence[str]) -> None:
    if len(words) >= 3 and words[0] in ("read", "write"):
        index, sub = object_address(words[2])
        if words[0] == "read" and len(words) <= 4:
            return _sdo_read(context, words[1], (index, sub), words[3] if len(words) == 4 else "")
        if words[0] == "write" and len(words) == 5:
            kind, value = words[3:]

            # A function, not a lambda: the link runs it in its own thread, and it returns nothing.
            def write(client: Client) -> None:
                client.sdo_write(words[1], index, sub, kind=kind, value=value)

            context.link.aside(write)
            context.out(f"{words[1]} {index:#06x}:{sub:02x} written")
            return None
    raise usage("sdo", DEVICE_COMMANDS["sdo"].usage)


def _sdo_read(context: CommandContext, subdevice: str, place: tuple[int, int], kind: str) -> None:
    found = context.link.aside(lambda client: client.sdo_read(subdevice, *place, kind))
    value = found.value if isinstance(found.value, str) else shown(found.value)
    known = f"  {value}" if kind and found.value is not None else ""
    head = f"{subdevice} {place[0]:#06x}:{place[1]:02x}"
    context.out(f"{head}{known}  {counted(len(found.data), 'byte')}: {found.data.hex(' ')}")


def _sii(context: CommandContext, words: Sequence[str]) -> None:
    if not 1 <= len(words) <= 2:
        raise usage("sii", DEVICE_COMMANDS["sii"].usage)
    data = context.link.aside(lambda client: client.sii_read(words[0]))
    if len(words) == 2:
        try:
            Path(words[1]).write_bytes(data)
        except OSError as exc:
            raise ConsoleError(f"{words[1]}: {exc.strerror or exc}") from exc
        context.out(f"{counted(len(data), 'byte')} written to {words[1]}")
        return
    for at in range(0, len(data), 16):
        context.out(f"{at:04x}  {data[at : at + 16].hex(' ')}")


def _alias(context: CommandContext, words: Sequence[str]) -> None:
    if len(words) != 2:
        raise usage("alias", DEVICE_COMMANDS["alias"].usage)
    alias = number(words[1], "alias", 0xFFFF)
    context.link.aside(lambda client: client.alias_write(words[0], alias))
    context.out(f"{words[0]} has alias {alias} after its next power cycle")


def _history(context: CommandContext, words: Sequence[str]) -> None:
    if len(words) != 1:
        raise usage("history", DEVICE_COMMANDS["history"].usage)
    messages = context.link.aside(lambda client: client.history(words[0]))
    if not messages:
        context.out("no messages")
    rows = [
        (
            str(m.number),
            m.kind,
            f"{m.time_ns / 1e9:.6f} s",
            f"text {m.text_id:#06x}",
            " ".join(str(p) for p in m.parameters),
        )
        for m in messages
    ]
    for line in table(rows):
        context.out(line)


def _scan(context: CommandContext, words: Sequence[str]) -> None:
    if words:
        raise usage("scan", "")
    found = context.link.aside(lambda client: client.scan())
    for line in _scan_lines(found):
        context.out(line)


def _scan_lines(found: ScanReply) -> list[str]:
    rows = []
    for row in found.subdevices:
        planned = row.get("planned")
        identity = f"{row.get('vendor_id', 0):#010x} {row.get('product_code', 0):#010x}"
        rows.append(
            (
                str(row.get("position", "?")),
                str(planned or row.get("name") or "?"),
                str(row.get("al") or "?"),
                f"alias {row.get('alias', '?')}",
                identity,
                "; ".join(str(p) for p in (row.get("al_code_text"), *row.get("problems", ())) if p),
            )
        )
    lines = table(rows, "POSITION", "NAME", "STATE", "ALIAS", "VENDOR     PRODUCT", "PROBLEMS")
    changed = ["states of SubDevices were changed for it"] if found.states_changed else []
    return lines + changed


DEVICE_COMMANDS = {
    "sdo": CommandForm(
        "read SUBDEVICE INDEX[:SUB] [TYPE] | write SUBDEVICE INDEX[:SUB] TYPE VALUE",
        "read or write an object; SUB is hexadecimal as in names",
        "sdo read drive_1 0x1018:01 uint32",
        _sdo,
    ),
    "sii": CommandForm("SUBDEVICE [FILE]", "the SII memory, shown or saved", "sii drive_1", _sii),
    "alias": CommandForm(
        "SUBDEVICE ALIAS", "write the station alias to the SII", "alias drive_1 7", _alias
    ),
    "history": CommandForm(
        "SUBDEVICE", "its diagnosis history, object 0x10F3", "history drive_1", _history
    ),
    "scan": CommandForm("", "what stands on the bus", "scan", _scan),
}
