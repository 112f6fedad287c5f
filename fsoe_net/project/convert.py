"""Converts descriptions of a bus from one format to another."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Diagnostic, Severity, sort_diagnostics
from fsoe_net.errors import InputError
from fsoe_net.formats.esi.wanted import load_devices
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.recognise import find_format
from fsoe_net.formats.registry import (
    Format,
    Target,
    Yields,
    all_formats,
    all_targets,
    function_of,
    read_foreign,
)
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.write_files import write_all
from fsoe_net.formats.shared.writers import Written
from fsoe_net.model.described_network import describe
from fsoe_net.model.description import Description
from fsoe_net.model.joined_descriptions import fill_devices, has_layout, idle_types, join_buses

_NO_NET = "FSN125"


@dataclass(frozen=True, slots=True, kw_only=True)
class Conversion:
    """Files in another format.

    Attributes:
        files: Their bytes by their path.
        notes: Assumptions, and data that the format cannot represent.
        findings: Findings of the files read, sorted; no errors.
        description: The description written.
    """

    files: Mapping[str, bytes]
    notes: Sequence[str]
    findings: Sequence[Diagnostic]
    description: Description

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the files, all or none.

        Raises:
            InputError: A file exists and must not be replaced.
            EnvironmentFault: A file cannot be written; the existing content is unchanged.
        """
        write_all(folder, self.files, overwrite=overwrite)


def convert_files(
    files: Sequence[str],
    target: str,
    *,
    name: str,
    source: str | None = None,
    options: LoadOptions | None = None,
) -> Conversion:
    """Return the bus described by several files in another format.

    If a network and a file of the same bus are converted to the format of that file, and the format
    supports it, the result is that file with the copies of the network. All other bytes are
    unchanged.

    Args:
        files: Files, or folders written by a conversion.
        target: One of `all_targets`.
        name: Name of the file to write; formats with several files choose their own names.
        source: Format of all files; by default recognised by content.
        options: Options for following references.

    Raises:
        InputError: A file cannot be used, or the format cannot represent the bus.
    """
    notes: list[str] = []
    findings: list[Diagnostic] = []
    options = options or LoadOptions()
    forced = all_formats()[source] if source else None
    chosen = all_targets()[target]
    given = None if forced else _file_to_renew(files, chosen)
    if given is not None:
        bus = _read([f for f in files if f != given], None, notes, findings, options)
        data = {name: function_of(chosen.renew)(bus, given, notes)}
        return Conversion(files=data, notes=notes, findings=findings, description=bus)
    bus = _read(files, forced, notes, findings, options, starts=chosen.needs_start)
    notes += [f"{s.name or s.order or 'a SubDevice'}: {n}" for s in bus.subdevices for n in s.notes]
    if not bus.copies:
        notes.append("no copies are known, so no safety frame would be moved")
    named = {} if chosen.is_folder else {"file": name}
    written: Written = function_of(chosen.write)(bus, **named, **chosen.options)
    data = {path: text.encode("utf-8") for path, text in written.files.items()}
    return Conversion(
        files=data, notes=[*notes, *written.notes], findings=findings, description=bus
    )


def _file_to_renew(files: Sequence[str], target: Target) -> str | None:
    """Return the only file of the target's format given with a network; its copies are replaced."""
    if not target.renew or len(files) < 2:
        return None
    formats = {f: find_format(_file_of(f), Collector()) for f in files}
    same = [f for f, found in formats.items() if found and target in found.targets]
    networks = [f for f, found in formats.items() if found and found.yields is Yields.NETWORK]
    return same[0] if len(same) == 1 and networks else None


