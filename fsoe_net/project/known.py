"""Items with a fingerprint: a network, a plan, an acceptance record, or a fingerprint in JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.pause import without_collector
from fsoe_net.errors import InputError
from fsoe_net.formats.own.acceptance import is_acceptance, load_acceptance
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.files import STDIN, Collector, read_bytes
from fsoe_net.formats.shared.limits import MAX_PLAN_BYTES
from fsoe_net.model.acceptance import Acceptance
from fsoe_net.model.network import SourceFile
from fsoe_net.model.safety import SafetyFunction
from fsoe_net.plan.accepted import accepted_plan
from fsoe_net.plan.codec import MAGIC, decode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import (
    Fingerprint,
    canonical_section,
    fingerprint_from_json,
    fingerprint_of,
    safety_text,
)
from fsoe_net.plan.model import Plan
from fsoe_net.project.check import check_files, whole_network


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """An item with its fingerprint, and its underlying data as far as available.

    Attributes:
        path: Path given by the user.
        fingerprint: Its fingerprint.
        plan: Its tables; ``None`` for a fingerprint alone.
        functions: Its safety functions; ``None`` if only their hash is known.
    """

    path: str
    fingerprint: Fingerprint
    plan: Plan | None = None
    functions: tuple[SafetyFunction, ...] | None = None

    @property
    def name(self) -> str:
        """The path as a person reads it."""
        return "standard input" if self.path == STDIN else self.path

    def section_text(self, name: str) -> str | None:
        """Return the canonical text of a section, or ``None`` if only its hash is known."""
        if name == "safety_functions":
            return None if self.functions is None else safety_text(self.functions)
        return None if self.plan is None else canonical_section(self.plan, name)


@dataclass(frozen=True, slots=True, kw_only=True)
class AcceptedRecord:
    """An acceptance record with its plan, and the fingerprint calculated from that plan."""

    source: SourceFile
    record: Acceptance
    plan: Plan
    fingerprint: Fingerprint


@without_collector
def read_known(
    files: Sequence[str],
    loading: LoadOptions | None = None,
    *,
    refusal: str = "no fingerprint",
) -> Known:
    """Read a plan, a record, a fingerprint in JSON, or the files of a network, by content.

    Raises:
        InputError: The files cannot be read, or the network has an error.
    """
    path = ", ".join(files)
    if len(files) == 1:
        out = Collector()
        data = read_bytes(files[0], out, most=MAX_PLAN_BYTES)
        if data is None:
            raise InputError(f"{path} cannot be read", out.diagnostics)
        if is_acceptance(data):
            return known_record(path, read_record(path))
        try:
            if data.startswith(MAGIC):
                return _of_plan(path, decode_plan(data))
            if data.lstrip()[:1] == b"{":
                return Known(path=path, fingerprint=fingerprint_from_json(_document(data)))
        except InputError as exc:
            raise InputError(f"{path}: {exc}") from exc
    checked = check_files(files, loading, timed=False)
    resolution = whole_network(checked, refusal)
    plan = compile_plan(resolution)
    return Known(
        path=path,
        fingerprint=fingerprint_of(plan),
        plan=plan,
        functions=resolution.network.safety_functions,
    )


def read_record(path: str) -> AcceptedRecord:
    """Read an acceptance record whose fingerprint is that of its plan.

    Raises:
        InputError: The file cannot be read, or is inconsistent.
    """
    out = Collector()
    record = load_acceptance(path, out)
    held = None if record is None else accepted_plan(record, out)
    if record is None or held is None:
        raise InputError(f"{path} is not an acceptance record that can be used", out.diagnostics)
    plan, fingerprint = held
    return AcceptedRecord(source=out.sources[0], record=record, plan=plan, fingerprint=fingerprint)


def known_record(path: str, found: AcceptedRecord) -> Known:
    """Return the accepted state of a record."""
    functions = found.record.safety_functions
    return Known(path=path, fingerprint=found.fingerprint, plan=found.plan, functions=functions)


def _of_plan(path: str, plan: Plan) -> Known:
    functions = None if plan.safety_sha256 else ()
    return Known(path=path, fingerprint=fingerprint_of(plan), plan=plan, functions=functions)


def _document(data: bytes) -> object:
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as exc:
        raise InputError(f"no JSON document: {exc}") from exc
