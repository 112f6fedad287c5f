"""The test record of a network, executed on an emulated or a live bus."""

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
from fsoe_net.formats.own.test_record import load_test_record
from fsoe_net.formats.own.write_test_record import write_test_record
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.live.client import Client
from fsoe_net.model.network import SourceFile
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.test_record import TestRecord, TestStep
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import Fingerprint, fingerprint_of
from fsoe_net.plan.model import Plan
from fsoe_net.project.check import check_files, whole_network
from fsoe_net.report.test_record_document import render_test_record
from fsoe_net.test_record.live import Person, run_tests_live
from fsoe_net.test_record.steps import compare_test_record, keep_machine, make_test_record
from fsoe_net.test_record.virtual import run_tests_virtual
from fsoe_net.version import __version__


@dataclass(slots=True, kw_only=True)
class Trial:
    """A test record during its execution.

    Attributes:
        resolution: The network.
        plan: Its plan.
        fingerprint: Fingerprint of the plan.
        test_record: The test record with the results so far, even during a run.
    """

    resolution: Resolution
    plan: bytes
    fingerprint: Fingerprint
    test_record: TestRecord

    @classmethod
    def of(
        cls,
        files: Sequence[str],
        loading: LoadOptions | None = None,
        before: TestRecord | None = None,
    ) -> Trial:
        """Return the test record of a network, with people's entries from an earlier one.

        Raises:
            InputError: The network has an error, or no FSoE connection.
        """
        resolution = whole_network(check_files(files, loading), "no test record")
        if not resolution.connections:
            raise InputError("nothing to try: these files hold no FSoE connection")
        compiled = compile_plan(resolution)
        plan, fingerprint = compiled.to_bytes(), fingerprint_of(compiled)
        test_record = make_test_record(resolution, plan, fingerprint=fingerprint.whole)
        test_record = replace(test_record, made=datetime.date.today().isoformat())
        if before is not None:
            test_record = keep_machine(test_record, before)
        return cls(
            resolution=resolution, plan=plan, fingerprint=fingerprint, test_record=test_record
        )

    def run_virtual(self, *, faults: int, on_step: Callable[[str], None] | None = None) -> None:
        """Execute every step on the emulated bus.

        Args:
            faults: FSoE cycles with an injected fault, per class.
            on_step: Called with the name of each step.

        Raises:
            CoreMissing: The compiled part is missing.
        """
        self.test_record = run_tests_virtual(
            self.test_record, self.resolution, self.plan, faults=faults, on_step=on_step
        )

    def run_live(self, socket: str, person: Person, on_step: Callable[[TestStep], None]) -> None:
        """Test each loss on a running ``fsn-master``, with a person who causes it.

        Raises:
            EnvironmentFault: No process answers on the socket, or the connection is lost.
            InputError: ``fsn-master`` runs another configuration.
        """

        def keep(so_far: TestRecord, step: TestStep) -> None:
            self.test_record = so_far
            on_step(step)

        with Client(socket) as client:
            self.test_record = run_tests_live(
                self.test_record,
                self.resolution,
                client,
                person,
                fingerprint=self.fingerprint,
                on_step=keep,
            )

    def save(self, path: str, *, overwrite: bool = False) -> None:
        """Write the test record: a printable page for names in .html or .htm, otherwise YAML.

        Raises:
            InputError: The file exists and must not be replaced.
            EnvironmentFault: The file cannot be written.
        """
        if Path(path).suffix in (".html", ".htm"):
            text = document_html(render_test_record(self.test_record, version=__version__))
        else:
            text = write_test_record(self.test_record)
        write_whole(path, text.encode("utf-8"), overwrite=overwrite)


def read_test_record(
    path: str, resolution: Resolution | None = None, plan: Plan | None = None
) -> tuple[SourceFile, TestRecord, list[Diagnostic]]:
    """Read a test record, and compare it with a network if its plan is given.

    Returns:
        The file, the test record, and the reasons against using its results.

    Raises:
        InputError: The file is not a test record.
    """
    out = Collector()
    test_record = load_test_record(path, out)
    if test_record is None:
        found = summary(out.diagnostics)
        raise InputError(
            f"{path} cannot be taken as a test record, nothing written: {found}", out.diagnostics
        )
    if resolution is not None and plan is not None:
        whole = fingerprint_of(plan).whole
        fresh = make_test_record(resolution, plan.to_bytes(), fingerprint=whole)
        compare_test_record(test_record, fresh, out)
    return out.sources[0], test_record, out.diagnostics
