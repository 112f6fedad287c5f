"""The nets/transfers YAML of ethercat_driver_ros2, and the same nets inside a network file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Related, Severity
from fsoe_net.formats.own.schema import nearest_keys
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.numbers import Reader, own_int, read_int, warn_decimal_index
from fsoe_net.formats.shared.yaml_tree import MapNode, Node, SeqNode
from fsoe_net.fsoe.parameters import MOST_APP_BYTES
from fsoe_net.model.bus import Located, RobotComponent
from fsoe_net.model.network import ConnectionFacts, Endpoint, Net, Transfer, TransferKind


@dataclass(frozen=True, slots=True, kw_only=True)
class ModuleDecl(Located):
    """A module as an ``ec_module`` or a transfer YAML declares it.

    Args:
        name: Name used by transfers.
        plugin: As written, or ``None``.
        alias: 0 if absent or unreadable.
        position: Ring position, or offset from ``alias``. In a URDF, a module whose position is
            missing or unreadable gets a high unused one, to avoid further findings about it.
        slave_config: As written (after expansion); empty if absent.
        origin: Section of its declaration, as in `SubDevice`.
        required: False if the driver may omit the module.
        components: The joints, gpios and sensors that have it, in the order of the driver.
        mode: Mode of operation that the plugin for CiA 402 writes, or ``None``.
        params: Every ``param``, as written.
    """

    name: str
    plugin: str | None
    alias: int
    position: int
    slave_config: str
    origin: str
    required: bool = True
    components: tuple[RobotComponent, ...] = ()
    mode: int | None = None
    params: Mapping[str, str] = field(default_factory=dict)


def nets_from_yaml(root: MapNode, out: Collector, *, needed: bool = True) -> tuple[Net, ...]:
    """Return the nets of a document with a checked structure; invalid parts are omitted.

    Args:
        root: The document.
        out: Takes findings.
        needed: Whether FSoE frames are known; then an empty list is a mistake.
    """
    nets = [_net(node, out) for node in root.maps("nets")]
    if not nets and isinstance(root.get("nets"), (SeqNode, type(None))):
        # An unknown key may be a misspelt `nets` and has its own finding.
        misspelt = any(k not in ("nets", "safety_modules", "transfer_modules") for k in root.pairs)
        if "nets" in root.pairs or not misspelt:
            out.add(
                "FSN125",
                root.at("nets"),
                "no net is given: the driver would start and copy nothing",
                severity=None if needed else Severity.INFO,
                hint="add nets: with at least one net and its transfers"
                if needed
                else "fine for a bus without FSoE; else add nets: with their transfers",
            )
    return tuple(nets)


def _net(node: MapNode, out: Collector) -> Net:
    name = node.text("name") or "?"
    transfers = [_transfer(item, out) for item in node.maps("transfers")]
    connections = [_connection(item, out) for item in node.maps("connections")]
    broken = None in connections or not _are_maps(node.get("connections"))
    misspelt = _transfers_missing(node, name, out, quiet=broken or bool(connections))
    return Net(
        span=node.span,
        fields=node.places(),
        name=name,
        safety_master=_master(node, out),
        transfers=tuple(t for t in transfers if t is not None),
        incomplete=None in transfers or misspelt or broken,
        connections=tuple(c for c in connections if c is not None),
    )


def _master(node: MapNode, out: Collector) -> str | None:
    """Return the SubDevice with the MainInstance; FSN228 if two keys name different ones."""
    old, new = node.text("safety_master"), node.text("transfer_master")
    if old is None or new is None:
        return old if new is None else new
    if old != new:
        out.add(
            "FSN228",
            node.at("transfer_master"),
            f"transfer_master {new!r} and safety_master {old!r} disagree; newer drivers take "
            f"{new!r}, older ones {old!r}",
            hint="give only one of them",
            related=(Related(span=node.at("safety_master"), message="safety_master"),),
        )
    return new


def _are_maps(node: Node | None) -> bool:
    """Whether a value is absent, or a list of maps."""
    if node is None:
        return True
    return isinstance(node, SeqNode) and all(isinstance(item, MapNode) for item in node.items)


def _length(node: Node) -> int:
    return len(node.items) if isinstance(node, SeqNode) else -1


def _transfers_missing(node: MapNode, name: str, out: Collector, *, quiet: bool) -> bool:
    """Report FSN223; return whether another key was probably meant to be ``transfers``."""
    rows = node.get("transfers")
    known = {"name", "safety_master", "transfer_master", "transfers", "connections"}
    unknown = [k for k in node.pairs if k not in known]
    meant = {m for k in unknown for m in nearest_keys(k, known - set(node.pairs))}
    if rows is None and meant & {"transfers", "connections"}:
        return True
    if not quiet and (rows is None or _length(rows) == 0):
        out.add(
            "FSN223",
            node.at("transfers") if rows is not None else node.span,
            f"net {name!r} has no transfers; the driver would copy nothing for it",
            hint="add transfers: with one copy per direction and connection, or connections:",
        )
    return False


def _transfer(node: MapNode, out: Collector) -> Transfer | None:
    size = read_int(
        node.get("size"), out, what="size", low=-(2**31), high=2**31, reader=Reader.SLAVE
    )
    source = _endpoint(node.get("in"), out)
    destination = _endpoint(node.get("out"), out)
    if size is None or source is None or destination is None:
        return None
    if not 0 <= size <= 1486:
        out.add(
            "FSN113",
            node.at("size"),
            f"size {size} is outside 0 … 1486 bytes (one EtherCAT datagram)",
            hint="FSoE frames have 6, 7, 11, 15 … 255 bytes",
        )
        return None
    return Transfer(
        span=node.span,
        fields=node.places(),
        size_bytes=size,
        source=source,
        destination=destination,
        kind=TransferKind.STANDARD if node.text("kind") == "standard" else TransferKind.FSOE,
    )


def _endpoint(node: Node | None, out: Collector) -> Endpoint | None:
    if not isinstance(node, MapNode):
        return None
    module = node.text("ec_module")
    index_node = node.get("index")
    reader = Reader.ENDPOINT
    index = read_int(index_node, out, what="index", low=0, high=0xFFFF, reader=reader)
    subindex = read_int(node.get("subindex"), out, what="subindex", low=0, high=0xFF, reader=reader)
    warn_decimal_index(index_node, out, index)
    if module is None or index is None or subindex is None:
        return None
    return Endpoint(
        span=node.span, fields=node.places(), module=module, index=index, subindex=subindex
    )


_FACTS = ("address", "connection_id", "watchdog_ms", "app_parameters", "unconfirmed")


def _connection(node: MapNode, out: Collector) -> ConnectionFacts | None:
    main, sub = node.text("main"), node.text("sub")

    facts = {key: own_int(node, key, 0xFFFF, out) for key in _FACTS[:3]}
    slots = {key: own_int(node, key, 0xFFFF, out) for key in ("slot", "sub_slot")}
    parameters = _parameters(node, out)
    # An unreadable slot must not be treated as "no slot stated".
    if main is None or sub is None or any(slots[k] is None for k in slots if k in node.pairs):
        return None
    unknown = set(node.pairs) - {"main", "sub", *slots, *_FACTS}
    if any(nearest_keys(k, slots) for k in unknown):
        return None  # a slot is given, so the frames are unknown
    return ConnectionFacts(
        span=node.span,
        fields=node.places(),
        main=main,
        sub=sub,
        slot=slots["slot"],
        sub_slot=slots["sub_slot"],
        unconfirmed=_unconfirmed(node),
        address=facts["address"],
        connection_id=facts["connection_id"],
        watchdog_ms=facts["watchdog_ms"],
        app_parameters=parameters,
    )


def _unconfirmed(node: MapNode) -> str | None:
    """Return why a connection is unconfirmed, possibly empty; ``None`` if it is confirmed."""
    text = node.text("unconfirmed")
    if text is None or text.lower() in ("false", "no", "off"):
        return None  # a list, a map or nothing is a separate error
    return "" if node.truth("unconfirmed") else text


def _parameters(node: MapNode, out: Collector) -> bytes:
    text = node.text("app_parameters")
    if text is None:
        return b""
    digits = re.sub(r"[\s:_-]", "", text.removeprefix("0x"))
    if not re.fullmatch(r"(?:[0-9a-fA-F]{2})*", digits):
        why = "an odd number of digits" if re.fullmatch(r"[0-9a-fA-F]*", digits) else "other signs"
        out.add(
            "FSN306",
            node.at("app_parameters"),
            f"app_parameters must be pairs of hex digits, found {why}",
            hint='quote them, two digits per byte: app_parameters: "01 00 2c 01"',
        )
        return b""
    if len(digits) > 2 * MOST_APP_BYTES:
        out.add(
            "FSN306",
            node.at("app_parameters"),
            f"{len(digits) // 2} bytes of application parameters; a plan has "
            f"{MOST_APP_BYTES} at most",
            hint="check the parameter list of the device",
        )
        return b""
    return bytes.fromhex(digits)


def modules_from_yaml(root: MapNode, out: Collector) -> tuple[ModuleDecl, ...]:
    """Return the modules declared in a transfer YAML, in the order of the driver."""
    found = (
        _module(node, origin, out)
        for origin in ("transfer_modules", "safety_modules")
        for node in root.maps(origin)
    )
    return tuple(row for row in found if row is not None)


def _module(node: MapNode, origin: str, out: Collector) -> ModuleDecl | None:
    name = node.text("name")
    parameters = node.get("parameters")
    if name is None or not isinstance(parameters, MapNode):
        return None
    position = _address(parameters, "position", out)
    config = parameters.text("slave_config")
    if position is None or config is None:
        return None
    return ModuleDecl(
        span=node.span,
        fields=node.places() | {"slave_config": parameters.at("slave_config")},
        name=name,
        plugin=node.text("plugin"),
        alias=_address(parameters, "alias", out) or 0,
        position=position,
        slave_config=config,
        origin=origin,
    )


def _address(node: MapNode, key: str, out: Collector) -> int | None:
    """Read alias or position; drivers use `stoul`, older ones `stod`."""
    text = node.text(key)
    if text is None:
        return None
    if re.fullmatch(r"0|[1-9][0-9]{0,5}", text) and int(text) <= 0xFFFF:
        return int(text)
    digits = re.match(r"\s*\+?([0-9]+)", text)
    # At most nine digits: Python refuses to convert thousands of digits.
    if re.fullmatch(r"[0-9]+", text) and int(text[:9]) > 0xFFFF:
        out.add("FSN113", node.at(key), f"{key} {text} is outside 0 … 65535", hint="correct it")
        return None
    reads = f"newer drivers read {digits.group(1)}" if digits else "the driver stops"
    out.add(
        "FSN131",
        node.at(key),
        f"{key} {text!r} is not a plain decimal number; {reads}, older ones may read another",
        hint=f"write {int(text, 0)}"
        if re.fullmatch(r"0x[0-9a-fA-F]{1,4}", text)
        else "write 0, 1, 2 …",
    )
    return int(text, 0) if re.fullmatch(r"0x[0-9a-fA-F]{1,4}", text) else None
