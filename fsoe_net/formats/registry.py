"""One file of another tool, whichever it is: the kind by content, then its reader."""

from __future__ import annotations

import enum
import importlib
import os
from collections.abc import Iterable
from typing import Protocol

from fsoe_net.diag.diagnostic import Span
from fsoe_net.errors import InputError
from fsoe_net.formats.capture.packets import is_capture
from fsoe_net.formats.shared.files import Collector, open_file
from fsoe_net.formats.shared.source import Source, kind_of, next_step
from fsoe_net.formats.sii.hex_text import is_hex_text
from fsoe_net.model.description import DescribedSubDevice, Description

__all__ = ["InputKind", "find_kind", "load_devices", "load_foreign"]

_HEAD_BYTES = 65_536


class InputKind(enum.Enum):
    """Formats that are read."""

    YAML = "yaml"  # network, transfer and slave YAML, URDF: `load_network` reads them
    ESI = "esi"
    ENI = "eni"
    SII = "sii"
    ETHERCAT = "ethercat"
    SOEM = "soem"
    LCEC = "lcec"
    ROS_SLAVES = "ros-slaves"
    TWINSAFE = "twinsafe"
    TWINCAT = "twincat"
    CAPTURE = "capture"

    @property
    def is_device_type(self) -> bool:
        """Whether such a file describes device types, without a place in a ring."""
        return self in (InputKind.ESI, InputKind.SII)


# How the words of `kind_of` begin, the longer ones first.
_BY_WORDS = (
    ("an ENI", InputKind.ENI),
    ("the output of SOEM", InputKind.SOEM),
    ("the output of `ethercat", InputKind.ETHERCAT),
    ("an ESI", InputKind.ESI),
    ("a configuration of linuxcnc-ethercat", InputKind.LCEC),
    ("a TwinSAFE", InputKind.TWINSAFE),
    ("a TwinCAT project", InputKind.TWINCAT),
    ("an `ethercat_slaves.yaml`", InputKind.ROS_SLAVES),
    ("a robot description", InputKind.YAML),
    ("a YAML file", InputKind.YAML),
)
_BY_SUFFIX = {
    ".yaml": InputKind.YAML,
    ".yml": InputKind.YAML,
    ".urdf": InputKind.YAML,
    ".xacro": InputKind.YAML,
    ".sii": InputKind.SII,
    ".bin": InputKind.SII,
}


class _Reader(Protocol):
    def __call__(self, source: Source, out: Collector, *, name: str) -> Description | None: ...


# Module and function of each reader: only those that are needed are imported.
_READERS = {
    InputKind.ENI: ("eni.read", "load_eni"),
    InputKind.ESI: ("esi.read", "load_esi"),
    InputKind.SII: ("sii.read", "load_sii"),
    InputKind.ETHERCAT: ("igh.read", "load_igh_text"),
    InputKind.SOEM: ("soem.read", "load_soem_text"),
    InputKind.LCEC: ("lcec.read", "load_lcec"),
    InputKind.ROS_SLAVES: ("ros_slaves.read", "load_ros_slaves"),
    InputKind.TWINSAFE: ("twinsafe.read", "load_twinsafe"),
    InputKind.TWINCAT: ("twincat.read", "load_twincat"),
    InputKind.CAPTURE: ("capture.read", "load_capture"),
}


def find_kind(source: Source, out: Collector, *, name: str = "<file>") -> InputKind | None:
    """Return the format of a file, by content and only then by suffix.

    Args:
        source: Path, or the bytes of the file.
        out: Takes FSN101 when it cannot be read, FSN117 when nothing knows it.
        name: Name shown when ``source`` is bytes.
    """
    if isinstance(source, bytes):
        head, path = source[:_HEAD_BYTES], name
    else:
        path = os.fspath(source)
        try:
            with open_file(path) as stream:
                head = stream.read(_HEAD_BYTES)
        except InputError as exc:
            out.diagnostics += exc.diagnostics
            return None
    if is_capture(head):
        return InputKind.CAPTURE
    words = kind_of(head) if head.strip() else "an empty file"
    for begin, kind in _BY_WORDS:
        if words.startswith(begin):
            return kind
    if not words and b"<EtherCATInfo" in head:
        return InputKind.ETHERCAT  # XML behind a prompt
    suffix = _BY_SUFFIX.get(os.path.splitext(path)[1].lower())
    if suffix is InputKind.YAML and not words:
        return suffix
    if not words and is_hex_text(head):
        return InputKind.SII
    if not words and (suffix is InputKind.SII or b"\0" in head[:128]):
        return InputKind.SII
    out.add(
        "FSN117",
        Span(path, 1, 1),
        f"this is {words}, which is not read" if words else "no reader knows this file",
        hint=next_step(words)
        or "give an ENI, ESI, SII image, YAML, URDF, capture, output of `ethercat` or SOEM; "
        "`fsoe-net convert --from` takes a format by name",
    )
    return None


def load_foreign(
    source: Source, kind: InputKind, out: Collector, *, name: str = "<file>"
) -> Description | None:
    """Read a file of another tool that describes a bus, or all devices of a small ESI.

    Args:
        source: Path, or the bytes of the file.
        kind: Its format, not `InputKind.YAML`.
        out: Takes what is wrong with it.
        name: Name shown when ``source`` is bytes.
    """
    module, function = _READERS[kind]
    reader: _Reader = getattr(importlib.import_module(f"fsoe_net.formats.{module}"), function)
    return reader(source, out, name=name)


def load_devices(
    path: str, wanted: Iterable[DescribedSubDevice], out: Collector
) -> Description | None:
    """Read from an ESI of any size the devices that somebody has; ``None`` when it has none.

    Args:
        path: The ESI.
        wanted: SubDevices; their identity, revision and modules count. One without an identity is
            found by its order number, where the file has one device of that.
        out: Takes what is wrong with it.
    """
    from fsoe_net.formats.esi.read import EsiChoice, list_esi, load_esi

    catalogue = list_esi(path, out)
    if catalogue is None:
        return None
    offered: dict[object, set[tuple[int, int]]] = {}
    for row in catalogue.rows:
        identity = (row.vendor, row.product)
        for key in (identity, row.type.casefold()) if row.kind == "device" else ():
            offered.setdefault(key, set()).add(identity)
    choices = set()
    for sub in wanted:
        own = (sub.device.vendor_id, sub.device.product_code)
        same = offered.get(own if own[1] else sub.order.casefold() or None, set())
        if len(same) == 1:
            vendor, product = next(iter(same))
            choices.add(
                EsiChoice(
                    vendor=vendor,
                    product=product,
                    revision=sub.revision,
                    modules=sub.module_ident or None,
                )
            )
    rows: list[DescribedSubDevice] = []
    for choice in sorted(choices, key=repr):
        found = load_esi(path, out, choice=choice)
        rows += () if found is None else found.subdevices
    if not rows:
        return None
    return Description(span=Span(path, 1, 1), format="esi", path=path, subdevices=tuple(rows))
