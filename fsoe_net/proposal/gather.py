"""Sorts the content of the files of ``fsoe-net init``: a ring, device types, projects."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from fsoe_net.diag.diagnostic import Diagnostic, Severity, Span, sort_diagnostics
from fsoe_net.diag.words import listed
from fsoe_net.errors import InputError
from fsoe_net.formats.own.answers import load_answers
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.own.scan import load_scan
from fsoe_net.formats.own.scan_bus import describe_scan
from fsoe_net.formats.recognise import find_format, head_of
from fsoe_net.formats.registry import Format, Yields, all_formats, read_foreign
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.answers import Answers
from fsoe_net.model.described_network import describe
from fsoe_net.model.description import Description
from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.scan import Scan

_MOST_FILES = 2000
_DEEPEST = 5
_SCAN = re.compile(rb'\s*\{\s*"scan"\s*:')
# An incomplete network is not an error here: this command completes it.
_LACKING = {"FSN125", "FSN223"}
# A driver stops at these; the SubDevice is known nevertheless.
_TOLERATED = {"FSN120"}
# Keys of a network that are not of its bus.
_NOT_OF_A_BUS = ("project", "report", "safety_functions")


@dataclass(slots=True)
class Gathered:
    """Data read from the files.

    Attributes:
        scans: Scans, by file; their SubDevices are also in ``buses``.
        buses: Descriptions whose SubDevices have a position in the ring.
        types: Descriptions of device types.
        esis: ESI files; only required devices are read.
        projects: Safety projects: connections without positions.
        part: Transfers whose modules no file declares.
        name: Name of the network, if a file states one.
        notes: Assumptions and omissions.
        out: Findings.
        used: Files with content, in the order given.
        answers: Answers of a person from a file.
    """

    scans: dict[str, Scan] = field(default_factory=dict)
    buses: list[Description] = field(default_factory=list)
    types: list[Description] = field(default_factory=list)
    esis: list[str] = field(default_factory=list)
    projects: list[Description] = field(default_factory=list)
    part: NetworkConfig | None = None
    name: str = ""
    notes: list[str] = field(default_factory=list)
    out: Collector = field(default_factory=Collector)
    used: list[str] = field(default_factory=list)
    answers: Answers = field(default_factory=Answers)


def gather(paths: Sequence[str], options: LoadOptions, *, answers: str | None = None) -> Gathered:
    """Read files and folders; unreadable files in a folder are skipped and reported.

    Args:
        paths: Files and folders.
        options: Options for following references in YAML and URDF.
        answers: File with answers missing in the other files; it may be in one of the folders.

    Raises:
        InputError: Files named by the user cannot be read; it contains all their errors.
    """
    found = Gathered()
    skipped = set()
    if answers is not None:
        given = load_answers(answers, found.out)
        if given is None:
            raise InputError(f"{answers} cannot be used", sort_diagnostics(found.out.diagnostics))
        found.answers = given
        # The answers are in the same folder as the files; they do not describe the bus.
        skipped.add(os.path.realpath(answers))
    named: list[tuple[str, bool]] = []
    for path in dict.fromkeys(paths):
        if os.path.isdir(path):
            inside = _files_in(path, found.out)
            named += [(f, True) for f in inside if os.path.realpath(f) not in skipped]
        else:
            named.append((path, False))
    # All files are read before errors end the command, so that the user can correct them together.
    yaml_files = []
    for path, in_folder in named:
        if not _read_other(path, in_folder, options, found):
            yaml_files.append((path, in_folder))
    # YAML files refer to each other and are read together at the end.
    _read_yaml(yaml_files, options, found)
    errors = [d for d in found.out.diagnostics if d.level is Severity.ERROR]
    if errors:
        raise InputError("nothing written", sort_diagnostics(errors))
    return found


def _read_other(path: str, in_folder: bool, options: LoadOptions, found: Gathered) -> bool:
    """Read a file of another format; return ``False`` for YAML of a network, which stays unread."""
    mine = Collector()
    # A file in a folder may be anything; a file that was named must be readable.
    head = head_of(path, mine)
    # Scans are JSON and would otherwise be taken for another format.
    if head is not None and _SCAN.match(head):
        _keep(found, path, mine, in_folder, _scan(path, mine, found))
        return True
    known = None if head is None else find_format(head, mine, name=path)
    if known is None:
        _keep(found, path, mine, in_folder, False)
    elif known.yields is Yields.NETWORK:
        return False
    elif known.yields is Yields.CATALOGUE:
        found.esis.append(path)
        found.used.append(path)
    else:
        read = read_foreign(path, known, mine, master=options.master)
        _keep(found, path, mine, in_folder, _sorted(read, known, found))
    return True


def _files_in(folder: str, out: Collector) -> list[str]:
    found: list[str] = []
    base = os.path.normpath(folder).count(os.sep)
    for place, folders, names in os.walk(folder):
        deep = os.path.normpath(place).count(os.sep) - base
        # A deep tree is probably a home folder given by mistake.
        folders[:] = sorted(f for f in folders if not f.startswith(".") and deep < _DEEPEST)
        found += [os.path.join(place, n) for n in sorted(names) if not n.startswith(".")]
        if len(found) > _MOST_FILES:
            raise InputError(f"{folder} holds more than {_MOST_FILES} files; name those of the bus")
    if not found:
        out.add(
            "FSN158", Span(folder), "the folder is empty", hint="name files that describe a bus"
        )
    return _without_parts(found)


# A part that is read separately would appear twice.
def _without_parts(files: list[str]) -> list[str]:
    """Leave out the parts of projects that are complete here, because these include them."""
    endings = {os.path.splitext(f)[1].lower() for f in files}
    parts: tuple[str, ...] = ()
    for found in all_formats().values():
        for whole, its_parts in found.parts.items():
            if whole in endings:
                parts += its_parts
    return [f for f in files if not f.lower().endswith(parts)] if parts else files


def _keep(found: Gathered, path: str, mine: Collector, in_folder: bool, good: bool) -> None:
    """Add the findings of a file; an unreadable file of a folder is only skipped.

    Errors of a file named by the user end `gather` after all files have been read.
    """
    errors = [d for d in mine.diagnostics if d.level is Severity.ERROR]
    if errors and in_folder:
        _left_out(found, path, errors[0])
        return
    found.out.diagnostics += mine.diagnostics
    if good and not errors:
        found.used.append(path)


def _left_out(found: Gathered, path: str, error: Diagnostic) -> None:
    place = f" ({error.span})" if error.span.line else ""
    found.out.add(
        "FSN158",
        Span(path),
        f"left out: {error.message}{place}",
        hint="name the file itself if it belongs to the bus",
    )


def _scan(path: str, mine: Collector, found: Gathered) -> bool:
    scan, damage = load_scan(path)
    mine.diagnostics += damage
    if scan is not None:
        found.scans[path] = scan
        found.buses.append(describe_scan(scan, path))
    return scan is not None


def _sorted(read: Description | None, known: Format, found: Gathered) -> bool:
    if read is None:
        return False
    if read.truncated or any(s.truncated for s in read.subdevices):
        found.notes.append(f"{read.path} is cut off: what is missing there is not guessed")
    if known.yields is Yields.CONNECTIONS:
        found.projects.append(read)
    # Descriptions without positions are types, even in a format that can describe a bus.
    elif known.yields is Yields.TYPES or read.placeless:
        found.types.append(read)
    else:
        found.buses.append(read)
    return True


# -- YAML and URDF --------------------------------------------------------------------------------


def _read_yaml(files: list[tuple[str, bool]], options: LoadOptions, found: Gathered) -> None:
    """Read the network or URDF with its transfers; then every unreferenced slave YAML."""
    kinds: dict[str, list[tuple[str, bool]]] = {}
    for path, in_folder in files:
        kinds.setdefault(_yaml_kind(path), []).append((path, in_folder))
    # Roots first: files that they refer to are not read a second time.
    roots = kinds.get("network", []) + kinds.get("robot", [])
    transfers = kinds.get("transfers", [])
    known: set[str] = set()
    for root in roots:
        known |= _read_root([root], transfers, options, found)
    rest = [t for t in transfers if os.path.realpath(t[0]) not in known]
    for row in rest:
        known |= _read_root([row], [], options, found)
    for path, in_folder in kinds.get("slave", []) + kinds.get("", []):
        if os.path.realpath(path) not in known:
            _read_root([(path, in_folder)], [], options, found)


def _yaml_kind(path: str) -> str:
    try:
        with open(path, "rb") as stream:
            text = stream.read(1 << 20)
    except OSError:
        return ""
    # XML may start with a byte order mark or blanks.
    if text.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        return "robot"
    for kind, key in (
        ("network", rb"subdevices"),
        ("transfers", rb"(?:nets|(?:safety|transfer)_modules)"),
        ("slave", rb"(?:vendor_id|rpdo|tpdo)"),
    ):
        if re.search(rb"^" + key + rb"[ \t]*:", text, re.MULTILINE):
            return kind
    return ""


def _read_root(
    files: list[tuple[str, bool]],
    transfers: list[tuple[str, bool]],
    options: LoadOptions,
    found: Gathered,
) -> set[str]:
    """Read one root file; return the real paths of all files that it includes."""
    path, in_folder = files[0]
    # A URDF names its own transfers; other given files are for a URDF that does not.
    loaded = load_network([path], options)
    if transfers and loaded.network is not None and not loaded.network.nets:
        loaded = load_network([path, *(t for t, _ in transfers)], options)
    mine = Collector()
    mine.diagnostics += [
        replace(d, severity=Severity.WARNING) if d.code in _TOLERATED else d
        # Findings about missing parts are expected, because `init` adds these.
        for d in loaded.diagnostics
        if d.code not in _LACKING
    ]
    network = loaded.network
    _keep(found, path, mine, in_folder, network is not None)
    if network is None:
        return set()
    brought = {os.path.realpath(s.path) for s in network.sources}
    if any(d.level is Severity.ERROR for d in mine.diagnostics):
        return set() if in_folder else brought
    try:
        _sort_network(network, path, found)
    except InputError as exc:
        if not in_folder:
            raise
        found.out.add("FSN158", Span(path), f"left out: {exc}", hint="fix it, or name the others")
    return brought


def _confirmed(network: NetworkConfig, out: Collector) -> NetworkConfig:
    """Return a network without its unconfirmed connections, which become open questions again.

    Raises:
        InputError: An unconfirmed connection has transfers, which contradicts that.
    """
    nets = []
    for net in network.nets:
        # An unconfirmed connection is a proposal: reading it as a fact would confirm it silently.
        kept = [c for c in net.connections if c.unconfirmed is None]
        for row in net.connections:
            if row.unconfirmed is None:
                continue
            pair = {row.main, row.sub}
            if any({t.source.module, t.destination.module} == pair for t in net.transfers):
                raise InputError(
                    f"{row.at('unconfirmed')}: {row.main}-{row.sub} is unconfirmed, and has "
                    "transfers; compare it with the safety project first"
                )
            out.add(
                "FSN159",
                row.at("unconfirmed"),
                f"the connection {row.main}-{row.sub} is unconfirmed there, so it is open here",
                hint="its slot, address, connection ID and watchdog go into connections: of the "
                "answers",
            )
        nets.append(replace(net, connections=tuple(kept)))
    return replace(network, nets=tuple(nets))


def _sort_network(network: NetworkConfig, path: str, found: Gathered) -> None:
    network = _confirmed(network, found.out)
    if network.partial and network.nets:
        declared = {s.name for s in network.subdevices}
        ends = {
            e.module for n in network.nets for t in n.transfers for e in (t.source, t.destination)
        }
        # All ends are declared: the partial file is a separate bus.
        if ends <= declared:
            found.buses.append(replace(describe(network), path=path))
        else:
            found.part = network
        return
    made = replace(describe(network), path=path)
    left = [key for key in _NOT_OF_A_BUS if network.fields.get(key)]
    if left:
        found.notes.append(f"{path}: left out: {listed(left)}; copy them into the new file")
    found.name = found.name or ("" if network.partial else network.name)
    if network.partial:
        found.types.append(made.without_positions())
    else:
        found.buses.append(made)
