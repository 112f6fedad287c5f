"""The test record of a network, run on an emulated or a live bus."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.diag.words import summary
from fsoe_net.document.write_html import document_html
from fsoe_net.errors import InputError
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.own.protocol import load_protocol
from fsoe_net.formats.own.write_protocol import write_protocol
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.live.client import Client
from fsoe_net.model.network import SourceFile
from fsoe_net.model.protocol import Protocol, ProtocolStep
from fsoe_net.model.resolve import Resolution
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import Fingerprint, fingerprint_of
from fsoe_net.plan.model import Plan
from fsoe_net.project.check import check_files, whole_network
from fsoe_net.report.protocol_document import protocol_document
from fsoe_net.test_record.live import Person, run_protocol_live
from fsoe_net.test_record.steps import compare_protocol, keep_machine, make_protocol
from fsoe_net.test_record.virtual import run_protocol_virtual
from fsoe_net.version import __version__


@dataclass(slots=True, kw_only=True)
class ProtocolTrial:
    """A test record during its run.

    Attributes:
        resolution: The network.
        plan: Its plan.
        fingerprint: Fingerprint of the plan.
        protocol: With the results so far, also during a run.
    """

    resolution: Resolution
    plan: bytes
    fingerprint: Fingerprint
    protocol: Protocol

    @classmethod
    def of(
        cls,
        files: Sequence[str],
        loading: LoadOptions | None = None,
        before: Protocol | None = None,
    ) -> ProtocolTrial:
        """Return the test record of a network, with entries of people in an earlier one.

        Raises:
            InputError: The network has an error, or no FSoE connection.
        """
        resolution = whole_network(check_files(files, loading), "no protocol")
        if not resolution.connections:
            raise InputError("nothing to try: these files hold no FSoE connection")
        compiled = compile_plan(resolution)
        plan, fingerprint = compiled.to_bytes(), fingerprint_of(compiled)
        protocol = make_protocol(resolution, plan, fingerprint=fingerprint.whole)
        protocol = replace(protocol, made=datetime.date.today().isoformat())
        if before is not None:
            protocol = keep_machine(protocol, before)
        return cls(resolution=resolution, plan=plan, fingerprint=fingerprint, protocol=protocol)

    def run_virtual(self, *, faults: int, on_step: Callable[[str], None] | None = None) -> None:
        """Try every step on the emulated bus.

        Args:
            faults: FSoE cycles with a fault in them, per class.
            on_step: Called with the name of each step.

        Raises:
            CoreMissing: The compiled part is not there.
        """
        self.protocol = run_protocol_virtual(
            self.protocol, self.resolution, self.plan, faults=faults, on_step=on_step
        )

    def run_live(
        self, socket: str, person: Person, on_step: Callable[[ProtocolStep], None]
    ) -> None:
        """Test each loss on a running ``fsn-master``, with a person who causes it.

        Raises:
            EnvironmentFault: Nobody answers on the socket, or it goes away.
            InputError: It runs another configuration.
        """

        def keep(so_far: Protocol, step: ProtocolStep) -> None:
            self.protocol = so_far
            on_step(step)

        with Client(socket) as client:
            self.protocol = run_protocol_live(
                self.protocol,
                self.resolution,
                client,
                person,
                fingerprint=self.fingerprint,
                on_step=keep,
            )

    def save(self, path: str, *, overwrite: bool = False) -> None:
        """Write the protocol: a page to print where the name ends in .html or .htm, else YAML.

        Raises:
            InputError: The file exists, and is not to be replaced.
            EnvironmentFault: It cannot be written.
        """
        if Path(path).suffix in (".html", ".htm"):
            text = document_html(protocol_document(self.protocol, version=__version__))
        else:
            text = write_protocol(self.protocol)
        write_whole(path, text.encode("utf-8"), overwrite=overwrite)


def read_protocol(
    path: str, resolution: Resolution | None = None, plan: Plan | None = None
) -> tuple[SourceFile, Protocol, list[Diagnostic]]:
    """Read a test record, and compare it with a network if its plan is given.

    Returns:
        Its file, the test record, and the reasons against using its results.

    Raises:
        InputError: It is not a test record.
    """
    out = Collector()
    protocol = load_protocol(path, out)
    if protocol is None:
        found = summary(out.diagnostics)
        raise InputError(
            f"{path} cannot be taken as a test protocol, nothing written: {found}", out.diagnostics
        )
    if resolution is not None and plan is not None:
        whole = fingerprint_of(plan).whole
        fresh = make_protocol(resolution, plan.to_bytes(), fingerprint=whole)
        compare_protocol(protocol, fresh, out)
    return out.sources[0], protocol, out.diagnostics
