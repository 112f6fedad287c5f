"""TwinCAT 3 project (``.tsproj``) or a part of it (``.xti``): the boxes of an EtherCAT master.

Names form a tree, and links between variables name them from its top:
``TIID^Device 1 (EtherCAT)^Term 1 (EK1200)^Term 5 (EL6910)^ConnectionInputs^Message_7 TxPDO``.
A link with ``TIID`` at both ends is a copy. ``Message_7`` is the alias device 7 of the safety
project in a folder next to it. Boxes are listed in the order of the ring.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import field, replace

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Severity
from fsoe_net.diag.words import counted, listed
from fsoe_net.formats.recognise import is_format
from fsoe_net.formats.shared.files import Collector, read_bytes, stem_of
from fsoe_net.formats.shared.limits import MAX_PROJECT_BYTES
from fsoe_net.formats.shared.ring import MOST_SUBDEVICES
from fsoe_net.formats.shared.source import Source, esi_number, source_bytes
from fsoe_net.formats.shared.xml_text import readable_xml
from fsoe_net.formats.shared.xml_tree import Element, parse_xml, shown_name
from fsoe_net.formats.twincat.box import Box, read_box
from fsoe_net.formats.twincat.links import read_links
from fsoe_net.formats.twinsafe.alias_devices import SafetyProject, read_safety_project
from fsoe_net.model.description import Description

_KIND = "a TwinCAT project"
_MOST_FILES = 10_000
_DEEPEST = 40
_SKIP = frozenset(
    {"ImageDatas", "Plc", "Motion", "System", "Cpp", "Analytics", "Xml", "TmcDesc", "CanOpen"}
)
_FILE_NAME = "__FILENAME__"  # in place of the name of a part of a project


def load_twincat(
    source: Source, out: Collector, *, name: str = "<tsproj>", master: str = ""
) -> Description | None:
    """Read the EtherCAT part of a project, with a safety project next to it.

    Args:
        source: Path, or the bytes of the file.
        out: Takes findings, located: FSN140, FSN141, FSN143, FSN145, FSN147, FSN148.
        name: Path of the bytes, from which parts and the safety project are found.
        master: Name of the master to read; by default the first that has a safety logic.

    Returns:
        SubDevices of one master, copies and FSoE connections; ``None`` without any.
    """
    data, shown = source_bytes(source, out, name, most=MAX_PROJECT_BYTES)
    if data is None or not is_format(data, "twincat", shown, out):
        return None
    root = _parse(data, shown, out)
    return None if root is None else _Project(root, shown, out).read(master)


def _parse(data: bytes, shown: str, out: Collector) -> Element | None:
    return parse_xml(readable_xml(data, shown, out), shown, out, what=_KIND, skip=_SKIP)


@dataclass(slots=True)
class _Master:
    """An EtherCAT master of the project with its boxes in the order of the ring."""

    name: str
    element: Element
    rows: list[tuple[Element, tuple[str, ...], str]] = field(default_factory=list)

    @property
    def is_safe(self) -> bool:
        """Whether a box here has messages of a safety logic."""
        return any(
            (kind := entry.first("Type")) is not None and kind.text.strip().startswith("FSOE_")
            for element, _, _ in self.rows
            for pdo in (element.first("EtherCAT") or element).all("Pdo")
            for entry in pdo.all("Entry")
        )


class _Project:
    def __init__(self, root: Element, shown: str, out: Collector) -> None:
        self._root, self._shown, self._out = root, shown, out
        self._files = 0
        self._bytes = 0
        self._is_refused = False
        self._types: dict[tuple[str, str], int] = {}
        self._left_out: list[str] = []
        self._add_types(root)

    def read(self, name: str) -> Description | None:
        """Return the data of one master."""
        masters = list(self._masters())
        if self._is_refused:
            return None
        usable = [m for m in masters if m.rows]
        if not usable:
            self._out.add(
                "FSN140",
                self._root.span,
                "this project has no EtherCAT master with SubDevices",
                hint="give the .tsproj, or the .xti of the EtherCAT master",
            )
            return None
        master = self._choose(usable, name)
        if master is None:
            return None
        boxes = [
            read_box(element, path, position, self._types, shown, self._out)
            for position, (element, path, shown) in enumerate(master.rows)
        ]
        safety = self._safety(boxes)
        links = read_links(self._root, boxes, safety, self._out)
        self._say_what_is_not_read(boxes, master)
        return Description(
            span=self._root.span,
            format="twincat",
            path=self._shown,
            subdevices=tuple(
                replace(b.described, notes=(*b.described.notes, *links.notes.get(n, ())))
                for n, b in enumerate(boxes)
            ),
            copies=links.copies,
            connections=links.connections,
            cycle_us=None,
        )

    def _choose(self, masters: list[_Master], name: str) -> _Master | None:
        """Return the requested master, or the first with a safety logic."""
        names = [m.name[:60] for m in masters]
        if name:
            chosen = next((m for m in masters if m.name == name), None)
            if chosen is None:
                hint = f"choose one with --master: {listed([repr(n) for n in names])}"
                message = f"this project has no EtherCAT master {name!r} with SubDevices"
                self._out.add("FSN140", self._root.span, message, hint=hint)
            return chosen
        chosen = next((m for m in masters if m.is_safe), masters[0])
        others = [m.name[:60] for m in masters if m is not chosen]
        if others:
            self._out.add(
                "FSN147",
                chosen.element.span,
                f"this project has {len(masters)} EtherCAT masters; {chosen.name[:60]} is read, "
                f"{listed(others)} not",
                hint=f"--master {others[0]!r} reads another one",
            )
        return chosen

    def _add_types(self, root: Element) -> None:
        listed = root.first("DataTypes")
        for element in listed.all("DataType") if listed is not None else ():
            name, bits = element.first("Name"), element.first("BitSize")
            number = None if bits is None else esi_number(bits.text)
            if name is not None and number is not None and number > 0:
                # Libraries have different types with the same name; the GUID distinguishes them.
                key = (name.text.strip(), name.attributes.get("GUID", ""))
                self._types[key] = number

    # -- the tree ---------------------------------------------------------------------------------

    def _masters(self) -> Iterator[_Master]:
        project = self._root.first("Project")
        io = None if project is None else project.first("Io")
        # An .xti is a part of a project: devices, or a single box, are directly in its root.
        parts = [self._root] if io is None else [io]
        for part in parts:
            for device in part.all("Device"):
                element, shown = self._whole(device, self._shown, ())
                if element is None:
                    continue
                if _is_disabled(device) or _is_disabled(element):
                    self._left_out.append(f"{_name_of(element, shown)[:60]} (disabled)")
                    continue
                if element.first("EtherCAT") is not None:
                    name = _name_of(element, shown)
                    master = _Master(name=name, element=element)
                    self._walk(element, (name,), shown, master, 0)
                    yield master
            if part is self._root and part.first("Box") is not None:
                master = _Master(name="", element=part)
                self._walk(part, (), self._shown, master, 0)
                yield master

    def _walk(
        self, parent: Element, path: tuple[str, ...], shown: str, master: _Master, depth: int
    ) -> None:
        boxes = parent.all("Box")
        if boxes and depth > _DEEPEST:
            self._refuse(boxes[0], f"boxes nested deeper than {_DEEPEST} levels")
            return
        for child in boxes:
            # One more than the limit is kept, so that the limit is reported.
            if len(master.rows) > MOST_SUBDEVICES or self._is_refused:
                return
            element, file = self._whole(child, shown, path)
            if element is None:
                continue
            own = (*path, _name_of(element, file))
            if _is_disabled(child) or _is_disabled(element):
                self._left_out.append(f"{own[-1][:60]} (disabled)")
                continue
            if _is_subdevice(element):
                master.rows.append((element, own, file))
            self._walk(element, own, file, master, depth + 1)

    def _whole(
        self, element: Element, shown: str, path: tuple[str, ...]
    ) -> tuple[Element | None, str]:
        """Return the element, from a separate file if it names one.

        Other content at this place describes the connection.
        """
        file = element.attributes.get("File")
        if file is None:
            return element, shown
        root = self._part(file, element, shown, path)
        inner = None if root is None else root.first(element.name)
        return inner, os.path.join(os.path.dirname(shown), file) if root is None else root.span.file

    def _part(
        self, file: str, element: Element, shown: str, path: tuple[str, ...]
    ) -> Element | None:
        """Read a part of the project, but only from the folders that TwinCAT uses."""
        self._files += 1
        if self._files > _MOST_FILES:
            self._refuse(element, f"more than {_MOST_FILES} files")
            return None
        base = os.path.basename(file)
        folder = os.path.dirname(shown)
        stem = stem_of(shown)
        places = [
            os.path.join(folder, "_Config", "IO", base),
            os.path.join(folder, "_Config", "IO", *path[:1], base),
            os.path.join(folder, stem, base),
            os.path.join(folder, base),
        ]
        # The project may come from anywhere: only a bare name is followed, never a path.
        plain = (
            os.path.isfile(shown)
            and file == base
            and "\\" not in file
            and ":" not in file
            and base not in ("", "..")
        )
        found = next((p for p in places if plain and os.path.isfile(p)), None)
        if found is None:
            self._out.add(
                "FSN147",
                element.span,
                f"a part of this project is in the file {file[:80]!r}, which is not read",
                hint="give the folder of the project whole, with its _Config/IO",
            )
            return None
        # One limit for all files of a project together.
        data = read_bytes(found, self._out, most=MAX_PROJECT_BYTES - self._bytes)
        self._bytes += len(data or b"")
        root = None if data is None else _parse(data, found, self._out)
        if root is not None:
            self._add_types(root)
        return root

    def _refuse(self, element: Element, why: str) -> None:
        if not self._is_refused:
            hint = "look for a file that names itself"
            self._out.add("FSN103", element.span, f"{why} in this project", hint=hint)
        self._is_refused = True

    # -- the rest ---------------------------------------------------------------------------------

    def _safety(self, boxes: list[Box]) -> SafetyProject | None:
        """Return the safety project of the TwinCAT project; ``None`` if missing or not needed."""
        if not any(b.messages for b in boxes):
            return None
        project = self._root.first("Project")
        safety = None if project is None else project.first("Safety")
        listed = [] if safety is None else safety.all("Project")
        if not listed:
            return None
        if len(listed) > 1:
            self._out.add(
                "FSN147",
                listed[1].span,
                f"this project has {len(listed)} safety projects; the first one is read",
                severity=Severity.INFO,
                hint="give the .splcproj of another one as a file of its own",
            )
        text = listed[0].attributes.get("PrjFilePath", "")
        return read_safety_project(text, os.path.dirname(self._shown), listed[0].span, self._out)

    def _say_what_is_not_read(self, boxes: list[Box], master: _Master) -> None:
        count: dict[str, int] = {}
        for box in boxes:
            for what in box.unread:
                count[what] = count.get(what, 0) + 1
        parts = [f"{what} of {counted(n, 'SubDevice')}" for what, n in sorted(count.items())]
        if self._left_out:
            names = ", ".join(self._left_out[:6])
            parts.append(names + (" and more" if len(self._left_out) > 6 else ""))
        if parts:
            self._out.add(
                "FSN147",
                master.element.span,
                f"not read: {'; '.join(parts)}",
                severity=Severity.INFO,
                hint="an ENI that TwinCAT exports has the start-up commands",
            )


def _name_of(element: Element, shown: str) -> str:
    name = element.first("Name")
    text = "" if name is None else name.words
    stem = stem_of(shown)
    return shown_name(stem) if text in ("", _FILE_NAME) else text


def _is_disabled(element: Element) -> bool:
    return element.attributes.get("Disabled", "").lower() in ("true", "1")


def _is_subdevice(element: Element) -> bool:
    """Whether a box has an EtherCAT controller: end terminals and K-bus terminals have none."""
    own = element.first("EtherCAT")
    return own is not None and ("PdiType" in own.attributes or own.first("SyncMan") is not None)
