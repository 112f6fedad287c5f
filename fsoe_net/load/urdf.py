"""URDF and xacro: ``ros2_control`` blocks with driver parameters and ``ec_module`` tags."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from fsoe_net.diag import Diagnostic, Related, Severity, Span
from fsoe_net.load.files import Collector, read_bytes
from fsoe_net.load.xacro_expand import expand_xacro, uses_xacro
from fsoe_net.load.xml_tree import Element, parse_xml
from fsoe_net.model import Located, SourceFile

__all__ = ["DriverSystem", "ModuleDecl", "UrdfResult", "known_plugin_findings", "load_urdf"]

_GENERIC = "ethercat_generic_plugins/"
_KNOWN_PLUGINS = (
    "ethercat_generic_plugins/GenericEcSlave",
    "ethercat_generic_plugins/EcCiA402Drive",
    "ethercat_plugins/ATI_FTSensor",
    "ethercat_plugins/Beckhoff_EL1008",
    "ethercat_plugins/Beckhoff_EL1018",
    "ethercat_plugins/Beckhoff_EL2008",
    "ethercat_plugins/Beckhoff_EL2088",
    "ethercat_plugins/Beckhoff_EL2124",
    "ethercat_plugins/Beckhoff_EL3102",
    "ethercat_plugins/Beckhoff_EL3104",
    "ethercat_plugins/Beckhoff_EL4132",
    "ethercat_plugins/Beckhoff_EL4134",
    "ethercat_plugins/Beckhoff_EL5101",
    "ethercat_plugins/Maxon_EPOS3",
    "ethercat_plugins/Omron_NX_ECC201_NX_ID5442",
)
_DRIVER_PREFIX = "ethercat_driver/"
_PROTOTYPE_PLUGIN = "ethercat_driver/EthercatSafetyDriver"
_SYSTEM_PARAMS = {
    "master_id",
    "control_frequency",
    "fsoe_config",
    "transfer_config",
    "master_plugin",
    "readiness_timeout_s",
}
_MODULE_PARAMS = {"alias", "position", "slave_config", "mode_of_operation", "required", "plugin"}
_COMPONENTS = ("joint", "gpio", "sensor")  # the order in which the driver adds modules
_OTHER_ROOTS = {
    "EtherCATInfo": "an ESI file (EtherCAT SubDevice information)",
    "EtherCATConfig": "an ENI file (EtherCAT network information)",
    "EtherCATInfoList": "output of `ethercat xml`",
    "sdf": "an SDF file",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ModuleDecl(Located):
    """One ``ec_module``. ``origin`` is ``joint``, ``gpio`` or ``sensor``."""

    name: str
    plugin: str | None
    alias: int
    position: int
    slave_config: str
    required: bool
    origin: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverSystem(Located):
    """One ``ros2_control`` block; modules stand in the order in which the driver adds them."""

    name: str
    plugin: str | None
    master_id: int
    control_frequency: float
    transfer_file: str | None
    transfer_key: str | None
    modules: tuple[ModuleDecl, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfResult:
    """What a URDF says about EtherCAT."""

    systems: tuple[DriverSystem, ...]
    diagnostics: tuple[Diagnostic, ...]
    sources: tuple[SourceFile, ...]


def load_urdf(
    path: str | os.PathLike[str],
    *,
    packages: Mapping[str, str] | None = None,
    xacro_args: Mapping[str, str] | None = None,
) -> UrdfResult:
    """Read a URDF or xacro file. Never raises for anything in the file or the file system."""
    out = Collector()
    systems: list[DriverSystem] = []
    root = _document(os.fspath(path), out, packages or {}, xacro_args or {})
    if root is not None:
        blocks = [e for e in root.all("ros2_control") if _is_ethercat(e)]
        if not blocks:
            out.add(
                "FSN125",
                root.span,
                "no ros2_control block with an EtherCAT driver or an ec_module",
                hint="the driver's plugin is ethercat_driver/EthercatDriver",
            )
        _component_names(blocks, out)
        systems = [_System(block, out).read() for block in blocks]
    return UrdfResult(
        systems=tuple(systems), diagnostics=tuple(out.diagnostics), sources=tuple(out.sources)
    )


def _document(
    path: str, out: Collector, packages: Mapping[str, str], arguments: Mapping[str, str]
) -> Element | None:
    data = read_bytes(path, out)
    root = parse_xml(data, path, out) if data is not None else None
    if root is None:
        return None
    if root.name != "robot":
        kind = _OTHER_ROOTS.get(root.name, f"an XML file with the root <{root.name}>")
        out.add("FSN117", root.span, f"this is {kind}, not a URDF", hint="give the robot's URDF")
        return None
    if uses_xacro(root):
        return expand_xacro(path, out, packages=packages, arguments=arguments)
    return root


def _plugin_of(block: Element) -> Element | None:
    hardware = block.first("hardware")
    return hardware.first("plugin") if hardware is not None else None


def _is_ethercat(block: Element) -> bool:
    plugin = _plugin_of(block)
    driver = plugin is not None and plugin.value.startswith(_DRIVER_PREFIX)
    return driver or any(e.name in ("ec_module", "safety") for e in block.walk())


def _component_names(blocks: list[Element], out: Collector) -> None:
    """FSN128: the driver matches components of all blocks by name alone."""
    seen: dict[str, tuple[Element, Element]] = {}
    for block in blocks:
        for component in block.children:
            name = component.attributes.get("name")
            if component.name not in _COMPONENTS or name is None:
                continue
            owner, first = seen.setdefault(name, (block, component))
            if owner is not block:
                out.add(
                    "FSN128",
                    component.span,
                    f"{component.name} {name!r} also stands in another ros2_control block; the "
                    "driver gives the modules of both to both",
                    hint="give each component a name of its own",
                    related=(Related(span=first.span, message="the other one"),),
                )


def known_plugin_findings(plugin: str, span: Span) -> list[Diagnostic]:
    """Return FSN121 when a plugin name is not known: a warning when it looks misspelt."""
    if plugin in _KNOWN_PLUGINS:
        return []
    close = difflib.get_close_matches(plugin, _KNOWN_PLUGINS, n=1, cutoff=0.8)
    suspicious = bool(close) or plugin.startswith((_GENERIC, "ethercat_plugins/"))
    return [
        Diagnostic(
            code="FSN121",
            span=span,
            message=f"plugin {plugin!r} is not known here"
            + ("; a driver that cannot load it shifts every later module" if suspicious else ""),
            severity=Severity.WARNING if suspicious else Severity.INFO,
            hint=f"write {close[0]}" if close else "fine if it is your own plugin",
        )
    ]


@dataclass(slots=True)
class _Params:
    """The ``param`` children of an element, by name."""

    owner: Element
    rows: dict[str, Element] = field(default_factory=dict)

    def text(self, name: str) -> str | None:
        row = self.rows.get(name)
        return row.value if row is not None else None

    def span(self, name: str) -> Span:
        row = self.rows.get(name)
        return row.value_span if row is not None else self.owner.span


def _params(owner: Element, known: set[str], out: Collector) -> _Params:
    params = _Params(owner)
    for row in owner.all("param"):
        name = row.attributes.get("name", "")
        if name in params.rows:
            out.add(
                "FSN106",
                row.span,
                f"param {name!r} is given twice",
                hint="delete one of them",
                related=(Related(span=params.rows[name].span, message="first given here"),),
            )
            continue
        params.rows[name] = row
        free = [k for k in known if k not in params.rows]
        close = difflib.get_close_matches(name, free, n=1, cutoff=0.8)
        if name not in known and close:
            out.add(
                "FSN109",
                row.span,
                f"unknown param {name!r}; the driver ignores it silently",
                hint=f"write {close[0]!r}",
            )
    return params


class _System:
    """Reads one ``ros2_control`` block."""

    def __init__(self, block: Element, out: Collector) -> None:
        self._block = block
        self._out = out

    def read(self) -> DriverSystem:
        block, out = self._block, self._out
        hardware = block.first("hardware")
        params = _params(hardware if hardware is not None else block, _SYSTEM_PARAMS, out)
        plugin = self._driver_plugin()
        transfer_key = self._transfer_key(params)
        self._safety_block(transfer_key)
        modules = [
            self._module(component, element)
            for kind in _COMPONENTS
            for component in block.all(kind)
            for element in component.all("ec_module")
        ]
        fields = {name: row.value_span for name, row in params.rows.items()}
        return DriverSystem(
            span=block.span,
            fields=fields,
            name=block.attributes.get("name", ""),
            plugin=plugin,
            master_id=self._number(params, "master_id", 0) or 0,
            control_frequency=self._frequency(params),
            transfer_file=params.text(transfer_key) if transfer_key else None,
            transfer_key=transfer_key,
            modules=tuple(m for m in modules if m is not None),
        )

    def _driver_plugin(self) -> str | None:
        plugin = _plugin_of(self._block)
        if plugin is None or not plugin.value:
            self._out.add(
                "FSN110",
                self._block.span,
                "ros2_control block with ec_module but without <hardware><plugin>",
                hint="add <plugin>ethercat_driver/EthercatDriver</plugin> to <hardware>",
            )
            return None
        if plugin.value == _PROTOTYPE_PLUGIN:
            self._out.add(
                "FSN122",
                plugin.value_span,
                f"{_PROTOTYPE_PLUGIN} exists only in the prototype of 2024",
                hint="write ethercat_driver/EthercatDriver, which copies transfers itself",
            )
        return plugin.value

    def _transfer_key(self, params: _Params) -> str | None:
        old, new = params.rows.get("fsoe_config"), params.rows.get("transfer_config")
        if old is not None and new is not None:
            self._out.add(
                "FSN123",
                max(old.span, new.span),
                "both fsoe_config and transfer_config are given; the driver stops with an error",
                hint="keep transfer_config",
                related=(Related(span=min(old.span, new.span), message="the other one"),),
            )
        elif old is not None:
            self._out.add(
                "FSN132",
                old.span,
                "fsoe_config is the old name; versions from 2026-06 warn about it",
                hint="write transfer_config when your driver knows it",
            )
        return "transfer_config" if new is not None else "fsoe_config" if old is not None else None

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

    def _frequency(self, params: _Params) -> float:
        text = params.text("control_frequency")
        if text is None:
            return 100.0  # the driver's default, in Hz
        try:
            value = float(text)
        except ValueError:
            value = 0.0
        if not 0 < value < 1e6:
            self._out.add(
                "FSN130",
                params.span("control_frequency"),
                f"control_frequency {text!r} is no frequency above zero",
                hint="write it in Hz, for example 1000",
            )
            return 0.0
        return value

    def _number(self, params: _Params, name: str, default: int | None) -> int | None:
        """Read a ring position, alias or master number, which drivers read in several ways."""
        text = params.text(name)
        if text is None:
            return default
        if re.fullmatch(r"0|[1-9][0-9]{0,8}", text):
            if int(text) <= 0xFFFF:
                return int(text)
            self._out.add(
                "FSN113",
                params.span(name),
                f"{name} {text} is outside 0 … 65535",
                hint="`ethercat slaves` lists alias and position",
            )
            return None
        hexadecimal = re.fullmatch(r"0[xX][0-9a-fA-F]{1,4}", text)
        leading = re.fullmatch(r"0[0-9]{1,5}", text)
        mend = str(int(text, 16)) if hexadecimal else str(int(text)) if leading else "0, 1, 2 …"
        digits = re.match(r"[0-9]+", text)
        reads = f"newer drivers read {int(digits.group())}" if digits else "the driver stops"
        self._out.add(
            "FSN131",
            params.span(name),
            f"{name} {text!r} is not a plain decimal number; {reads}, older ones another",
            hint=f"write {mend}",
        )
        return int(mend) if mend.isdigit() else None

    def _module(self, component: Element, element: Element) -> ModuleDecl | None:
        out = self._out
        name = element.attributes.get("name", "")
        params = _params(element, _MODULE_PARAMS, out)
        plugin = element.first("plugin")
        self._nested_interfaces(element, component)
        if plugin is None or not plugin.value:
            out.add(
                "FSN120",
                element.span,
                f"ec_module {name!r} has no <plugin>; the driver stops with an exception",
                hint="add <plugin>ethercat_generic_plugins/GenericEcSlave</plugin>",
            )
        else:
            out.diagnostics.extend(known_plugin_findings(plugin.value, plugin.value_span))
        for key in ("position", "slave_config"):
            if params.text(key) is None:
                out.add(
                    "FSN110",
                    element.span,
                    f"ec_module {name!r} has no {key}",
                    hint=f'add <param name="{key}">…</param>',
                )
        position = self._number(params, "position", None)
        if position is None:
            return None
        fields = {key: row.value_span for key, row in params.rows.items()}
        fields["name"] = element.span
        if plugin is not None:
            fields["plugin"] = plugin.value_span
        return ModuleDecl(
            span=element.span,
            fields=fields,
            name=name,
            plugin=plugin.value if plugin is not None else None,
            alias=self._number(params, "alias", 0) or 0,
            position=position,
            slave_config=params.text("slave_config") or "",
            required=self._required(params),
            origin=component.name,
        )

    def _nested_interfaces(self, element: Element, component: Element) -> None:
        for kind in ("command_interface", "state_interface"):
            for nested in element.all(kind):
                self._out.add(
                    "FSN127",
                    nested.span,
                    f"{kind} {nested.attributes.get('name', '')!r} inside ec_module is never "
                    "exported; the value stays 0",
                    hint=f"move it up into <{component.name}>, beside the ec_module",
                )

    def _required(self, params: _Params) -> bool:
        text = params.text("required")
        if text is None or text.lower() in ("true", "false"):
            return text is None or text.lower() == "true"
        self._out.add(
            "FSN116",
            params.span("required"),
            f"required is {text!r}; allowed: true, false",
            hint="write true or false",
        )
        return True
