"""Files of other tools, read as what they are by content."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from fsoe_net.diag import Span
from fsoe_net.load.eni import load_eni
from fsoe_net.load.esi import load_esi
from fsoe_net.load.files import Collector, read_bytes
from fsoe_net.load.foreign import kind_of
from fsoe_net.load.igh_text import load_igh_text
from fsoe_net.load.lcec import load_lcec
from fsoe_net.load.ros_slaves import load_ros_slaves
from fsoe_net.load.sii import load_sii
from fsoe_net.load.soem_text import load_soem_text
from fsoe_net.load.twinsafe import load_twinsafe
from fsoe_net.model import Description

__all__ = ["MAX_DESCRIPTION_BYTES", "description_reader", "load_description"]

MAX_DESCRIPTION_BYTES = 256 * 1024 * 1024

_Reader = Callable[[bytes, Collector, str], Description | None]

_READERS: tuple[tuple[str, _Reader], ...] = (
    ("an ENI", lambda data, out, name: load_eni(data, out, name=name)),
    ("an ESI", lambda data, out, name: load_esi(data, out, name=name)),
    ("the output of `ethercat", lambda data, out, name: load_igh_text(data, out, name=name)),
    ("the output of SOEM", lambda data, out, name: load_soem_text(data, out, name=name)),
    (
        "a configuration of linuxcnc-ethercat",
        lambda data, out, name: load_lcec(data, out, name=name),
    ),
    ("an `ethercat_slaves.yaml`", lambda data, out, name: load_ros_slaves(data, out, name=name)),
    ("a TwinSAFE project", lambda data, out, name: load_twinsafe(data, out, name=name)),
)


def description_reader(data: bytes) -> _Reader | None:
    """Return the reader of these bytes; ``None`` when no other tool's file is recognised.

    Text that is neither XML nor known, such as YAML, gives ``None``; bytes that are no text are
    taken for an SII image.
    """
    kind = kind_of(data)
    for words, reader in _READERS:
        if kind.startswith(words):
            return reader
    if not kind and b"\0" in data[:4096] and not data.startswith(b"{"):
        return lambda raw, out, name: load_sii(raw, out, name=name)
    return None


def load_description(path: str | Path, out: Collector) -> Description | None:
    """Read a file of another tool, or return ``None`` with a finding."""
    data = read_bytes(path, out, most=MAX_DESCRIPTION_BYTES)
    if data is None:
        return None
    reader = description_reader(data)
    if reader is None:
        kind = kind_of(data)
        text = f"this is {kind}" if kind else "the kind of this file is not known"
        out.add("FSN140", Span(str(path), 1, 1), text, hint="give a bus description")
        return None
    return reader(data, out, str(path))
