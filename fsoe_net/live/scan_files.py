"""Files from a scan: the document, a network without transfers, a slave YAML per device type."""

from __future__ import annotations

import json
import os
import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fsoe_net.compare.bus_scan import check_scan
from fsoe_net.errors import InputError
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.scan_bus import described_manager
from fsoe_net.formats.own.write_slave_yaml import LONGEST_BITS, write_slave_yaml
from fsoe_net.live.scan import TakenScan
from fsoe_net.live.scan_net import proposed_net, yaml_word
from fsoe_net.model.bus import Device, Direction, SyncManager, Watchdog
from fsoe_net.model.names import Names, numbered
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.model.scan import ScannedSm, ScannedSubDevice

_WIDTH = 100
_COMPARED = {"FSN501", "FSN503", "FSN504", "FSN505", "FSN506", "FSN507"}


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanFiles:
    """Text of each file by its path, and descriptions of omitted content."""

    texts: Mapping[str, str]
    left_out: tuple[str, ...]


class _NotExpressible(Exception):
    """The driver's format cannot express the mapping of this device."""


def compact_json(value: Any) -> str:
    """Return JSON in which everything that fits on one line is on one line."""
    return _json(value, 0, 0)


def _json(value: Any, indent: int, used: int) -> str:
    """Return a value that begins in column ``used`` of a line with this indentation."""
    line = json.dumps(value, ensure_ascii=False)
    # Short values stay on one line, so that a SubDevice is one readable row of the file.
    if used + len(line) <= _WIDTH or not isinstance(value, (dict, list)) or not value:
        return line
    pad = " " * (indent + 2)
    if isinstance(value, dict):
        keys = ((json.dumps(k, ensure_ascii=False) + ": ", v) for k, v in value.items())
        rows = [k + _json(v, indent + 2, indent + 3 + len(k)) for k, v in keys]
        first, last = "{", "}"
    else:
        rows = [_json(v, indent + 2, indent + 3) for v in value]
        first, last = "[", "]"
    return first + "\n" + ",\n".join(pad + r for r in rows) + "\n" + " " * indent + last


def scan_files(taken: TakenScan) -> ScanFiles:
    """Return the files for a scan, after reading them back and comparing them with it.

    Raises:
        InputError: The content read back differs from the bus.
    """
    scan = taken.scan
    paths: dict[str, str] = {}  # by the text of the slave YAML, which SubDevices of one type share
    files = Names()
    left_out: list[str] = []
    rows: list[str] = []
    names = _names(scan.subdevices)
    for sub in scan.subdevices:
        title = f"position {sub.position}: {sub.name or 'no name'}, {sub.identity}"
        # Couplers and junctions have no process data: a comment keeps their position visible.
        if not sub.process_data:
            unread = sub.sms is None
            rows.append(f"  # {title}: " + ("not read" if unread else "no process data"))
            if unread:
                left_out.append(f"{title}: its sync managers were not read")
            continue
        try:
            text = _device(sub)
        except _NotExpressible as exc:
            rows.append(f"  # {title}: {exc}")
            left_out.append(f"{title}: {exc}")
            continue
        if text not in paths:
            paths[text] = f"devices/{files.add(_slug(sub.name))}.yaml"
        rows += _row(sub, names[sub.position], paths[text])
    head = _head(taken, rows)
    texts = {"scan.json": compact_json(taken.document) + "\n", "network.yaml": head + "nets: []\n"}
    texts |= {path: text for text, path in paths.items()}
    # Read back before anything is written: a user must not get files that do not match the bus.
    resolution = _read_again(texts, taken)
    if resolution is not None:
        texts["network.yaml"] += proposed_net(resolution, scan)
        _read_again(texts, taken)
    return ScanFiles(texts=texts, left_out=tuple(left_out))


def _names(subdevices: tuple[ScannedSubDevice, ...]) -> dict[int, str]:
    """Return a name for each position: as planned, or else as reported by the device."""
    served = [s for s in subdevices if s.process_data]
    names = numbered([s.planned or _slug(s.name) for s in served])
    return {s.position: name for s, name in zip(served, names, strict=True)}


def _slug(name: str) -> str:
    """Return ``el1904`` for ``EL1904 4Ch. Safety Input``."""
    return re.sub(r"[^a-z0-9]+", "_", name.split(" ")[0].lower()).strip("_") or "subdevice"


