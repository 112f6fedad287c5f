"""The library: a network from its files, and all operations on it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fsoe_net.diag.diagnostic import Severity, sort_diagnostics
from fsoe_net.errors import InputError
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.own.scan import load_scan
from fsoe_net.formats.shared.files import open_file
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import Fingerprint
from fsoe_net.plan.model import Plan
from fsoe_net.project.check import check_loaded, library_of, load_files, whole_network
from fsoe_net.project.findings import Findings
from fsoe_net.project.parts import (
    NetworkConnection,
    NetworkSubDevice,
    NetworkTransfer,
    connections_of,
    subdevices_of,
    transfers_of,
)
from fsoe_net.proposal.draft import Draft, Inputs, make_draft
from fsoe_net.proposal.gather import gather
from fsoe_net.timing.budget import Budget, make_budget

if TYPE_CHECKING:
    from fsoe_net.acceptance.report import Report
    from fsoe_net.capture.decode import DecodedFrame
    from fsoe_net.compare.diff import Difference
    from fsoe_net.compare.sides import Side
    from fsoe_net.live.client import Client
    from fsoe_net.live.result import Run
    from fsoe_net.model.resolve import Resolution
    from fsoe_net.project.convert import Conversion
    from fsoe_net.project.edit import NetworkEdit

AnyPath = str | os.PathLike[str]


def load(
    *paths: AnyPath,
    packages: Mapping[str, str] | None = None,
    xacro_args: Mapping[str, str] | None = None,
    xacro_env: Sequence[str] = (),
    trust_xacro: bool = False,
) -> Network:
    """Read the files of a network, and check them.

    A mistake in a file is a finding of `Network.check`, not an exception.

    Args:
        paths: A network YAML, or a URDF or xacro with its transfer YAML. Other files in the list
            are compared with it: ESI, ENI, SII image, TwinSAFE export and more, recognised by
            content.
        packages: ROS package name to folder, for ``$(find NAME)`` and ``package://NAME``.
        xacro_args: Values of ``$(arg NAME)``.
        xacro_env: Names of the environment variables that ``$(env NAME)`` may read.
        trust_xacro: Expand xacro without confinement: the file then has all your permissions.

    Raises:
        ValueError: No path is given.
        EnvironmentFault: xacro cannot be confined on this machine.
    """
    if not paths:
        raise ValueError("load() takes at least one path")
    options = LoadOptions(
        packages=packages or {},
        xacro_args=xacro_args or {},
        xacro_env=tuple(xacro_env),
        trust_xacro=trust_xacro,
    )
    return Network([os.fspath(path) for path in paths], options)


class Network:
    """A network as read from its files; see `load`.

    Attributes:
        name: Name of the network, or of the first file if nothing could be read.
        paths: The files given to `load`.
    """

    def __init__(self, paths: Sequence[str], options: LoadOptions) -> None:
        self.paths = tuple(paths)
        self._options = options
        self._loaded = load_files(self.paths, options, compared=True)
        self._checked = check_loaded(self._loaded)
        config = self._checked.network
        self.name = Path(paths[0]).stem if config is None else config.name

    def __repr__(self) -> str:
        return f"<Network {self.name!r}: {self.check()!r}>"

    def _repr_svg_(self) -> str | None:
        """Return the picture that a notebook shows; ``None`` if nothing could be read."""
        from fsoe_net.document.style import standalone_picture
        from fsoe_net.report.network_picture import network_picture

        if self._checked.resolution is None:
            return None
        return standalone_picture(
            network_picture(self._checked.resolution, self._checked.diagnostics)
        )

    @property
    def subdevices(self) -> tuple[NetworkSubDevice, ...]:
        """The SubDevices, in the order of the process image; empty if nothing could be read."""
        config = self._checked.network
        return () if config is None else subdevices_of(config)

    @property
    def connections(self) -> tuple[NetworkConnection, ...]:
        """The FSoE connections, in the order of the plan; without those that have errors."""
        resolution = self._checked.resolution
        return () if resolution is None else connections_of(resolution)

    @property
    def transfers(self) -> tuple[NetworkTransfer, ...]:
        """The copies of every bus cycle, those that are made from connections included."""
        resolution = self._checked.resolution
        return () if resolution is None else transfers_of(resolution)

    def check(self, scan: AnyPath | None = None) -> Findings:
        """Return the findings, each with its location and the next step.

        Same checks as ``fsoe-net check``: the files, their timing, the device library and the other
        files in the list.

        Args:
            scan: A ``scan.json`` of the bus to compare with the network.

        Raises:
            InputError: The scan cannot be used, or the network is incomplete.
        """
        if scan is None:
            return Findings(self._checked.diagnostics)
        seen, damage = load_scan(os.fspath(scan))
        if seen is None:
            raise InputError(f"{os.fspath(scan)} is not a complete scan document", damage)
        return Findings(check_loaded(self._loaded, scan=seen).diagnostics)

    def compile(self) -> Plan:
        """Return the copy plan.

        Raises:
            InputError: The network has errors, which the exception carries; or it is incomplete, or
                copies nothing.
        """
        return compile_plan(self._whole("no plan"))

    @property
    def fingerprint(self) -> Fingerprint:
        """The fingerprint of everything safety-relevant in the network; errors as in `compile`."""
        return self.compile().fingerprint

    def timing(
        self, *, cycle_ms: float | None = None, copy_cycles: int = 2, drift: float = 0.0
    ) -> Budget:
        """Return the timing budget: every watchdog with its limits, every safety function.

        Args:
            cycle_ms: Another bus cycle, in ms.
            copy_cycles: Bus cycles per direction: 2 for fsn-master.
            drift: Relative error by which a device clock may be slow, 0 to 0.1.

        Raises:
            InputError: As in `compile`.
        """
        resolution = self._whole("no budget")
        return make_budget(
            resolution,
            library_of(resolution.network),
            cycle=cycle_ms,
            copy_cycles=copy_cycles,
            drift=drift,
        )

    def simulate(
        self,
        scenario: AnyPath | None = None,
        *,
        duration_s: float | None = None,
        virtual: bool = True,
        capture: AnyPath | None = None,
        incidents: AnyPath | None = None,
    ) -> Run:
        """Run the network on the emulated bus; nothing is sent to a real one.

        Args:
            scenario: YAML with steps and expectations.
            duration_s: Seconds; default: the duration of the scenario, or 3.
            virtual: Simulated time: as fast as the machine allows, and reproducible. Otherwise the
                C core cycles in real time.
            capture: File for the frames of a virtual run (pcapng).
            incidents: Folder for an incident file when a connection fails; created if missing.

        Raises:
            InputError: As in `compile`; or the scenario cannot be used.
            ValueError: ``capture`` without ``virtual``.
            CoreMissing: The compiled part is missing.
            EnvironmentFault: A file cannot be written.
        """
        from fsoe_net.formats.shared.write_files import make_folder
        from fsoe_net.project.simulate import simulate

        if capture is not None and not virtual:
            raise ValueError("capture needs virtual=True: a run in real time carries no frames")
        resolution = self._whole("nothing started")
        make_folder(_text(incidents), "incidents")
        return simulate(
            resolution,
            scenario_file=_text(scenario),
            duration_ns=None if duration_s is None else round(duration_s * 1e9),
            virtual=virtual,
            capture=_text(capture),
            incidents=_text(incidents),
        )

    def diff(self, other: Network | Plan | AnyPath) -> Difference:
        """Return the differences in meaning, without comments, order and file names.

        Args:
            other: The other side; a path may be anything that ``fsoe-net diff`` reads.

        Raises:
            InputError: One side cannot be compared; the exception carries the errors.
        """
        from fsoe_net.compare.diff import compare
        from fsoe_net.compare.sides import side_of_plan

        mine = self._side()
        if isinstance(other, Network):
            return compare(mine, other._side())
        if isinstance(other, Plan):
            return compare(mine, side_of_plan(other, "plan"))
        from fsoe_net.compare.read import read_side

        return compare(mine, read_side(os.fspath(other), self._options))

    def report(
        self,
        *,
        scenario: AnyPath | None = None,
        evidence: Sequence[AnyPath] = (),
        plan: AnyPath | None = None,
        against: AnyPath | None = None,
        accepted: AnyPath | None = None,
        test_record: AnyPath | None = None,
        self_test: AnyPath | None = None,
    ) -> Report:
        """Return the report for the safety engineer; errors come first.

        Args:
            scenario: A scenario to run in virtual time; the report contains its result.
            evidence: ``scan.json``, results of runs (JSON), incident files.
            plan: A plan file that must match the network.
            against: An earlier plan or network, the base of the change log.
            accepted: An acceptance record, the base of the change log without ``against``.
            test_record: A test record of this network.
            self_test: The result (JSON) of ``fsoe-net doctor --self-test``.

        Raises:
            InputError: The network is missing, or a file cannot be used.
            ValueError: Both ``against`` and ``accepted``.
        """
        from fsoe_net.acceptance.report import make_report
        from fsoe_net.project.known import read_record
        from fsoe_net.report.evidence import read_evidence

        if against is not None and accepted is not None:
            raise ValueError("against and accepted: the change log starts from one of them")
        return make_report(
            self._checked,
            evidence=[read_evidence(os.fspath(path)) for path in evidence],
            plan=_text(plan),
            scenario=_text(scenario),
            against=_text(against),
            accepted=None if accepted is None else read_record(os.fspath(accepted)),
            test_record=_text(test_record),
            self_test=_text(self_test),
            loading=self._options,
        )

    def edit(self, path: AnyPath | None = None) -> NetworkEdit:
        """Change a YAML file of this network; comments and layout are preserved.

        `NetworkEdit.document` is the content of the file. `NetworkEdit.save` writes it and returns
        the changed network. This object does not change.

        Args:
            path: The file; default: the first of `paths`.

        Raises:
            InputError: The file is not YAML, or cannot be read.
        """
        from fsoe_net.project.edit import NetworkEdit

        name = self.paths[0] if path is None else os.fspath(path)
        return NetworkEdit(name, lambda: Network(self.paths, self._options))

    def _whole(self, refusal: str) -> Resolution:
        return whole_network(self._checked, refusal)

    def _side(self) -> Side:
        from fsoe_net.compare.sides import side_of_network

        if self._checked.resolution is None:
            raise InputError(f"{self.name} cannot be compared", self.check().errors)
        return side_of_network(self._checked.resolution, self.paths[0])


def propose(*paths: AnyPath, answers: AnyPath | None = None) -> Draft:
    """Propose a network from the files available, as ``fsoe-net init`` does.

    Args:
        paths: Anything that `convert` reads, a ``scan.json``, and folders with such files.
        answers: YAML with answers that the files do not contain; without it see `Draft.questions`.

    Raises:
        InputError: A file or an answer cannot be used; the exception carries the findings.
    """
    found = gather([os.fspath(path) for path in paths], LoadOptions(), answers=_text(answers))
    draft = make_draft(Inputs.of(found), found.answers)
    errors = [d for d in draft.findings if d.level is Severity.ERROR]
    if errors:
        raise InputError("nothing proposed", sort_diagnostics(errors))
    return draft


def convert(*paths: AnyPath, to: str, name: str = "network.yaml") -> Conversion:
    """Convert the bus that the files describe together to another format.

    Args:
        paths: Files, or folders written by a conversion; recognised by content.
        to: ``network``, ``driver``, ``eni``, ``igh``, ``c`` or ``lcec``.
        name: Name of the file to write; formats with several files choose their own names.

    Raises:
        ValueError: Unknown format.
        InputError: A file cannot be used, or the format cannot represent the bus.
    """
    from fsoe_net.formats.registry import all_targets
    from fsoe_net.project.convert import convert_files

    if to not in all_targets():
        raise ValueError(f"to={to!r} is not a format; there are {', '.join(all_targets())}")
    return convert_files([os.fspath(path) for path in paths], to, name=name)


def decode(capture: AnyPath, network: Network | None = None) -> Iterator[DecodedFrame]:
    """Yield the FSoE frames of captured EtherCAT traffic (pcap, pcapng), in order.

    They are found without a network: by command, connection ID and CRCs.

    Args:
        capture: The file.
        network: Network with the names of connections and signals.

    Raises:
        InputError: The capture cannot be read to its end; or as in `Network.compile`.
        CoreMissing: The compiled part is missing.
    """
    from fsoe_net.capture.decode import CaptureDecoder, naming_of

    naming = naming_of(None if network is None else network._whole("nothing decoded"))
    name = os.fspath(capture)
    with open_file(name, regular=False) as stream:
        decoder = CaptureDecoder(name, stream, naming)
        for sighting in decoder.sightings():
            yield decoder.frame_of(sighting)


def connect(
    socket: AnyPath | None = None, *, interface: str = "", timeout_s: float = 5.0
) -> Client:
    """Connect to a running ``fsn-master``; a context manager.

    Args:
        socket: Its control socket; otherwise that of the ``fsn-master`` on ``interface``.
        interface: Network interface of the bus.
        timeout_s: Timeout for a connection or a reply, in seconds.

    Raises:
        EnvironmentFault: No process answers, or permission is missing.
    """
    from fsoe_net.live.client import Client
    from fsoe_net.live.sockets import control_socket

    path = control_socket(interface) if socket is None else os.fspath(socket)
    return Client(path, timeout_s=timeout_s)


def _text(path: AnyPath | None) -> str | None:
    return None if path is None else os.fspath(path)
