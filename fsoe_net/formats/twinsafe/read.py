"""Safety projects: ``TwinSAFE-Project.xml`` as exported by TwinCAT 2, and those of TwinCAT 3.

Root ``Project``: ``SAddress`` is the address of the logic, each ``Connection`` has ``SAddress``,
``ConId``, ``SWatchdog`` (milliseconds), ``SafeUserPara`` and ``ModuleIdent``. Names are in the
language of the editor and are not evaluated. TwinCAT 3 has a folder with a ``.splcproj``, groups
(``.sal``) and alias devices (``.sds``).
"""

from __future__ import annotations

import os
import re

from fsoe_net.formats.recognise import is_format
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import Source, source_bytes, xml_number
from fsoe_net.formats.shared.xml_text import readable_xml
from fsoe_net.formats.shared.xml_tree import Element, parse_xml
from fsoe_net.formats.twinsafe.alias_devices import (
    SafetyProject,
    describe_project,
    read_alias,
    read_group,
    read_project_folder,
)
from fsoe_net.model.bus import Device
from fsoe_net.model.description import DescribedConnection, DescribedSubDevice, Description

_ORDER = re.compile(r"\(([A-Z]{2,3}\d{3,4}(?:-[\w-]{1,12})?)\)")


def load_twinsafe(source: Source, out: Collector, *, name: str = "<xml>") -> Description | None:
    """Read a safety project of TwinCAT 2 or 3.

    Args:
        source: Path, or the bytes.
        out: Takes findings, located.
        name: Path of the bytes, from which the alias devices of TwinCAT 3 are found.

    Returns:
        The logic, then one SubDevice type for each connection, in the order of the file.
    """
    data, shown = source_bytes(source, out, name)
    if data is None or not is_format(data, "twinsafe", shown, out):
        return None

    def closed(element: Element, parent: Element, depth: int) -> bool:
        # There are many function blocks and links, which contain nothing about connections.
        return depth == 1 and element.name in ("Groups", "Links")

    root = parse_xml(
        readable_xml(data, shown, out), shown, out, closed=closed, what="a TwinSAFE project export"
    )
    if root is None:
        return None
    third = _of_twincat_3(root, data, shown, out)
    if third is not None:
        return describe_project(third) if third.aliases else None
    listed = root.first("Connections")
    if root.name != "Project" or listed is None:
        out.add(
            "FSN140",
            root.span,
            f"this XML with the root <{root.name[:40]}> has no TwinSAFE connections",
            hint="export the project from the TwinSAFE editor of TwinCAT 2 as XML",
        )
        return None
    logic = DescribedSubDevice(
        span=root.span,
        name="logic",
        device=Device(path=shown, vendor_id=0, product_code=0),
        notes=(f"FSoE address {xml_number(root.first('SAddress'), out, high=0xFFFF)}",),
    )
    subs, connections = [logic], []
    for slot, element in enumerate(listed.all("Connection")):
        subs.append(_sub(element, shown, out))
        connections.append(_connection(element, slot, len(subs) - 1, out))
    return Description(
        span=root.span,
        format="twinsafe",
        path=shown,
        subdevices=tuple(subs),
        connections=tuple(connections),
    )


def _of_twincat_3(root: Element, data: bytes, shown: str, out: Collector) -> SafetyProject | None:
    """Return the project that a file of TwinCAT 3 belongs to; ``None`` for files of TwinCAT 2."""
    if root.name == "SafetyDeviceDesc":
        alias = read_alias(data, shown, out)
        found = {} if alias is None or alias.connection is None else {alias.number: alias}
        project = SafetyProject(path=shown, aliases=found)
    elif root.name == "safetyApplication" and os.path.isfile(shown):
        project = read_group(shown, out)
    elif root.name == "safetyApplication":
        project = SafetyProject(path=shown, aliases={})
    elif (
        root.name == "Project"
        and os.path.isfile(shown)
        and any(e.name == "TargetSystem" for e in root.walk())
    ):
        project = read_project_folder(os.path.dirname(shown) or ".", shown, out)
    else:
        return None
    if not any(a.connection for a in project.aliases.values()):
        out.add(
            "FSN140",
            root.span,
            "no alias device with an FSoE connection is here",
            hint="give the folder of the safety project whole: its groups have Alias Devices",
        )
        return SafetyProject(path=shown, aliases={})
    return project


def _sub(element: Element, shown: str, out: Collector) -> DescribedSubDevice:
    name = element.text_of("Name")
    order = _ORDER.search(name)
    ident = xml_number(element.first("ModuleIdent"), out)
    return DescribedSubDevice(
        span=element.span,
        name=name,
        order="" if order is None else order[1],
        device=Device(
            path=shown, vendor_id=xml_number(element.first("VendorId"), out) or 0, product_code=0
        ),
        module_ident=() if ident is None else (ident,),
        notes=("this export has no ring positions and no product code",),
    )


def _connection(element: Element, slot: int, number: int, out: Collector) -> DescribedConnection:
    values: dict[str, int | None] = {}
    for name in ("SAddress", "ConId", "SWatchdog"):
        if element.first(name) is None:
            out.add(
                "FSN141",
                element.span,
                f"connection {element.text_of('Name')!r} without {name}",
                hint="export the project again",
            )
        values[name] = xml_number(element.first(name), out, high=0xFFFF)
    mode = element.text_of("Mode").lower()
    main, sub = (number, 0) if mode == "slave" else (0, number)
    return DescribedConnection(
        span=element.span,
        fields={c.name: c.value_span for c in element.children},
        name=element.text_of("Name"),
        main=main,
        sub=sub,
        address=values["SAddress"],
        connection_id=values["ConId"],
        watchdog_ms=values["SWatchdog"],
        app_parameters=_parameters(element, out),
        slot=slot,
    )


def _parameters(element: Element, out: Collector) -> bytes:
    """Return ``SafeUserPara``; its ``Size`` in bytes must be that of its data."""
    holder = element.first("SafeUserPara")
    data = None if holder is None else holder.first("Data")
    if holder is None or data is None:
        return b""
    size = xml_number(holder.first("Size"), out, high=0xFFFF)
    try:
        found = bytes.fromhex(data.text)
    except ValueError:
        found = None
    if found is None or (size is not None and size != len(found)):
        what = "no hexadecimal data" if found is None else f"{len(found)} bytes, not {size}"
        out.add("FSN141", data.value_span, f"the parameters are {what}", hint="export it again")
        return b""
    return found