def _row(sub: ScannedSubDevice, name: str, path: str) -> list[str]:
    revision = f" revision: 0x{sub.revision:08x}," if sub.revision is not None else ""
    facts = [f"alias {sub.alias}"] if sub.alias else []
    facts += [f"serial {sub.serial}"] if sub.serial else []
    if sub.fsoe is not None and sub.fsoe.address is not None:
        facts.append(f"FSoE address {sub.fsoe.address}")
    comment = f"  # {', '.join(facts)}" if facts else ""
    place = f"position: {sub.position},{revision} config: {json.dumps(path)}"
    return [f"  - {{name: {yaml_word(name)}, {place}}}{comment}"]


def _head(taken: TakenScan, rows: list[str]) -> str:
    scan = taken.scan
    when = f", {scan.utc}" if scan.utc else ""
    subs = "\n".join(rows)
    empty = " []" if all(r.startswith("  #") for r in rows) else ""
    return (
        f"# What is on {scan.interface}{when}, written by `fsoe-net scan`; the whole scan is in "
        "scan.json.\n"
        "# To do: the cycle, and a net with the transfers of each FSoE connection.\n"
        "version: 1\n"
        f"name: {json.dumps(scan.interface or 'scan')}\n"
        "# cycle_us: 1000\n\n"
        f"subdevices:{empty}\n{subs}\n\n"
    )


# -- slave YAML -----------------------------------------------------------------------------------


def _device(sub: ScannedSubDevice) -> str:
    """Return the slave YAML of a device in the format of ethercat_driver_ros2."""
    if sub.vendor_id is None or sub.product_code is None:
        raise _NotExpressible("its identity was not read")
    for kind in ("outputs", "inputs"):
        managers = [s for s in sub.process_data if s.kind == kind]
        # ethercat_driver_ros2 has one list of PDOs for each direction.
        if len(managers) > 1:
            raise _NotExpressible(f"{kind} on {len(managers)} sync managers; the format allows one")
        for sm in managers:
            _check_manager(sm)
    device = Device(
        path="",
        vendor_id=sub.vendor_id,
        product_code=sub.product_code,
        sync_managers=tuple(map(_manager, sub.sms or ())),
    )
    identity, rest = write_slave_yaml(device, sub.name, []).split("\n\n", 1)
    clock = "# assign_activate: 0x0300   # it has distributed clocks; see its ESI file\n"
    return (
        f"# {sub.name or 'Unnamed device'}, as it was found on the bus by `fsoe-net scan`. Types\n"
        "# are not known from a bus: whole bytes are unsigned here, other lengths bits.\n"
        f"{identity}\n{clock if sub.dc else ''}\n{rest}"
    )


def _check_manager(sm: ScannedSm) -> None:
    """Raise an exception for PDOs that were not read: all entries after them would be shifted."""
    if not sm.complete:
        raise _NotExpressible(f"SM{sm.index} was not read completely")
    if not sm.pdos:
        raise _NotExpressible(f"the PDOs of SM{sm.index} were not read")
    for pdo in sm.pdos:
        if not pdo.is_read:
            raise _NotExpressible(f"the mapping of PDO 0x{pdo.index:04x} was not read")
        if not pdo.entries:
            raise _NotExpressible(f"PDO 0x{pdo.index:04x} maps nothing")
        for entry in pdo.entries:
            if entry.index and not 0 < entry.bits <= LONGEST_BITS:
                text = f"{entry.address} in PDO 0x{pdo.index:04x} has {entry.bits} bits"
                raise _NotExpressible(text)


def _manager(sm: ScannedSm) -> SyncManager:
    manager = described_manager(sm)
    # Only outputs have a watchdog in EtherCAT: it makes them safe if frames stop.
    has_outputs = manager.direction is Direction.OUTPUT and manager.pdos
    return replace(manager, watchdog=Watchdog.ENABLE if has_outputs else Watchdog.DISABLE)


# -- reading again, writing -----------------------------------------------------------------------


def _read_again(texts: Mapping[str, str], taken: TakenScan) -> Resolution | None:
    """Load the files as a user would and compare them with the scan.

    Raises:
        InputError: The files and the scan differ.
    """
    with tempfile.TemporaryDirectory(prefix="fsoe-net-scan-") as folder:
        _write(Path(folder), texts)
        network = load_network([os.path.join(folder, "network.yaml")]).network
        if network is None:
            raise InputError("the network of this scan cannot be read again; nothing was written")
        resolution = resolve(network)
    # Only codes about order and layout. FSN502 is expected: a SubDevice without process data is
    # omitted.
    wrong = [d for d in check_scan(resolution, taken.scan) if d.code in _COMPARED]
    if wrong:
        raise InputError(
            f"the files of this scan do not say what is on the bus: {wrong[0].message}; nothing "
            "was written"
        )
    return resolution if network.subdevices else None


def _write(folder: Path, texts: Mapping[str, str]) -> None:
    for path, text in texts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
