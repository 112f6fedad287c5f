"""URDF and xacro: ``ros2_control`` blocks with driver parameters and ``ec_module`` tags."""

from __future__ import annotations

import os
from dataclasses import dataclass

from fsoe_net.diag.diagnostic import Diagnostic, Related
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.recognise import refuse_known
from fsoe_net.formats.ros2.urdf_params import DRIVER_PLUGIN, known_plugin_findings
from fsoe_net.formats.ros2.urdf_system import (
    COMPONENTS,
    DriverSystem,
    ModuleDecl,
    plugin_of,
    read_system,
)
from fsoe_net.formats.ros2.xacro_expand import expand_xacro, uses_xacro
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.xml_tree import Element, parse_xml
from fsoe_net.model.network import SourceFile

__all__ = ["DriverSystem", "ModuleDecl", "UrdfResult", "known_plugin_findings", "load_urdf"]

_DRIVER_PREFIX = "ethercat_driver/"


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfResult:
    """What a URDF says about EtherCAT, what is wrong in it, and the files that were read."""

    systems: tuple[DriverSystem, ...]
    diagnostics: tuple[Diagnostic, ...]
    sources: tuple[SourceFile, ...]


def load_urdf(path: str | os.PathLike[str], options: LoadOptions | None = None) -> UrdfResult:
    """Read a URDF or xacro file. Never raises for anything in the file or the file system.

    Args:
        path: The file; expanded only when it uses xacro.
        options: How references in it are followed.
    """
    out = Collector()
    systems: list[DriverSystem] = []
    root = _document(os.fspath(path), out, options or LoadOptions())
    if root is not None:
        blocks = [e for e in root.all("ros2_control") if _is_ethercat(e)]
        if not blocks:
            out.add(
                "FSN125",
                root.span,
                "no ros2_control block with an EtherCAT driver or an ec_module",
                hint=f"the driver's plugin is {DRIVER_PLUGIN}",
            )
        _component_names(blocks, out)
        systems = [read_system(block, out) for block in blocks]
    return UrdfResult(
        systems=tuple(systems), diagnostics=tuple(out.diagnostics), sources=tuple(out.sources)
    )


def _document(path: str, out: Collector, options: LoadOptions) -> Element | None:
    data = read_bytes(path, out)
    root = parse_xml(data, path, out) if data is not None else None
    if data is None or root is None:
        return None
    if root.name != "robot":
        if not refuse_known(data, root.span, "a URDF or xacro", out):
            out.add("FSN117", root.span, "not a URDF", hint="name the robot's URDF or xacro")
        return None
    if uses_xacro(root):
        return expand_xacro(path, out, options)
    return root


def _is_ethercat(block: Element) -> bool:
    plugin = plugin_of(block)
    driver = plugin is not None and plugin.text.strip().startswith(_DRIVER_PREFIX)
    return driver or any(e.name == "ec_module" for e in block.walk())


def _component_names(blocks: list[Element], out: Collector) -> None:
    """FSN128: the driver looks components up by kind and name, in all blocks of the file."""
    seen: dict[tuple[str, str], tuple[Element, Element]] = {}
    for block in blocks:
        for component in (c for c in block.children if c.name in COMPONENTS):
            name = component.attributes.get("name")
            if name is None:
                message = f"{component.name} without a name; the driver stops on it"
                out.add("FSN110", component.span, message, hint='add name="…"')
                continue
            owner, first = seen.setdefault((component.name, name), (block, component))
            if first is component:
                continue
            what = (
                "stands twice in this ros2_control block; the driver adds the modules of both twice"
                if owner is block
                else "also stands in another ros2_control block; the driver gives the modules of "
                "both to both"
            )
            out.add(
                "FSN128",
                component.span,
                f"{component.name} {name!r} {what}",
                hint="give each component a name of its own",
                related=(Related(span=first.span, message="the other one"),),
            )