def _read(
    files: Sequence[str],
    forced: Format | None,
    notes: list[str],
    findings: list[Diagnostic],
    options: LoadOptions,
    *,
    starts: bool = False,
) -> Description:
    """Read and join the files; ``starts``: also the ESI data for starting a device."""
    out = Collector()
    named = [(f, forced or find_format(f, out)) for f in map(_file_of, dict.fromkeys(files))]
    known = [(f, found) for f, found in named if found is not None]
    buses, types = _read_others(known, out, options.master)
    own = [f for f, found in known if found.yields is Yields.NETWORK]
    if own:
        made, is_bus = _read_yaml(own, out, options)
        (buses if is_bus else types).insert(0, made)
    _refuse_errors(out)
    bus = join_buses(buses, notes) if buses else None
    for file, found in known:
        # Only now is the bus known: an ESI has thousands of devices, and only those on it are read.
        if found.yields is Yields.CATALOGUE:
            types += _read_catalogue(file, found, bus, out, notes, starts=starts)
    _refuse_errors(out)
    findings += sort_diagnostics(out.diagnostics)
    return _joined(bus, types, notes)


def _joined(bus: Description | None, types: list[Description], notes: list[str]) -> Description:
    if bus is not None:
        joined = fill_devices(bus, types, notes)
        notes += idle_types(bus, types)
    elif types:
        joined = replace(types[0], subdevices=tuple(s for t in types for s in t.subdevices))
    else:
        raise InputError("nothing written: nothing was read")
    if joined.truncated or any(s.truncated for s in joined.subdevices):
        raise InputError("nothing written: a file is cut off; what is missing is not guessed")
    return joined


def _read_others(
    files: Sequence[tuple[str, Format]], out: Collector, master: str
) -> tuple[list[Description], list[Description]]:
    """Return buses and device types of files that are neither a network nor a catalogue."""
    buses: list[Description] = []
    types: list[Description] = []
    for file, found in files:
        if found.yields in (Yields.NETWORK, Yields.CATALOGUE):
            continue
        read = read_foreign(file, found, out, master=master)
        if read is None:
            continue
        if found.yields is Yields.TYPES or read.placeless:
            types.append(read)
        else:
            buses.append(read)
    return buses, types


def _read_yaml(files: list[str], out: Collector, options: LoadOptions) -> tuple[Description, bool]:
    """Return the content of YAML and URDF, and whether it is a bus (slave YAMLs are types)."""
    loaded = load_network(files, options)
    # A bus without copies can also be described; a note reports that nothing is copied.
    out.diagnostics += [d for d in loaded.diagnostics if d.code != _NO_NET]
    _refuse_errors(out)
    network = loaded.network
    if network is None:
        raise InputError("nothing written: nothing was read")
    if network.partial and network.nets:
        raise InputError(
            "nothing written: these files alone are not a complete network; name the URDF or "
            "network file too"
        )
    made = describe(network)
    return made.without_positions() if network.partial else made, not network.partial


def _read_catalogue(
    file: str,
    catalogue: Format,
    bus: Description | None,
    out: Collector,
    notes: list[str],
    *,
    starts: bool,
) -> list[Description]:
    """Return the devices missing on the bus; without a bus all devices of the file.

    With ``starts``, also devices with known process data; a missing one is not a finding.
    """
    if bus is None:
        found = [read_foreign(file, catalogue, out)]
    else:
        lacking = [s for s in bus.subdevices if not has_layout(s.device)]
        known = [s for s in bus.subdevices if has_layout(s.device)] if starts else []
        found = [load_devices(file, lacking, out), load_devices(file, known, Collector())]
        if found == [None, None]:
            notes.append(f"{file}: no SubDevice needs a device of it")
    return [made for made in found if made is not None]


def _file_of(path: str) -> str:
    """Return the file to read in a folder written by `convert` or `scan`."""
    for name in ("network.yaml", "transfers.yaml"):
        inside = os.path.join(path, name)
        if os.path.isdir(path) and os.path.isfile(inside):
            return inside
    return path


def _refuse_errors(out: Collector) -> None:
    errors = [d for d in out.diagnostics if d.level is Severity.ERROR]
    if errors:
        raise InputError("nothing written", sort_diagnostics(errors))
