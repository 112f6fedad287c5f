"""Descriptions of a bus from one format into another."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fsoe_net.diag.diagnostic import Diagnostic, Severity, sort_diagnostics
from fsoe_net.errors import InputError
from fsoe_net.formats.eni.write import eni_notes, write_eni
from fsoe_net.formats.igh.write import write_c_header
from fsoe_net.formats.lcec.write import write_lcec
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.own.write import DriverVersion, write_driver, write_network
from fsoe_net.formats.registry import InputKind, find_kind, load_devices, load_foreign
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.write_files import write_all
from fsoe_net.formats.shared.writers import Written, own_words_lost
from fsoe_net.model.described_network import describe
from fsoe_net.model.description import Description
from fsoe_net.model.join import fill_devices, has_layout, join_buses
from fsoe_net.project.renew_eni import renewed_eni

__all__ = ["TARGETS", "Conversion", "convert_files"]

_NO_NET = "FSN125"
_Writer = Callable[[Description, str], Written]


@dataclass(frozen=True, slots=True, kw_only=True)
class Conversion:
    """Files in another format.

    Attributes:
        files: Their bytes by their path.
        notes: What was assumed, and what the format cannot hold.
        findings: What was found in the files that were read, sorted; no errors.
        description: What was written.
    """

    files: Mapping[str, bytes]
    notes: Sequence[str]
    findings: Sequence[Diagnostic]
    description: Description

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the files, all or none.

        Raises:
            InputError: One exists, and is not to be replaced.
            EnvironmentFault: One cannot be written; what was there is unchanged.
        """
        write_all(folder, self.files, overwrite=overwrite)


def convert_files(
    files: Sequence[str], target: str, *, name: str, source: str | None = None
) -> Conversion:
    """Return the bus that files describe together in another format.

    A network and an ENI of the same bus into an ENI: the copies of the network in that ENI, all
    else byte for byte.

    Args:
        files: Files, or folders that a conversion wrote.
        target: One of `TARGETS`.
        name: Of the file that is written; formats of several files choose theirs.
        source: Format of all files, a value of `InputKind`; otherwise it is known by content.

    Raises:
        InputError: A file cannot be used, or the format cannot hold the bus.
    """
    notes: list[str] = []
    findings: list[Diagnostic] = []
    kind = InputKind(source) if source else None
    given = _eni_to_renew(files, kind) if target == "eni" else None
    if given is not None:
        bus = _read([f for f in files if f != given], kind, notes, findings)
        data = {name: renewed_eni(bus, given, notes)}
        return Conversion(files=data, notes=notes, findings=findings, description=bus)
    bus = _read(files, kind, notes, findings, starts=target == "eni")
    notes += [f"{s.name or s.order or 'a SubDevice'}: {n}" for s in bus.subdevices for n in s.notes]
    if not bus.copies:
        notes.append("no copies are known, so no safety frame would be moved")
    written = _WRITERS[target](bus, name)
    data = {path: text.encode("utf-8") for path, text in written.files.items()}
    return Conversion(
        files=data, notes=[*notes, *written.notes], findings=findings, description=bus
    )


def _eni(description: Description, file: str) -> Written:
    facts = any(c.address is not None or c.watchdog_ms for c in description.connections)
    notes = [*eni_notes(description), *own_words_lost(description, nets=True)]
    if facts:
        notes.append("addresses and watchdogs of connections are not in this file")
    return Written(files={file: write_eni(description)}, notes=tuple(notes))


def _network(description: Description, file: str) -> Written:
    written = write_network(description, name=Path(file).stem)
    files = {file if n == "network.yaml" else n: text for n, text in written.files.items()}
    return replace(written, files=files)


def _driver(version: DriverVersion) -> _Writer:
    return lambda description, _file: write_driver(description, version=version)


_WRITERS: dict[str, _Writer] = {
    "network": _network,
    "driver": _driver(DriverVersion.NEWEST),
    **{f"driver-{v.value}": _driver(v) for v in DriverVersion if v is not DriverVersion.NEWEST},
    "eni": _eni,
    "igh": lambda d, file: write_c_header(d, igh=True, file=file),
    "c": lambda d, file: write_c_header(d, igh=False, file=file),
    "lcec": lambda d, file: write_lcec(d, file=file),
}


