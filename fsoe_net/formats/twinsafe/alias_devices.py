"""Safety project of TwinCAT 3: alias devices (``.sds``) with FSoE address, ID and watchdog.

An alias device has a number (``SDSID``) by which groups (``.sal``) and messages of the logic refer
to it. Other types are signals to and from the standard program. Function blocks and parameters are
not read.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.diag.words import counted
from fsoe_net.formats.shared.files import Collector, read_bytes, stem_of
from fsoe_net.formats.shared.limits import MAX_ALIAS_BYTES
from fsoe_net.formats.shared.source import xml_number
from fsoe_net.formats.shared.xml_text import readable_xml
from fsoe_net.formats.shared.xml_tree import Element, parse_xml, shown_name
from fsoe_net.model.bus import Device
from fsoe_net.model.description import DescribedConnection, DescribedSubDevice, Description

_KIND = "a TwinSAFE alias device"
_MOST_FILES = 1000
_ALIAS_FOLDER = "Alias Devices"
_SYSTEM = "TargetSystemConfig.xml"
_ORDER = re.compile(r"\b([A-Z]{2,3}\d{3,4}(?:-\d{4})*)\b")


@dataclass(frozen=True, slots=True, kw_only=True)
class Alias:
    """An alias device: one FSoE connection, or signals of the standard program.

    ``connection`` is ``None`` for signals. ``is_sub``: the logic is its SubInstance.
    """

    number: int
    name: str
    span: Span
    connection: DescribedConnection | None = None
    is_sub: bool = False
    module_ident: int | None = None

    @property
    def device(self) -> str:
        """Name of the box that it was created from, if its name contains it."""
        return self.name.partition(" - Module")[0]

    @property
    def order(self) -> str:
        """Order number in its name, or an empty string."""
        found = _ORDER.search(self.name)
        return "" if found is None else found[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyProject:
    """Alias devices by number, and the logic that they belong to, if the project names it."""

    path: str
    aliases: Mapping[int, Alias]
    logic_name: str = ""
    logic_order: str = ""
    logic_address: int | None = None


def read_safety_project(
    text: str, folder: str, named_at: Span, out: Collector
) -> SafetyProject | None:
    """Read the safety project that a TwinCAT project names, but only below its own folder.

    Args:
        text: Path in the project, with backslashes.
        folder: Folder of the project.
        named_at: Place of the reference.
        out: Takes FSN147 if it is missing.
    """
    parts = text.replace("\\", "/").split("/")
    plain = os.path.isfile(named_at.file) and all(
        p not in ("", ".", "..") and ":" not in p for p in parts
    )
    path = os.path.join(folder, *parts)
    if not plain or not os.path.isfile(path):
        out.add(
            "FSN147",
            named_at,
            f"the safety project {text[:80]!r} is not here, so FSoE addresses, connection IDs and "
            "watchdogs are not known",
            severity=Severity.WARNING,
            hint="give the folder of the TwinCAT project whole",
        )
        return None
    return read_project_folder(os.path.dirname(path), path, out)


def read_project_folder(folder: str, shown: str, out: Collector) -> SafetyProject:
    """Read all alias devices of the groups of a safety project."""
    files = []
    try:
        groups = sorted(e.name for e in os.scandir(folder) if e.is_dir(follow_symlinks=False))
    except OSError:
        groups = []
    for group in groups[:_MOST_FILES]:
        files += _sds_files(os.path.join(folder, group, _ALIAS_FOLDER))
    return _project(files, folder, shown, out)


def read_group(path: str, out: Collector) -> SafetyProject:
    """Read the alias devices of a group, stored next to its ``.sal``."""
    folder = os.path.dirname(path)
    files = _sds_files(os.path.join(folder, _ALIAS_FOLDER))
    return _project(files, os.path.dirname(folder) or ".", path, out)


def _sds_files(folder: str) -> list[str]:
    try:
        # Links could lead outside the project.
        rows = [e for e in os.scandir(folder) if e.is_file(follow_symlinks=False)]
    except OSError:
        return []
    names = sorted(e.name for e in rows if e.name.lower().endswith(".sds"))
    return [os.path.join(folder, name) for name in names]


def _project(files: Sequence[str], folder: str, shown: str, out: Collector) -> SafetyProject:
    if len(files) > _MOST_FILES:
        out.add(
            "FSN147",
            Span(shown, 1, 1),
            f"{counted(len(files), 'alias device')}; the first {_MOST_FILES} are read",
            hint="give the project of one logic",
        )
    aliases: dict[int, Alias] = {}
    for file in files[:_MOST_FILES]:
        data = read_bytes(file, out, most=MAX_ALIAS_BYTES)
        alias = None if data is None else read_alias(data, file, out)
        if alias is None:
            continue
        first = aliases.setdefault(alias.number, alias)
        if first is not alias:
            out.add(
                "FSN141",
                alias.span,
                f"SDSID {alias.number} is that of {os.path.basename(first.span.file)!r}, too",
                hint="correct the safety project in TwinCAT",
            )
    system = _system(os.path.join(folder, _SYSTEM), out)
    name = "" if system is None else system.text_of("TargetSystemObjectName")
    order = "" if system is None else system.text_of("TargetSystemSubType")
    address = None
    if system is not None:
        address = xml_number(system.first("FSOEAddress"), out, high=0xFFFF)
    return SafetyProject(
        path=shown, aliases=aliases, logic_name=name, logic_order=order, logic_address=address
    )


def _system(path: str, out: Collector) -> Element | None:
    if not os.path.isfile(path):
        return None
    data = read_bytes(path, out, most=MAX_ALIAS_BYTES)
    return None if data is None else _parse(data, path, out)


def _parse(data: bytes, shown: str, out: Collector) -> Element | None:
    return parse_xml(readable_xml(data, shown, out), shown, out, what=_KIND)


def read_alias(data: bytes, shown: str, out: Collector) -> Alias | None:
    """Read one alias device.

    Args:
        data: The file.
        shown: Its path; the name of the device is that of the file.
        out: Takes FSN118, FSN140 and FSN141.
    """
    root = _parse(data, shown, out)
    if root is None:
        return None
    number = xml_number(root.first("SDSID"), out, high=0xFFFF)
    if root.name != "SafetyDeviceDesc" or number is None:
        if root.first("SDSID") is None:
            out.add("FSN140", root.span, f"this is not {_KIND}", hint="give an .sds of a group")
        return None
    name = shown_name(stem_of(shown))
    safe = root.first("SafetyAliasDevice")
    if safe is None:
        return Alias(number=number, name=name, span=root.span)
    kind = safe.text_of("ConnectionType")
    if kind not in ("", "FSoE"):
        out.add(
            "FSN147",
            safe.span,
            f"alias device {name[:60]!r} has a connection of type {kind[:40]!r}, which is not read",
            hint="only connections of FSoE are moved by this network",
        )
        return Alias(number=number, name=name, span=root.span)
    values: dict[str, int | None] = {}
    for key in ("SafeAddress", "ConnectionId", "Watchdog"):
        if safe.first(key) is None:
            out.add(
                "FSN141",
                safe.span,
                f"alias device {name[:60]!r} has no {key}",
                hint="open the safety project in TwinCAT and save it again",
            )
        values[key] = xml_number(safe.first(key), out, high=0xFFFF)
    about = root.first("AliasDeviceType")
    ident = None if about is None else xml_number(about.first("SubType"), out)
    connection = DescribedConnection(
        span=safe.span,
        # Uses the names of TwinCAT 2, under which findings look them up.
        fields={
            key: child.value_span
            for key, name in (
                ("SAddress", "SafeAddress"),
                ("ConId", "ConnectionId"),
                ("SWatchdog", "Watchdog"),
            )
            if (child := safe.first(name)) is not None
        },
        name=name,
        address=values["SafeAddress"],
        connection_id=values["ConnectionId"],
        watchdog_ms=values["Watchdog"],
    )
    return Alias(
        number=number,
        name=name,
        span=safe.span,
        connection=connection,
        is_sub=safe.text_of("ConnectionMode").lower() == "slave",
        module_ident=ident,
    )


def describe_project(project: SafetyProject) -> Description:
    """Return a safety project without a ring: the logic, then a type for each connection."""
    logic = DescribedSubDevice(
        span=Span(project.path, 1, 1),
        name=project.logic_name or "logic",
        order=project.logic_order,
        device=Device(path=project.path, vendor_id=0, product_code=0),
        notes=(
            *(
                (f"FSoE address {project.logic_address}",)
                if project.logic_address is not None
                else ()
            ),
            "function blocks, groups and parameters of the safety project are not read",
        ),
    )
    subs, connections = [logic], []
    for _, alias in sorted(project.aliases.items()):
        if alias.connection is None:
            continue
        number = len(subs)
        subs.append(
            DescribedSubDevice(
                span=alias.span,
                name=alias.device,
                order=alias.order,
                device=Device(path=alias.span.file, vendor_id=0, product_code=0),
                module_ident=() if alias.module_ident is None else (alias.module_ident,),
            )
        )
        main, sub = (number, 0) if alias.is_sub else (0, number)
        connections.append(replace(alias.connection, main=main, sub=sub))
    return Description(
        span=logic.span,
        format="twinsafe",
        path=project.path,
        subdevices=tuple(subs),
        connections=tuple(connections),
    )
