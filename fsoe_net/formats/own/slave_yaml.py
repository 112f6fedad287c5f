"""Slave YAML of ethercat_driver_ros2: one SubDevice type with its PDOs, sync managers and SDOs."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence

from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.formats.own.schema import check_structure, schema_keys
from fsoe_net.formats.own.type_words import type_bits
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.numbers import (
    Reader,
    read_flag,
    read_float,
    read_int,
    warn_decimal_index,
)
from fsoe_net.formats.shared.yaml_tree import MapNode, Node, SeqNode, load_yaml
from fsoe_net.model.bus import Device, Direction, Entry, EntryView, Pdo, Sdo, SyncManager, Watchdog
from fsoe_net.model.drives import driver_facts

# Configured by the driver if a file lists no sync manager, or none that it supports.
_DEFAULT_SYNC_MANAGERS = (
    (0, Direction.OUTPUT, None, Watchdog.DISABLE),
    (1, Direction.INPUT, None, Watchdog.DISABLE),
    (2, Direction.OUTPUT, "rpdo", Watchdog.ENABLE),
    (3, Direction.INPUT, "tpdo", Watchdog.DISABLE),
)

_LARGEST_SCALE = 1e300  # a plan has finite numbers only, even after a shift

# Driver keys that the core does not use; they are part of the fingerprint.
_DRIVER_SWITCHES = {"auto_fault_reset": False, "auto_state_transitions": True}  # if absent
_DRIVER_LISTS = ("sdo_check",)
_DRIVER_CHANNEL = ("factor_from_sdo",)

_SDO_BYTES = {"8": 1, "16": 2, "32": 4, "64": 8}


def load_device(
    path: str | os.PathLike[str], out: Collector, *, named_at: Span | None = None
) -> Device | None:
    """Read one slave YAML.

    Args:
        path: The file.
        out: Takes the findings; see FSN1xx and FSN4xx.
        named_at: Place of the reference if another file names this one.

    Returns:
        The device, or ``None`` if its layout is uncertain.
    """
    root = load_yaml(path, out, named_at=named_at)
    if root is None:
        return None
    if named_at is not None and not schema_keys("slave") & set(root.pairs):
        keys = ", ".join(list(root.pairs)[:5])
        out.add(
            "FSN140",
            named_at,
            f"{os.fspath(path)!r} is not a slave YAML; its keys are: {keys}",
            hint="name the file with vendor_id, rpdo and tpdo of this device",
        )
        return None
    return device_from_yaml(root, os.fspath(path), out)


def device_from_yaml(root: MapNode, path: str, out: Collector) -> Device | None:
    """Convert a parsed slave YAML to a device; see `load_device`."""
    if not check_structure(root, "slave", out):
        return None
    vendor = _u32(root, "vendor_id", out)
    product = _u32(root, "product_id", out)
    rpdos = _pdos(root, "rpdo", out)
    tpdos = _pdos(root, "tpdo", out)
    if rpdos is None or tpdos is None:
        return None
    return Device(
        span=root.span,
        fields=root.places(),
        path=path,
        vendor_id=vendor or 0,
        product_code=product or 0,
        assign_activate=_u32(root, "assign_activate", out) or 0,
        sync_managers=_sync_managers(root, out),
        rpdos=rpdos,
        tpdos=tpdos,
        sdos=_sdos(root, out),
        driver=_driver(root, (*rpdos, *tpdos), out),
    )


def _driver(root: MapNode, pdos: tuple[Pdo, ...], out: Collector) -> str:
    """Return the keys that only the driver uses as JSON, equal for equal meaning; may be empty."""
    rows: dict[str, object] = {}
    for key, absent in _DRIVER_SWITCHES.items():
        if (flag := read_flag(root.get(key), out, what=key, absent=absent)) is not absent:
            rows[key] = flag
    for key in _DRIVER_LISTS:
        if (found := _plain(root.get(key))) is not None:
            rows[key] = found
    entries = [e for pdo in pdos for e in pdo.entries]
    of_channels = [driver_facts(e.driver) for e in entries]
    for key in _DRIVER_CHANNEL:
        rows |= _by_address(key, entries, [facts.get(key) for facts in of_channels])
    rows |= _by_address("for", entries, [e.component or None for e in entries])
    rows |= _by_address("mask", entries, [e.mask for e in entries])
    return _json(rows)


def _json(rows: Mapping[str, object]) -> str:
    return json.dumps(rows, sort_keys=True, separators=(",", ":")) if rows else ""


def _by_address(key: str, entries: Sequence[Entry], values: Sequence[object]) -> dict[str, object]:
    """Return the values of entries under a key; a list if an entry is mapped twice."""
    found: dict[str, list[object]] = {}
    for entry, value in zip(entries, values, strict=True):
        found.setdefault(entry.address, []).append(value)
    stated = {a: v[0] if len(v) == 1 else v for a, v in found.items() if v.count(None) < len(v)}
    return {key: stated} if stated else {}


def _driver_channel(node: MapNode) -> str:
    """Return the keys of a channel that only the driver uses, as JSON."""
    rows = {key: _plain(node.get(key)) for key in _DRIVER_CHANNEL}
    return _json({key: value for key, value in rows.items() if value is not None})


def _plain(node: Node | None) -> object:
    if isinstance(node, MapNode):
        return {key: _plain(value) for key, value in node.pairs.items()}
    if isinstance(node, SeqNode):
        return [_plain(item) for item in node.items]
    if node is None or node.is_null:
        return None
    try:
        # 16 and 0x10 must give the same fingerprint.
        return int(node.text, 0)
    except ValueError:
        return node.text


def _u32(root: MapNode, key: str, out: Collector) -> int | None:
    return read_int(root.get(key), out, what=key, low=0, high=0xFFFFFFFF, reader=Reader.SLAVE)


def _int(node: MapNode, key: str, high: int, out: Collector, low: int = 0) -> int | None:
    return read_int(node.get(key), out, what=key, low=low, high=high, reader=Reader.SLAVE)


def _pdos(root: MapNode, key: str, out: Collector) -> tuple[Pdo, ...] | None:
    """Return the PDOs of a group, or ``None`` if the length of an entry is unknown."""
    pdos: list[Pdo] = []
    sure = True
    for node in root.maps(key):
        index = _int(node, "index", 0xFFFF, out)
        warn_decimal_index(node.get("index"), out, index)
        channels = node.get("channels")
        entries = [_entry(item, node, out) for item in node.maps("channels")]
        if isinstance(channels, SeqNode) and len(entries) != len(channels.items):
            sure = False
        good = [e for e in entries if e is not None]
        sure = sure and len(good) == len(entries) and index is not None
        pdos.append(
            Pdo(span=node.span, fields=node.places(), index=index or 0, entries=tuple(good))
        )
    # An entry of unknown length shifts all later ones: no layout is better than a wrong one.
    return tuple(pdos) if sure else None


def _entry(node: MapNode, pdo: MapNode, out: Collector) -> Entry | None:
    index = _int(node, "index", 0xFFFF, out)
    warn_decimal_index(node.get("index"), out, index)
    subindex = _int(node, "sub_index", 0xFF, out)
    word = node.text("type")
    bits = type_bits(word, node.at("type"), out) if word is not None else None
    default = read_float(node.get("default"), out, what="default")
    mask = _int(node, "mask", 0xFF, out)
    if index is None or subindex is None or bits is None:
        return None
    groups = node.maps("data_mapping")
    return Entry(
        span=node.span,
        fields=node.places(),
        index=index,
        subindex=subindex,
        bits=bits,
        type_name=word or "",
        skip=read_flag(node.get("skip"), out, what="skip"),
        name=node.text("name") or "",
        command_interface=_interface(node, groups, "command_interface", out),
        state_interface=_interface(node, groups, "state_interface", out),
        default=_first_default(default, groups, out),
        mask=mask,
        factor=_scale(node, "factor", 1.0, out),
        offset=_scale(node, "offset", 0.0, out),
        views=tuple(v for v in (_view(g, bits, out) for g in groups) if v is not None),
        component=node.text("for") or pdo.text("for") or "",
        driver=_driver_channel(node),
        restart_relevant=read_flag(node.get("restart_relevant"), out, what="restart_relevant"),
    )


def _scale(node: MapNode, key: str, without: float, out: Collector) -> float:
    """Return ``factor`` or ``offset``: ``without`` with FSN487 if it leaves no value."""
    value = read_float(node.get(key), out, what=key)
    if value is None:
        return without
    if abs(value) <= _LARGEST_SCALE and (value or key == "offset"):
        return value
    out.add(
        "FSN487",
        node.at(key),
        f"{key} {(node.text(key) or '')[:40]}: this channel always has the same value",
        severity=Severity.ERROR,
        hint=f"write the {key} between the device and the interface, or leave it out",
    )
    return without


def _view(node: MapNode, entry_bits: int, out: Collector) -> EntryView | None:
    """Read an item of ``data_mapping``; ``None`` if it is not a run of bits in the entry."""
    word = node.text("type") or ""
    bits = type_bits(word, node.at("type"), out) if word else None
    first = _int(node, "addr_offset", 0xFFFF, out) or 0
    mask = _int(node, "mask", 0xFF, out)
    if bits is None:
        return None
    run = _run_of_bits(node, word, bits, mask, out)
    if run is None:
        return None
    shift, bits = run
    end = 8 * first + shift + bits
    if end > entry_bits:
        key = "mask" if shift else "type"
        hint = "write a shorter type or mask, or correct the type of the channel"
        if first:
            key, last = "addr_offset", -(-entry_bits // 8) - 1
            hint = f"addr_offset counts bytes inside the channel, from 0 to {last}"
        message = (
            f"this item takes bits {8 * first + shift} … {end - 1} of a channel of {entry_bits} "
            "bits; the driver would use the bits after it"
        )
        out.add("FSN422", node.at(key), message, hint=hint)
        return None
    return EntryView(
        span=node.span,
        fields=node.places(),
        bit=8 * first + shift,
        bits=bits,
        shift=0 if word == "bool" else shift,
        type_name=word,
        command_interface=_bound(node, "command_interface"),
        state_interface=_bound(node, "state_interface"),
        default=read_float(node.get("default_value"), out, what="default_value"),
        factor=_scale(node, "factor", 1.0, out),
        offset=_scale(node, "offset", 0.0, out),
    )


def _run_of_bits(
    node: MapNode, word: str, bits: int, mask: int | None, out: Collector
) -> tuple[int, int] | None:
    """Return first bit and number of bits of an item in its byte, or ``None`` with FSN422."""
    if word.startswith("bit") and bits > 8:
        out.add(
            "FSN427",
            node.at("type"),
            f"the driver reads and writes only one byte of {word}",
            hint="use uint16 … uint64, or two items",
        )
    if word == "bool" and (mask or 0).bit_count() != 1:
        said = "no mask" if mask is None else f"mask {mask}"
        out.add(
            "FSN405",
            node.at("mask"),
            f"a bool of data_mapping has {said}, which is not one bit; the driver would use others",
            hint="write the mask of its bit: 1, 2, 4, 8, 16, 32, 64 or 128",
        )
        return 0, 1
    if bits > 8 or mask is None:
        return 0, bits
    shift = (mask & -mask).bit_length() - 1 if mask else 0
    run = mask >> shift
    # run + 1 is a power of two only if the bits of the mask are neighbours.
    if run == 0 or run & (run + 1):
        what = "bits that do not lie side by side" if run else "no bit"
        out.add(
            "FSN422",
            node.at("mask"),
            f"mask 0x{mask:02x} selects {what}; no value is made of it",
            hint="give each run of bits an item of its own",
        )
        return None
    return shift, run.bit_length()


def _interface(node: MapNode, groups: list[MapNode], key: str, out: Collector) -> str | None:
    if key in node.pairs and "data_mapping" in node.pairs:
        _beside_mapping(node, key, out)
    inner = next((name for g in groups if (name := _bound(g, key)) is not None), None)
    own = _bound(node, key)
    return inner if own is None else own


def _bound(node: MapNode, key: str) -> str | None:
    """Return the interface named by a key.

    The driver reads an empty value as the text `null`, and no joint has such an interface.
    """
    name = node.text(key)
    return None if name == "null" else name


def _beside_mapping(node: MapNode, key: str, out: Collector) -> None:
    """FSN423: the driver rejects a command of the whole channel, even an empty one."""
    if key == "command_interface":
        out.add(
            "FSN423",
            node.at(key),
            f"{key} of a channel that has data_mapping; the driver stops with an exception",
            hint=f"move {key} into one item of data_mapping, or delete it",
        )
    elif _bound(node, key) is not None:
        out.add(
            "FSN423",
            node.at(key),
            f"{key} of a channel that has data_mapping; fsn-master has values of the items only",
            severity=Severity.INFO,
            hint=f"move {key} into one item of data_mapping",
        )


def _first_default(own: float | None, groups: list[MapNode], out: Collector) -> float | None:
    """Return the value the driver would write, or ``None`` for never (`.nan` means never)."""
    values = [own, *(read_float(g.get("default_value"), out, what="default_value") for g in groups)]
    return next((v for v in values if v is not None and not math.isnan(v)), None)


def _sync_managers(root: MapNode, out: Collector) -> tuple[SyncManager, ...]:
    found: list[SyncManager] = []
    for node in root.maps("sm"):
        index = _int(node, "index", 255, out)
        direction = node.text("type")
        if index is None or direction not in ("input", "output"):
            continue
        carries = (node.text("pdo") or "").lower()  # spelling already reported by the schema
        watchdog = node.text("watchdog")
        found.append(
            SyncManager(
                span=node.span,
                fields=node.places(),
                index=index,
                direction=Direction(direction),
                carries=carries if carries in ("rpdo", "tpdo") else None,
                watchdog=Watchdog(watchdog)
                if watchdog in ("enable", "disable")
                else Watchdog.DEFAULT,
            )
        )
    if found:
        return tuple(found)
    return tuple(
        SyncManager(
            span=root.span,
            index=index,
            direction=direction,
            carries=carries,
            watchdog=watchdog,
            declared=False,
        )
        for index, direction, carries, watchdog in _DEFAULT_SYNC_MANAGERS
    )


def _sdos(root: MapNode, out: Collector) -> tuple[Sdo, ...]:
    found: list[Sdo] = []
    for node in root.maps("sdo"):
        index = _int(node, "index", 0xFFFF, out)
        subindex = _int(node, "sub_index", 0xFF, out)
        word = node.text("type") or ""
        value = read_int(
            node.get("value"), out, what="value", low=-(2**63), high=2**64 - 1, reader=Reader.SLAVE
        )
        size = _SDO_BYTES.get(word.removeprefix("u").removeprefix("int"))
        if index is None or subindex is None or value is None or size is None:
            continue
        _check_sdo_value(node, word, size, value, out)
        found.append(
            Sdo(
                span=node.span,
                fields=node.places(),
                index=index,
                subindex=subindex,
                size_bytes=size,
                value=value,
            )
        )
    return tuple(found)


def _check_sdo_value(node: MapNode, word: str, size: int, value: int, out: Collector) -> None:
    low, high = -(2 ** (8 * size - 1)), 2 ** (8 * size - 1) - 1
    if word.startswith("u"):
        low, high = 0, 2 ** (8 * size) - 1
    if not low <= value <= high:
        out.add(
            "FSN418",
            node.at("value"),
            f"value {value} does not fit into {word} ({low} … {high})",
            hint="correct the value or the type",
        )
    elif not -(2**31) <= value < 2**31:
        signed = value - 2 ** (8 * size)
        hint = f"write {signed}, the same bytes" if word in ("uint32", "int32") else ""
        out.add(
            "FSN418",
            node.at("value"),
            f"value {value} is above 0x7fffffff: the driver reads a signed 32-bit number and "
            "stops with an exception",
            severity=Severity.WARNING,
            hint=hint,
        )
