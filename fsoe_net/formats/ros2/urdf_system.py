"""One ``ros2_control`` block of a URDF: its driver parameters and its ``ec_module`` tags."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Related
from fsoe_net.formats.own.transfers import ModuleDecl
from fsoe_net.formats.ros2.urdf_params import (
    DRIVER_PLUGIN,
    IGH_MASTER,
    Params,
    driver_plugin_findings,
    known_plugin_findings,
    master_plugin_findings,
    read_address,
    read_flag,
    read_frequency,
    read_mode,
    read_params,
)
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.xml_tree import Element
from fsoe_net.model.bus import Located, RobotComponent
from fsoe_net.model.drives import CIA402_PLUGIN

COMPONENTS = ("joint", "gpio", "sensor")  # the order in which the driver adds modules
_SYSTEM_PARAMS = (
    "master_id",
    "control_frequency",
    "fsoe_config",
    "transfer_config",
    "master_plugin",
    "readiness_timeout_s",
)
_LONGEST_NUMBER = 40
_LIMITED = ("revolute", "prismatic")
_MODULE_PARAMS = ("alias", "position", "slave_config", "mode_of_operation", "required", "plugin")


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverSystem(Located):
    """One ``ros2_control`` block; modules are in the order in which the driver adds them.

    Args:
        name: Name of the block.
        plugin: As written, or ``None``.
        master_id: Number of the EtherCAT master; -1 if it has a name.
        master_name: Name for a master plugin, such as ``enp2s0``; otherwise empty.
        control_frequency: In Hz; 100 if absent, 0 if it is impossible.
        transfer_file: Text of ``transfer_config``, or else of ``fsoe_config``, or ``None``.
        transfer_key: The key used.
        modules: All joints, then gpios, then sensors, each in document order.
    """

    name: str
    plugin: str | None
    master_id: int
    master_name: str
    control_frequency: float
    transfer_file: str | None
    transfer_key: str | None
    modules: tuple[ModuleDecl, ...]


def _hardware_of(block: Element) -> Element | None:
    """Return the tag that ros2_control uses: of several the last."""
    return next(reversed(block.all("hardware")), None)


def plugin_of(block: Element) -> Element | None:
    """Return the plugin tag of a block, or ``None`` if it is missing or empty."""
    hardware = _hardware_of(block)
    plugin = hardware.first("plugin") if hardware is not None else None
    return plugin if plugin is not None and plugin.text.strip() else None


def read_system(block: Element, out: Collector, joints: Mapping[str, Element]) -> DriverSystem:
    """Read a block that belongs to the EtherCAT driver; findings are added to ``out``.

    Args:
        block: The block.
        out: Takes the findings.
        joints: Joints of the robot by name, for their limits.
    """
    return _System(block, out, joints).read()


class _System:
    """Reads one ``ros2_control`` block."""

    def __init__(self, block: Element, out: Collector, joints: Mapping[str, Element]) -> None:
        self._block = block
        self._out = out
        # A transmission changes the unit of a joint before the driver sees it.
        self._joints = {} if block.first("transmission") is not None else joints

    def read(self) -> DriverSystem:
        block, out = self._block, self._out
        hardware = _hardware_of(block)
        _single(block.all("hardware"), out)
        _single(hardware.all("plugin") if hardware is not None else [], out)
        params = read_params(hardware if hardware is not None else block, _SYSTEM_PARAMS, out)
        fields = params.places() | {"name": block.span}
        plugin = self._driver_plugin(hardware)
        if plugin is not None:
            fields["plugin"] = plugin.value_span
        if (master := params.text("master_plugin")) is not None:
            master_plugin_findings(master, params.span("master_plugin"), out)
        transfer_key = self._transfer_key(params)
        self._safety_block(transfer_key)
        modules = [
            self._module(component, element)
            for kind in COMPONENTS
            for component in block.all(kind)
            for element in component.all("ec_module")
        ]
        named = _names_its_master(params)
        return DriverSystem(
            span=block.span,
            fields=fields,
            name=block.attributes.get("name", ""),
            plugin=plugin.text if plugin is not None else None,
            master_id=-1 if named else read_address(params, "master_id", out) or 0,
            master_name=params.text("master_id") or "" if named else "",
            control_frequency=read_frequency(params, out),
            transfer_file=params.text(transfer_key) if transfer_key else None,
            transfer_key=transfer_key,
            modules=tuple(_of_several_components(self._with_positions(modules))),
        )

    def _driver_plugin(self, hardware: Element | None) -> Element | None:
        plugin = plugin_of(self._block)
        if plugin is None:
            self._out.add(
                "FSN110",
                hardware.span if hardware is not None else self._block.span,
                "ros2_control block with ec_module but without <hardware><plugin>",
                hint=f"add <plugin>{DRIVER_PLUGIN}</plugin> to <hardware>",
            )
            return None
        driver_plugin_findings(plugin.text, plugin.value_span, self._out)
        return plugin

    def _transfer_key(self, params: Params) -> str | None:
        old, new = params.rows.get("fsoe_config"), params.rows.get("transfer_config")
        if old is not None and new is not None:
            first, second = sorted((old, new), key=lambda row: row.span)
            self._out.add(
                "FSN123",
                second.span,
                "both fsoe_config and transfer_config are given; no driver takes both",
                hint="keep transfer_config",
                related=(Related(span=first.span, message="the other one"),),
            )
        elif old is not None:
            self._out.add(
                "FSN132",
                old.span,
                "fsoe_config is the old name; versions from 2026-06 warn about it",
                hint="write transfer_config if your driver supports it",
            )
        return next((row for row in ("transfer_config", "fsoe_config") if row in params.rows), None)

    def _safety_block(self, transfer_key: str | None) -> None:
        block = self._block.first("safety")
        if block is not None:
            more = "" if transfer_key else ", so nothing would be copied"
            self._out.add(
                "FSN124",
                block.span,
                f"transfers in an XML <safety> block are read by no current driver{more}",
                hint='write them as YAML and name the file in <param name="transfer_config">',
            )

    def _module(self, component: Element, element: Element) -> ModuleDecl:
        out = self._out
        params = read_params(element, _MODULE_PARAMS, out)
        name = element.attributes.get("name", "")
        if not name:
            message = "ec_module without a name; transfers cannot name it, the driver may stop"
            out.add("FSN110", element.span, message, hint='add name="…"')
        fields = params.places() | {"name": element.span}
        plugin = self._module_plugin(element, params)
        if plugin is not None:
            fields["plugin"] = plugin.value_span
        _nested_interfaces(element, component, out)
        for key in ("position", "slave_config"):
            if key not in params.rows and key not in params.empty:
                message = f"ec_module {name!r} has no {key}"
                out.add("FSN110", element.span, message, hint=f'add <param name="{key}">…</param>')
        alias = read_address(params, "alias", out)
        position = read_address(params, "position", out)
        return ModuleDecl(
            span=element.span,
            fields=fields,
            name=name,
            plugin=plugin.text if plugin is not None else None,
            alias=alias or 0,
            position=-1 if position is None else position,
            slave_config=params.text("slave_config") or "",
            origin=component.name,
            required=read_flag(params, "required", out),
            components=(robot_component(component, self._joints),),
            mode=read_mode(params, out)
            if plugin is not None and plugin.text == CIA402_PLUGIN
            else None,
            params={key: row.text for key, row in params.rows.items()},
        )

    def _module_plugin(self, element: Element, params: Params) -> Element | None:
        """Return the tag that names the plugin; the driver prefers a param of that name."""
        plugin = params.rows.get("plugin", element.first("plugin"))
        if plugin is not None and plugin.text.strip():
            self._out.diagnostics += known_plugin_findings(plugin.text, plugin.value_span)
            return plugin
        self._out.add(
            "FSN120",
            plugin.span if plugin is not None else element.span,
            f"ec_module {element.attributes.get('name', '')!r} has no <plugin>; the driver stops "
            "with an exception",
            hint="add <plugin>ethercat_generic_plugins/GenericEcSlave</plugin>",
        )
        return None

    @staticmethod
    def _with_positions(modules: list[ModuleDecl]) -> list[ModuleDecl]:
        used = {m.position for m in modules}
        free = (n for n in range(0xFFFF, -1, -1) if n not in used)
        return [replace(m, position=next(free, 0)) if m.position < 0 else m for m in modules]


def robot_component(element: Element, joints: Mapping[str, Element]) -> RobotComponent:
    """Return a joint, gpio or sensor with its interfaces, and the limits of the joint."""
    states, commands = (element.all(f"{side}_interface") for side in ("state", "command"))
    name = element.attributes.get("name", "")
    joint = joints.get(name) if element.name == "joint" else None
    limit = joint.first("limit") if joint is not None else None
    return RobotComponent(
        kind=element.name,
        name=name,
        limits=_travel(joint, limit),
        states=tuple(row.attributes.get("name", "") for row in states),
        commands=tuple(row.attributes.get("name", "") for row in commands),
        max_velocity=_limit(limit, "velocity"),
        max_effort=_limit(limit, "effort"),
        joint_type=joint.attributes.get("type", "") if joint is not None else "",
        places=tuple(row.span for row in (*states, *commands)),
    )


def _travel(joint: Element | None, limit: Element | None) -> tuple[float, float] | None:
    """Return the positions between which a joint can move, if they are stated."""
    if joint is None or limit is None or joint.attributes.get("type") not in _LIMITED:
        return None
    texts = [limit.attributes.get(key, "0") for key in ("lower", "upper")]
    try:
        lower, upper = (float(text[:_LONGEST_NUMBER]) for text in texts)
    except ValueError:
        return None
    return (lower, upper) if -math.inf < lower < upper < math.inf else None


def _limit(limit: Element | None, name: str) -> float:
    """Return a limit above 0, or 0 if it is missing or not a number."""
    text = limit.attributes.get(name, "") if limit is not None else ""
    try:
        value = float(text) if len(text) <= _LONGEST_NUMBER else 0.0
    except ValueError:
        return 0.0
    return value if 0 < value < math.inf else 0.0


def _names_its_master(params: Params) -> bool:
    """Whether a plugin reads ``master_id`` as a text; that of the IgH master reads a number."""
    plugin = params.text("master_plugin")
    return plugin is not None and plugin != IGH_MASTER and params.text("master_id") is not None


def _single(tags: list[Element], out: Collector) -> None:
    """FSN483: ros2_control uses the last hardware of a block, and the first plugin of that."""
    if len(tags) < 2:
        return
    used, which = (tags[-1], "last") if tags[0].name == "hardware" else (tags[0], "first")
    unused = next(tag for tag in tags if tag is not used)
    out.add(
        "FSN483",
        unused.span,
        f"{len(tags)} <{used.name}> in one ros2_control block: ros2_control uses the {which}",
        hint="keep one of them, or choose with an argument of the xacro",
        related=(Related(span=used.span, message=f"the <{used.name}> that is used"),),
    )


def _of_several_components(modules: list[ModuleDecl]) -> list[ModuleDecl]:
    """Join modules of one name, place and file: one SubDevice for the newest driver."""
    groups: dict[object, tuple[ModuleDecl, dict[RobotComponent, None]]] = {}
    for number, decl in enumerate(modules):
        (component,) = decl.components
        key: object = number
        # Without a file, it is unknown whether two tags mean the same SubDevice.
        if decl.slave_config:
            key = (decl.name, decl.alias, decl.position, decl.slave_config)
        if component in groups.get(key, (decl, {}))[1]:
            key = number  # twice in one joint: two modules
        groups.setdefault(key, (decl, {}))[1][component] = None
    return [replace(first, components=tuple(found)) for first, found in groups.values()]


def _nested_interfaces(element: Element, component: Element, out: Collector) -> None:
    for nested in element.children:
        if nested.name in ("command_interface", "state_interface"):
            out.add(
                "FSN127",
                nested.span,
                f"{nested.name} {nested.attributes.get('name', '')!r} inside ec_module is never "
                "exported; the value stays 0",
                hint=f"move it up into <{component.name}>, next to the ec_module",
            )
