"""URDF and xacro: ``ros2_control`` blocks with driver parameters and ``ec_module`` tags."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Diagnostic, Related, Severity, Span
from fsoe_net.diag.words import listed
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.recognise import refuse_known
from fsoe_net.formats.ros2.urdf_params import DRIVER_PLUGIN
from fsoe_net.formats.ros2.urdf_system import (
    COMPONENTS,
    DriverSystem,
    plugin_of,
    read_system,
    robot_component,
)
from fsoe_net.formats.ros2.xacro_expand import expand_xacro, uses_xacro
from fsoe_net.formats.ros2.xacro_macros import (
    callable_macros,
    callers_of,
    macros_of,
    name_of,
    required_parameters,
)
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.xml_tree import Element, parse_xml
from fsoe_net.model.bus import RobotComponent
from fsoe_net.model.network import SourceFile

_DRIVER_PREFIX = "ethercat_driver/"


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfResult:
    """The EtherCAT content of a URDF, its findings, and the files that were read.

    ``components`` are those of all ``ros2_control`` blocks; ``is_closed``: all blocks belong to the
    EtherCAT driver.
    """

    systems: tuple[DriverSystem, ...]
    components: tuple[RobotComponent, ...]
    is_closed: bool
    diagnostics: tuple[Diagnostic, ...]
    sources: tuple[SourceFile, ...]


def load_urdf(path: str | os.PathLike[str], options: LoadOptions | None = None) -> UrdfResult:
    """Read a URDF or xacro file. Never raises for the content of files or for the file system.

    Args:
        path: The file; expanded only if it uses xacro.
        options: Options for following references.
    """
    out = Collector()
    systems: list[DriverSystem] = []
    all_blocks: list[Element] = []
    blocks: list[Element] = []
    joints: dict[str, Element] = {}
    written = _written(os.fspath(path), out)
    root = written
    if written is not None and uses_xacro(written):
        root = _expanded(os.fspath(path), written, out, options or LoadOptions())
    if written is not None and root is not None:
        all_blocks = list(root.all("ros2_control"))
        blocks = _own_blocks(all_blocks, out)
        if not blocks:
            _without_driver(os.fspath(path), written, out)
        joints = {e.attributes.get("name", ""): e for e in root.all("joint")}
        systems = _with_master_numbers([read_system(block, out, joints) for block in blocks])
    return UrdfResult(
        systems=tuple(systems),
        components=tuple(
            robot_component(e, joints)
            for b in all_blocks
            for e in b.children
            if e.name in COMPONENTS
        ),
        is_closed=len(blocks) == len(all_blocks),
        diagnostics=tuple(out.diagnostics),
        sources=tuple(out.sources),
    )


def _own_blocks(all_blocks: list[Element], out: Collector) -> list[Element]:
    """Return the blocks of the EtherCAT driver, checked together with the others."""
    blocks = [block for block in all_blocks if _is_ethercat(block)]
    _component_names(blocks, out)
    _offered_twice(blocks, [block for block in all_blocks if not _is_ethercat(block)], out)
    _modules_outside(blocks, out)
    return blocks


def _written(path: str, out: Collector) -> Element | None:
    """Return the document as written, before xacro."""
    data = read_bytes(path, out)
    root = parse_xml(data, path, out) if data is not None else None
    if data is None or root is None:
        return None
    if root.name != "robot":
        if not refuse_known(data, root.span, "a URDF or xacro", out):
            out.add("FSN117", root.span, "not a URDF", hint="name the robot's URDF or xacro")
        return None
    return root


def _expanded(path: str, written: Element, out: Collector, options: LoadOptions) -> Element | None:
    """Expand a file; if it only defines macros of the driver, with each called once."""
    root = expand_xacro(path, out, options)
    if root is None or any(map(_is_ethercat, root.all("ros2_control"))):
        return root
    macros = macros_of(written)
    names = callable_macros(macros)
    if not names:
        return root
    called = expand_xacro(path, out, options, calls=names)
    if called is not None and any(map(_is_ethercat, called.all("ros2_control"))):
        out.add(
            "FSN125",
            next(m.span for m in macros if name_of(m) in names),
            f"this file calls {_macros(names)} nowhere; checked with the default of each parameter",
            severity=Severity.INFO,
            hint=_caller(path, names),
        )
    return called


def _without_driver(path: str, written: Element, out: Collector) -> None:
    """FSN125: no block of the driver, possibly because the macro with it is not called."""
    unused = macros_of(written)
    if not unused:
        out.add(
            "FSN125",
            written.span,
            "no ros2_control block with an EtherCAT driver or an ec_module",
            hint=f"the driver's plugin is {DRIVER_PLUGIN}",
        )
        return
    names = [name_of(m) for m in unused]
    required = dict.fromkeys(name for m in unused for name in required_parameters(m))
    without = f"; these parameters have no default: {listed([*required], 4)}" if required else ""
    out.add(
        "FSN125",
        unused[0].span,
        f"the driver is in {_macros(names)}, which this file defines and does not call{without}",
        hint=_caller(path, names),
    )


def _macros(names: Sequence[str]) -> str:
    return f"the macro{'s' * (len(names) > 1)} {listed([f'<xacro:{n}>' for n in names], 4)}"


def _caller(path: str, names: Sequence[str]) -> str:
    callers = callers_of(path, names)
    if callers:
        return f"name the file that calls it: {listed(callers, 3)}"
    return "name the xacro that includes this file and calls it"


def _is_ethercat(block: Element) -> bool:
    plugin = plugin_of(block)
    driver = plugin is not None and plugin.text.strip().startswith(_DRIVER_PREFIX)
    return driver or any(e.name == "ec_module" for e in block.walk())


def _with_master_numbers(systems: list[DriverSystem]) -> list[DriverSystem]:
    """Give each named master a number that no other master has."""
    used = {s.master_id for s in systems}
    free = (n for n in itertools.count() if n not in used)
    named = {name: next(free) for name in dict.fromkeys(s.master_name for s in systems) if name}
    return [replace(s, master_id=named[s.master_name]) if s.master_name else s for s in systems]


def _modules_outside(blocks: list[Element], out: Collector) -> None:
    """FSN168: the driver searches for modules only in joints, gpios and sensors."""
    for element in (e for block in blocks for e in _outside(block)):
        name = element.attributes.get("name", "")
        out.add(
            "FSN168",
            element.span,
            f"ec_module {name!r} is in no joint, gpio or sensor: the driver does not read "
            "it, and the SubDevice is not configured",
            hint="move it into the joint, gpio or sensor whose interfaces it serves",
        )


def _outside(parent: Element, depth: int = 0) -> Iterator[Element]:
    """Yield the modules below a block that are not directly in one of its components."""
    inside = depth == 1 and parent.name in COMPONENTS
    for child in parent.children:
        if child.name == "ec_module" and not inside:
            yield child
        if depth or child.name != "safety":  # FSN124 has reported those of an old safety block
            yield from _outside(child, depth + 1)


def _component_names(blocks: list[Element], out: Collector) -> None:
    """FSN128: the driver searches for components by kind and name, in all blocks of the file."""
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
                "is twice in this ros2_control block; the driver adds the modules of both twice"
                if owner is block
                else "is also in another ros2_control block; the driver gives the modules of "
                "both to both"
            )
            out.add(
                "FSN128",
                component.span,
                f"{component.name} {name!r} {what}",
                hint="give each component a name of its own",
                related=(Related(span=first.span, message="the other one"),),
            )


def _offered_twice(blocks: list[Element], others: list[Element], out: Collector) -> None:
    """FSN128: an interface of the driver that other hardware has as well."""
    own = {key: place for block in blocks for key, place in _interfaces(block)}
    for other in others:
        plugin = plugin_of(other)
        owner = "another block" if plugin is None else plugin.text.strip()[:60]
        reported: set[str] = set()
        for key, place in _interfaces(other):
            is_command, component, name = key
            if key not in own or component in reported:
                continue
            reported.add(component)
            out.add(
                "FSN128",
                place,
                f"{'command' if is_command else 'state'}_interface {component}/{name} belongs to "
                f"the EtherCAT driver and to {owner}: only one hardware can have it",
                hint="keep the component in one ros2_control block",
                related=(Related(span=own[key], message="the EtherCAT driver"),),
            )


def _interfaces(block: Element) -> Iterator[tuple[tuple[bool, str, str], Span]]:
    for element in (e for e in block.children if e.name in COMPONENTS):
        component = robot_component(element, {})
        for is_command, name, place in component.interfaces():
            yield (is_command, component.name, name), place