TARGETS = tuple(_WRITERS)


def _eni_to_renew(files: Sequence[str], kind: InputKind | None) -> str | None:
    """Return the one ENI that is named beside a network; its copies are to be replaced."""
    if kind is not None or len(files) < 2:
        return None
    kinds = {f: find_kind(_file_of(f), Collector()) for f in files}
    enis = [f for f, k in kinds.items() if k is InputKind.ENI]
    networks = [f for f, k in kinds.items() if k is InputKind.YAML]
    return enis[0] if len(enis) == 1 and networks else None


def _read(
    files: Sequence[str],
    kind: InputKind | None,
    notes: list[str],
    findings: list[Diagnostic],
    *,
    starts: bool = False,
) -> Description:
    """Read and join the files; with ``starts`` also what an ESI says about starting a device."""
    out = Collector()
    kinds = [(f, kind or find_kind(f, out)) for f in map(_file_of, dict.fromkeys(files))]
    buses: list[Description] = []
    types: list[Description] = []
    for file, found in kinds:
        if found not in (InputKind.YAML, InputKind.ESI, None):
            read = load_foreign(file, found, out)
            if read is not None:
                (types if found.is_device_type or read.placeless else buses).append(read)
    own = [f for f, k in kinds if k is InputKind.YAML]
    if own:
        made, is_bus = _read_yaml(own, out)
        (buses if is_bus else types).insert(0, made)
    _refuse_errors(out)
    bus = join_buses(buses, notes) if buses else None
    esis = [f for f, k in kinds if k is InputKind.ESI]
    types += _read_esi(esis, bus, out, notes, starts=starts)
    _refuse_errors(out)
    findings += sort_diagnostics(out.diagnostics)
    if bus is not None:
        joined = fill_devices(bus, types, notes)
    elif types:
        joined = replace(types[0], subdevices=tuple(s for t in types for s in t.subdevices))
    else:
        raise InputError("nothing written: nothing was read")
    if joined.truncated or any(s.truncated for s in joined.subdevices):
        raise InputError("nothing written: a file is cut off; what is missing is not guessed")
    return joined


def _read_yaml(files: list[str], out: Collector) -> tuple[Description, bool]:
    """Return what YAML and URDF say, and whether it is a bus: slave YAMLs are device types."""
    loaded = load_network(files, LoadOptions())
    # A bus without copies can be described all the same; a note says that nothing is moved.
    out.diagnostics += [d for d in loaded.diagnostics if d.code != _NO_NET]
    _refuse_errors(out)
    network = loaded.network
    if network is None:
        raise InputError("nothing written: nothing was read")
    if network.partial and network.nets:
        raise InputError(
            "nothing written: these files alone are no whole network; name the URDF or network "
            "file too"
        )
    made = describe(network)
    return made.without_positions() if network.partial else made, not network.partial


def _read_esi(
    files: list[str], bus: Description | None, out: Collector, notes: list[str], *, starts: bool
) -> list[Description]:
    """Return the devices that the bus lacks; without a bus all of each file.

    With ``starts`` also devices whose process data are known: those a file lacks are no finding.
    """
    types = []
    for file in files:
        if bus is None:
            found = [load_foreign(file, InputKind.ESI, out)]
        else:
            lacking = [s for s in bus.subdevices if not has_layout(s.device)]
            known = [s for s in bus.subdevices if has_layout(s.device)] if starts else []
            found = [load_devices(file, lacking, out), load_devices(file, known, Collector())]
            if found == [None, None]:
                notes.append(f"{file}: no SubDevice needs a device of it")
        types += [made for made in found if made is not None]
    return types


def _file_of(path: str) -> str:
    """Return the file to read of a folder that `convert` or `scan` wrote."""
    for name in ("network.yaml", "transfers.yaml"):
        inside = os.path.join(path, name)
        if os.path.isdir(path) and os.path.isfile(inside):
            return inside
    return path


def _refuse_errors(out: Collector) -> None:
    errors = [d for d in out.diagnostics if d.level is Severity.ERROR]
    if errors:
        raise InputError("nothing written", sort_diagnostics(errors))
