"""The older ``ethercat_slaves.yaml`` of IgH nodes for ROS: identities and addresses, no PDOs."""

from __future__ import annotations

from fsoe_net.formats.recognise import is_format
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.numbers import Reader, read_int
from fsoe_net.formats.shared.source import Source, source_bytes
from fsoe_net.formats.shared.yaml_tree import MapNode, parse_yaml
from fsoe_net.model.bus import Device
from fsoe_net.model.description import DescribedSubDevice, Description

_ROOT = "ethercat_slaves"
_PORTS = ("input_port", "output_port")


def load_ros_slaves(source: Source, out: Collector, *, name: str = "<yaml>") -> Description | None:
    """Read an ``ethercat_slaves.yaml``.

    Args:
        source: Path, or the bytes.
        out: Takes findings, located.
        name: Name shown when ``source`` is bytes.

    Returns:
        SubDevices by ring position, without process data: the node itself decides their layout.
    """
    data, shown = source_bytes(source, out, name)
    if data is None or not is_format(data, "ros-slaves", shown, out):
        return None
    root = parse_yaml(data, shown, out)
    if root is None:
        return None
    table = root.get(_ROOT)
    if not isinstance(table, MapNode):
        out.add("FSN140", root.span, f"no map {_ROOT} in this file", hint=f"it begins {_ROOT}:")
        return None
    period = read_int(
        table.get("period_ns"),
        out,
        what="period_ns",
        low=1000,
        high=10_000_000_000,
        reader=Reader.SLAVE,
    )
    rows = [
        _subdevice(key, node, shown, out)
        for key, node in table.pairs.items()
        if isinstance(node, MapNode)
    ]
    # The file is a map by name, and its order is not the ring order.
    rows.sort(key=lambda s: (s.position is None, s.position))
    return Description(
        span=table.span,
        format="ethercat-slaves-yaml",
        path=shown,
        subdevices=tuple(rows),
        cycle_us=None if period is None else period // 1000,
    )


def _subdevice(name: str, node: MapNode, shown: str, out: Collector) -> DescribedSubDevice:
    def number(key: str, high: int, *, needed: bool = True) -> int | None:
        if needed and node.get(key) is None:
            out.add("FSN141", node.span, f"{name} has no {key}", hint=f"add {key}: …")
        return read_int(node.get(key), out, what=key, low=0, high=high, reader=Reader.SLAVE)

    device = Device(
        span=node.span,
        fields=node.places(),
        path=shown,
        vendor_id=number("vendor_id", 0xFFFFFFFF) or 0,
        product_code=number("product_code", 0xFFFFFFFF) or 0,
        assign_activate=number("assign_activate", 0xFFFF, needed=False) or 0,
    )
    ports = [f"{key} {node.text(key)}" for key in _PORTS if node.text(key)]
    return DescribedSubDevice(
        span=node.span,
        fields=node.places(),
        name=name,
        position=number("position", 0xFFFF),
        alias=number("alias", 0xFFFF, needed=False) or 0,
        device=device,
        notes=("this file has no PDOs", *ports),
    )
