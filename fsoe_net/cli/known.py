"""What has a fingerprint: a network, a plan, or the JSON document of a fingerprint."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

from fsoe_net.cli.inputs import check_files, whole_network
from fsoe_net.diag import without_collector
from fsoe_net.errors import InputError
from fsoe_net.load import Collector, read_bytes
from fsoe_net.plan import (
    MAGIC,
    Fingerprint,
    Plan,
    canonical_section,
    compile_plan,
    decode_plan,
    fingerprint_from_json,
    fingerprint_of,
    safety_text,
)

__all__ = ["Known", "read_known"]

_MOST_BYTES = 64 * 1024 * 1024  # as fsn-master takes plans


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """One thing with its fingerprint, and as much of what stands behind it as there is.

    Attributes:
        path: As the user named it.
        fingerprint: Its fingerprint.
        plan: Its tables; ``None`` for a fingerprint alone.
        safety: The text of its safety functions; ``None`` where only their hash is known.
    """

    path: str
    fingerprint: Fingerprint
    plan: Plan | None = None
    safety: str | None = None

    def section_text(self, name: str) -> str | None:
        """Return the canonical text of a section, ``None`` where only its hash is known."""
        if name == "safety_functions":
            return self.safety
        return None if self.plan is None else canonical_section(self.plan, name)


@without_collector
def read_known(
    files: Sequence[str],
    *,
    packages: dict[str, str] | None = None,
    xacro_args: dict[str, str] | None = None,
    refusal: str = "no fingerprint",
) -> Known:
    """Read a plan, a fingerprint in JSON, or the files of a network; known by content.

    Raises:
        InputError: It cannot be read, or the network has an error.
    """
    path = ", ".join(files)
    if len(files) == 1:
        out = Collector()
        data = read_bytes(files[0], out, most=_MOST_BYTES)
        if data is None:
            raise InputError(f"{path} cannot be read", out.diagnostics)
        try:
            if data.startswith(MAGIC):
                return _of_plan(path, decode_plan(data))
            if data.lstrip()[:1] == b"{":
                return Known(path=path, fingerprint=fingerprint_from_json(_document(data)))
        except InputError as exc:
            raise InputError(f"{path}: {exc}") from exc
    checked = check_files(files, packages=packages, xacro_args=xacro_args, timed=False)
    resolution = whole_network(checked, refusal)
    plan = compile_plan(resolution)
    return Known(
        path=path,
        fingerprint=fingerprint_of(plan),
        plan=plan,
        safety=safety_text(resolution.network.safety_functions),
    )


def _of_plan(path: str, plan: Plan) -> Known:
    safety = "" if plan.safety_sha256 else canonical_section(plan, "safety_functions")
    return Known(path=path, fingerprint=fingerprint_of(plan), plan=plan, safety=safety or None)


def _document(data: bytes) -> object:
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as exc:
        raise InputError(f"no JSON document: {exc}") from exc
