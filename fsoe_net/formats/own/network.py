"""Builds one `NetworkConfig` from the files of a user: detects types, follows references."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Diagnostic, Severity, Span, sort_diagnostics
from fsoe_net.diag.guesses import guesses
from fsoe_net.diag.pause import without_collector
from fsoe_net.diag.words import listed
from fsoe_net.formats.own.buses import (
    buses_from_yaml,
    check_subdevices,
    cycle_from_yaml,
    groups_from_yaml,
)
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.own.report_facts import report_facts_from_yaml
from fsoe_net.formats.own.safety_functions import safety_functions_from_yaml
from fsoe_net.formats.own.schema import (
    MOST_UNKNOWN,
    check_structure,
    kind_by_keys,
    refuse_kind,
    schema_keys,
)
from fsoe_net.formats.own.slave_yaml import device_from_yaml, load_device
from fsoe_net.formats.own.transfers import ModuleDecl, modules_from_yaml, nets_from_yaml
from fsoe_net.formats.shared.files import Collector, is_there, read_bytes, stem_of
from fsoe_net.formats.shared.numbers import own_int
from fsoe_net.formats.shared.ring import fits_on_bus
from fsoe_net.formats.shared.yaml_tree import MapNode, SeqNode, parse_yaml
from fsoe_net.model.bus import Device, SubDevice
from fsoe_net.model.drives import with_mode
from fsoe_net.model.network import Net, NetworkConfig
from fsoe_net.model.robot import Robot

if TYPE_CHECKING:
    from fsoe_net.formats.ros2.urdf_system import DriverSystem


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadResult:
    """The result. ``network`` is ``None`` when no content could be interpreted."""

    network: NetworkConfig | None
    diagnostics: tuple[Diagnostic, ...]


@without_collector
def load_network(
    paths: Sequence[str | os.PathLike[str]], options: LoadOptions | None = None
) -> LoadResult:
    """Read a network from the files a user names.

    Args:
        paths: One network YAML; or one URDF or xacro, optionally with the transfer YAML it needs;
            or a transfer YAML or slave YAML alone, which is checked as far as possible.
        options: How references are followed.

    Never raises for the content of files or for the file system: every problem is a diagnostic.
    """
    assembly = _Assembly(options or LoadOptions())
    for path in dict.fromkeys(os.fspath(p) for p in paths):
        assembly.add(path)
    network = assembly.finish()
    if network is not None and not _fit(network, assembly.out):
        network = None
    if network is not None:
        network = replace(
            network, sources=tuple(sorted(assembly.out.sources, key=lambda s: s.path))
        )
    return LoadResult(
        network=network, diagnostics=tuple(sort_diagnostics(assembly.out.diagnostics))
    )


class _Assembly:
    """Collects files by type, then builds the network once."""

    def __init__(self, options: LoadOptions) -> None:
        self.out = Collector()
        self._options = options
        self._devices: dict[str, Device | None] = {}
        self._drives: dict[tuple[str, int], Device] = {}  # by path and mode of operation
        self._located: dict[tuple[str, str], str] = {}
        self._network_file: MapNode | None = None
        self._transfer_files: list[MapNode] = []
        self._slaves: list[tuple[str, Device | None]] = []
        self._urdf: str | None = None
        self._systems: tuple[DriverSystem, ...] = ()
        self._robot = Robot()
        self._controllers: list[MapNode] = []
        self._relative_named: set[str] = set()

    def add(self, path: str) -> None:
        """Read one file and add it according to its kind."""
        data = read_bytes(path, self.out)
        if data is None:
            return
        if _looks_like_xml(data):
            self._add_urdf(path)
            return
        # Held back: if the file belongs to another tool, that is the better message.
        found = Collector()
        root = parse_yaml(data, path, found)
        if root is None and _refuse_known(data, Span(path, 1, 1), self.out):
            return
        self.out.diagnostics += found.diagnostics
        if root is None:
            return
        kind = self._kind_of(root, data)
        if kind == "network":
            if self._network_file is not None:
                self._refuse_second(path, self._network_file.file)
                return
            if check_structure(root, "network", self.out):
                self._network_file = root
        elif kind == "transfers":
            if check_structure(root, "transfers", self.out):
                self._transfer_files.append(root)
        elif kind == "controllers":
            self._controllers.append(root)
        elif kind == "slave":
            self._slaves.append((path, device_from_yaml(root, path, self.out)))

    def _add_urdf(self, path: str) -> None:
        if self._urdf is not None:
            self._refuse_second(path, self._urdf)
            return
        self._urdf = path
        from fsoe_net.formats.ros2.urdf import load_urdf  # imports xacro: only if there is a URDF

        result = load_urdf(path, self._options)
        self.out.diagnostics.extend(result.diagnostics)
        for row in result.sources:
            if row not in self.out.sources:
                self.out.sources.append(row)
        self._systems = self._of_master(result.systems, path)
        self._robot = Robot(components=result.components, is_closed=result.is_closed)

    def _of_master(self, systems: tuple[DriverSystem, ...], path: str) -> tuple[DriverSystem, ...]:
        """Return the systems of the requested master, or all."""
        master = self._options.master
        if not master:
            return systems
        chosen = tuple(s for s in systems if master in (str(s.master_id), s.master_name, s.name))
        if systems and not chosen:
            known = listed([f"{s.master_name or s.master_id} or {s.name}" for s in systems])
            self.out.add(
                "FSN140",
                Span(path, 1, 1),
                f"this URDF has no EtherCAT master {master!r}",
                hint=f"choose one with --master: {known}",
            )
        return chosen

    def _refuse_second(self, path: str, first: str) -> None:
        self.out.add(
            "FSN117",
            Span(path, 1, 1),
            f"a second network; {first} already describes one",
            hint="check networks one at a time",
        )

    def _kind_of(self, root: MapNode, data: bytes) -> str | None:
        """Return the type of a file by its content, never by its name: the name of its schema."""
        kinds = ("network", "transfers", "slave")
        scores = {kind: len(schema_keys(kind) & set(root.pairs)) for kind in kinds}
        other = kind_by_keys(root)
        if other in ("acceptance", "answers", "device", "test-record", "scenario"):
            refuse_kind(root, other, "network", "FSN117", self.out)
            return None
        if "subdevices" in root.pairs or "buses" in root.pairs:
            return "network"
        # `nets` is a key of both kinds; a file with nothing else is a transfer YAML.
        best = max(scores, key=lambda k: (scores[k], k == "transfers"))
        # YAML of every program can have these two.
        others = set(root.pairs) - {"name", "version"}
        if scores[best] and (not others or others & schema_keys(best)):
            return best
        from fsoe_net.formats.ros2.controllers import is_controllers  # only if needed

        if is_controllers(root):
            return "controllers"
        words = {"nets": "transfers", "subdevices": "network"}
        words |= dict.fromkeys(("safety_modules", "transfer_modules"), "transfers")
        words |= dict.fromkeys(("vendor_id", "product_id", "rpdo", "tpdo"), "slave")
        for key in itertools.islice(root.pairs, MOST_UNKNOWN):
            meant = {words[word] for word in guesses(key, words, cutoff=0.75)}
            if len(meant) == 1:
                return meant.pop()
        if _refuse_known(data, root.span, self.out):
            return None
        shown = ", ".join(list(root.pairs)[:5]) or "none"
        self.out.add(
            "FSN117",
            root.span,
            f"neither a network, a transfer nor a slave YAML; its keys are: {shown}",
            hint="a network file has `version`, `subdevices`, `nets`; a transfer YAML has `nets`;"
            " a slave YAML has `vendor_id`, `rpdo`, `tpdo`",
        )
        return None

    def finish(self) -> NetworkConfig | None:
        """Build the network from the content read."""
        if self._controllers and self._urdf is None:
            self.out.add(
                "FSN117",
                self._controllers[0].span,
                "controllers are checked next to a robot description only",
                hint="name the URDF or xacro of the robot too",
            )
        if self._network_file is not None:
            return self._from_network_file(self._network_file)
        if self._urdf is not None:
            return self._from_urdf(self._urdf)
        if self._transfer_files:
            return self._from_transfers_alone()
        if self._slaves:
            return self._from_slaves()
        return None

    # -- network YAML -----------------------------------------------------------------------------

    def _from_network_file(self, root: MapNode) -> NetworkConfig:
        buses = buses_from_yaml(root, self.out)
        if not buses:
            check_subdevices(root, self.out)
        subs = self._on_buses([root.maps("subdevices"), *(b.subdevices for b in buses)])
        frames = any(s.device is not None and s.device.layout.blocks for s in subs)
        needed = frames or not isinstance(root.get("nets"), SeqNode)
        nets = nets_from_yaml(root, self.out, needed=needed)
        for extra in self._transfer_files:
            nets += nets_from_yaml(extra, self.out)
        return NetworkConfig(
            name=root.text("name") or stem_of(root.file),
            span=root.span,
            fields=root.places(),
            cycle_ns=buses[0].bus.cycle_ns if buses else cycle_from_yaml(root, self.out),
            subdevices=tuple(subs),
            # reported once, not again for each name
            partial="subdevices" not in root.pairs and not buses,
            nets=nets,
            safety_functions=safety_functions_from_yaml(root, self.out),
            project=root.text("project") or "",
            report=report_facts_from_yaml(root, self.out),
            buses=tuple(b.bus for b in buses),
            groups=groups_from_yaml(root, self.out),
        )

    def _on_buses(self, rows: Sequence[Sequence[MapNode]]) -> list[SubDevice]:
        """Read SubDevices outside of buses, which are on the first bus, then those of buses."""
        found = (self._subdevice(row, max(0, n - 1)) for n, of in enumerate(rows) for row in of)
        return [sub for sub in found if sub is not None]

    def _subdevice(self, node: MapNode, bus: int) -> SubDevice | None:
        name = node.text("name")
        config = node.text("config")
        alias = own_int(node, "alias", 0xFFFF, self.out)
        position = own_int(node, "position", 0xFFFF, self.out)
        if "position" not in node.pairs and "alias" not in node.pairs:
            self.out.add(
                "FSN110",
                node.span,
                f"subdevice {name or '?'} has neither position nor alias",
                hint="add position: with its place in the ring, counted from 0",
            )
            return None
        if name is None or config is None:
            return None
        return SubDevice(
            span=node.span,
            fields=node.places(),
            name=name,
            alias=alias or 0,
            position=position or 0,
            device=self._device(config, node.file, node.at("config")),
            revision=own_int(node, "revision", 0xFFFFFFFF, self.out),
            master_id=bus,
        )

    def _device(self, config: str, named_in: str, named_at: Span) -> Device | None:
        """Read a slave YAML once, whatever the number of SubDevices that share it."""
        path = self._located.get((config, named_in))
        if path is None:
            path = self._located[config, named_in] = self._locate(config, named_in)
        if path not in self._devices:
            self._devices[path] = load_device(path, self.out, named_at=named_at)
        return self._devices[path]

    def _locate(self, text: str, named_in: str) -> str:
        """Return the path of a reference; relative ones start at the file that names them."""
        if text.startswith("package://"):
            package, _, rest = text.removeprefix("package://").partition("/")
            folder = self._options.packages.get(package)
            return os.path.join(folder, rest) if folder else text
        text = text.removeprefix("file://")
        folder = os.path.dirname(named_in)
        beside = os.path.normpath(os.path.join(folder, text)) if folder else text
        if not is_there(beside) and is_there(text):
            return text  # the driver would find it from here
        return beside

    # -- URDF -------------------------------------------------------------------------------------

    def _from_urdf(self, path: str) -> NetworkConfig | None:
        subs: list[SubDevice] = []
        nets: tuple[Net, ...] = ()
        cycle_ns: int | None = None
        for system in self._systems:
            subs.extend(
                self._from_declaration(
                    decl, system.master_id, system=system.name, hardware=system.plugin or ""
                )
                for decl in system.modules
            )
            file = self._transfer_file_of(system)
            if system.control_frequency > 0:
                cycle_ns = round(1e9 / system.control_frequency)
            if file is not None:
                nets += nets_from_yaml(file, self.out)
                subs.extend(self._from_rows(file, system.master_id))
        for file in self._transfer_files:
            nets += nets_from_yaml(file, self.out)
            subs.extend(self._from_rows(file, 0))
        if not self._systems:
            return None
        if not nets and all(s.transfer_file is None for s in self._systems):
            self.out.add(
                "FSN125",
                self._systems[0].span,
                "no transfer_config is given, so no safety frame would be copied",
                severity=Severity.INFO,
                hint="fine for a robot without FSoE; else name the transfer YAML",
            )
        return NetworkConfig(
            name=self._systems[0].name or stem_of(path),
            span=self._systems[0].span,
            fields={key: at for s in reversed(self._systems) for key, at in s.fields.items()},
            cycle_ns=cycle_ns,
            subdevices=tuple(subs),
            nets=nets,
            robot=self._with_controllers(),
        )

    def _with_controllers(self) -> Robot | None:
        if not self._controllers:
            return None
        from fsoe_net.formats.ros2.controllers import read_controllers

        rates, controllers = read_controllers(self._controllers, self.out)
        return replace(self._robot, update_rates=rates, controllers=controllers)

    def _transfer_file_of(self, system: DriverSystem) -> MapNode | None:
        if system.transfer_file is None or self._transfer_files:
            return None
        named_at = system.at(system.transfer_key or "transfer_config")
        self._relative(system.transfer_file, named_at)
        path = self._locate(system.transfer_file, named_at.file)
        data = read_bytes(path, self.out, named_at=named_at)
        root = parse_yaml(data, path, self.out) if data is not None else None
        if root is None or not check_structure(root, "transfers", self.out):
            return None
        return root

    def _relative(self, text: str, span: Span) -> None:
        """Report FSN126, once per naming file."""
        if span.file in self._relative_named:
            return
        if not os.path.isabs(text) and "://" not in text:
            self._relative_named.add(span.file)
            self.out.add(
                "FSN126",
                span,
                f"{text!r} is relative: the driver searches from its working directory, fsoe-net "
                "next to this file",
                hint="write an absolute path, or $(find your_package)/config/… in a xacro",
            )

    def _from_declaration(
        self, decl: ModuleDecl, master_id: int, *, system: str = "", hardware: str = ""
    ) -> SubDevice:
        device: Device | None = None
        if "slave_config" in decl.fields:
            named_at = decl.at("slave_config")
            self._relative(decl.slave_config, named_at)
            device = self._device(decl.slave_config, named_at.file, named_at)
        if device is not None and decl.mode is not None:
            device = self._with_mode(device, decl.mode, decl.at("mode_of_operation"))
        return SubDevice(
            span=decl.span,
            fields=decl.fields,
            name=decl.name,
            alias=decl.alias,
            position=decl.position,
            device=device,
            plugin=decl.plugin,
            required=decl.required,
            origin=decl.origin,
            components=decl.components,
            system=system,
            hardware=hardware,
            master_id=master_id,
        )

    def _with_mode(self, device: Device, mode: int, span: Span) -> Device:
        """Return the device with the mode that its plugin writes; drives of one mode share it."""
        key = (device.path, mode)
        if key not in self._drives:
            self._drives[key] = with_mode(device, mode, span)
        return self._drives[key]

    def _from_rows(self, file: MapNode, master_id: int) -> Iterator[SubDevice]:
        for decl in modules_from_yaml(file, self.out):
            if decl.plugin is not None:
                from fsoe_net.formats.ros2.urdf_params import known_plugin_findings

                self.out.diagnostics += known_plugin_findings(decl.plugin, decl.at("plugin"))
            yield self._from_declaration(decl, master_id)

    # -- files on their own -----------------------------------------------------------------------

    def _from_transfers_alone(self) -> NetworkConfig:
        nets: tuple[Net, ...] = ()
        subs: list[SubDevice] = []
        for file in self._transfer_files:
            nets += nets_from_yaml(file, self.out)
            subs.extend(self._from_rows(file, 0))
        first = self._transfer_files[0]
        known = {s.name for s in subs}
        used = {
            end.module
            for net in nets
            for transfer in net.transfers
            for end in (transfer.destination, transfer.source)
        }
        used |= {name for net in nets for c in net.connections for name in (c.main, c.sub)}
        missing = sorted(used - known)
        if missing:
            self.out.add(
                "FSN201",
                first.at("nets"),
                f"declared elsewhere, so not checked here: {', '.join(missing)}",
                severity=Severity.INFO,
                hint="name the URDF or network file too, to check the copies to the bit",
            )
        return NetworkConfig(
            name=stem_of(first.file),
            span=first.span,
            cycle_ns=None,
            subdevices=tuple(subs),
            nets=nets,
            partial=bool(missing),
        )

    def _from_slaves(self) -> NetworkConfig:
        subs = tuple(
            SubDevice(
                span=device.span if device else Span(path, 1, 1),
                name=stem_of(path),
                position=n,
                device=device,
            )
            for n, (path, device) in enumerate(self._slaves)
        )
        first = subs[0]
        return NetworkConfig(
            name=first.name, span=first.span, cycle_ns=None, subdevices=subs, nets=(), partial=True
        )


def _fit(network: NetworkConfig, out: Collector) -> bool:
    """Return whether EtherCAT can address the SubDevices of each bus."""
    buses: dict[int, list[SubDevice]] = {}
    for sub in network.subdevices:
        buses.setdefault(sub.master_id, []).append(sub)
    return all(fits_on_bus(subs, out) for subs in buses.values())


def _refuse_known(data: bytes, place: Span, out: Collector) -> bool:
    from fsoe_net.formats.recognise import refuse_known  # imports all formats: only if needed

    return refuse_known(data, place, "a network YAML or a URDF", out)


def _looks_like_xml(data: bytes) -> bool:
    start = data[:200].lstrip(b"\xef\xbb\xbf \t\r\n")
    return start.startswith(b"<") or (data[:2] in (b"\xff\xfe", b"\xfe\xff") and b"<" in data[:40])
