"""Other files that a network is compared with, recognised by content."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import field, replace
from typing import TYPE_CHECKING

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.formats.recognise import find_format
from fsoe_net.formats.registry import Format, Yields, read_foreign
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.limits import MAX_LARGE_BYTES
from fsoe_net.model.network import NetworkConfig, SourceFile

if TYPE_CHECKING:
    from fsoe_net.model.description import Description

_NOT_FOUND = frozenset({"FSN135", "FSN136"})  # reported by the comparison, at the user's revision


@dataclass(slots=True)
class References:
    """Content of the other files, and their findings."""

    descriptions: list[Description] = field(default_factory=list)
    sources: list[SourceFile] = field(default_factory=list)
    diagnostics: list[Diagnostic] = field(default_factory=list)


def split_files(files: Sequence[str]) -> tuple[list[str], list[tuple[str, Format]]]:
    """Return the files of the network itself, and the other ones with their formats.

    An unknown file counts as a file of the network, whose reader then reports the error.
    """
    own: list[str] = []
    others: list[tuple[str, Format]] = []
    for path in files:
        known = find_format(path, Collector())
        if known is None or known.yields is Yields.NETWORK:
            own.append(path)
        else:
            others.append((path, known))
    # Only files of other tools: they go to the reader of networks, which reports what they are.
    if not own:
        return [path for path, _ in others], []
    return own, others


def read_references(
    files: Sequence[tuple[str, Format]], network: NetworkConfig, *, master: str = ""
) -> References:
    """Read the other files: of an ESI only the devices in the network, of several masters one."""
    found = References()
    for path, known in files:
        out = Collector()
        if known.yields is Yields.CATALOGUE:
            description = _devices(path, network, out)
            sha256 = _sha256(path)
        else:
            data = read_bytes(path, out, most=MAX_LARGE_BYTES)
            description = (
                None if data is None else read_foreign(data, known, out, name=path, master=master)
            )
            sha256 = hashlib.sha256(data or b"").hexdigest()
        found.diagnostics += out.diagnostics
        if description is not None:
            found.descriptions.append(description)
            found.sources.append(SourceFile(path=path, sha256=sha256))
    return found


def _sha256(path: str) -> str:
    try:
        with open(path, "rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError:
        return ""  # it existed when it was read


def _devices(path: str, network: NetworkConfig, out: Collector) -> Description | None:
    from fsoe_net.formats.esi.wanted import load_devices
    from fsoe_net.model.description import DescribedSubDevice, Description

    wanted = [
        DescribedSubDevice(device=sub.device, revision=sub.revision)
        for sub in network.subdevices
        if sub.device is not None
    ]
    mine = Collector()
    description = load_devices(path, wanted, mine)
    if any(d.code == "FSN135" for d in mine.diagnostics):
        # A revision older than all in the file: the newest is compared, with a remark.
        mine = Collector()
        description = load_devices(path, [replace(w, revision=None) for w in wanted], mine)
    out.diagnostics += [d for d in mine.diagnostics if d.code not in _NOT_FOUND]
    if description is None and not out.diagnostics:
        description = Description(format="esi", path=path)
    return description
