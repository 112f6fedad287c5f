"""Reports of the networks that tests have, made without the command line."""

from __future__ import annotations

from pathlib import Path

from fsoe_net.formats.own.library import builtin_library
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import fingerprint_of
from fsoe_net.project.check import check_files
from fsoe_net.report.inputs import ReportInputs
from fsoe_net.timing.budget import make_budget

BASE = Path(__file__).parents[1] / "diagnostics" / "base"
TIMED = BASE / "timed.yaml"

MISTAKES = (
    ("connection_id: 11", "connection_id: 10"),
    ("address: 2,", "address: 1,"),
    ("required_reaction_ms: 300", "required_reaction_ms: 100"),
    ("index: 0xf200, subindex: 1", "index: 0x7000, subindex: 1"),
)
CODES = {"FSN302", "FSN301", "FSN603", "FSN233"}
"""What `MISTAKES` seed, one each."""


def inputs_of(path: Path, **more: object) -> ReportInputs:
    checked = check_files([str(path)], compared=True)
    resolution = checked.resolution
    assert resolution is not None
    plan = compile_plan(resolution)
    values = {
        "name": resolution.network.name,
        "version": "0",
        "diagnostics": checked.diagnostics,
        "resolution": resolution,
        "plan": plan,
        "fingerprint": fingerprint_of(plan),
        "budget": make_budget(resolution, builtin_library()),
    }
    return ReportInputs(**{**values, **more})


def with_mistakes(folder: Path) -> Path:
    """Copy the timed network and seed `MISTAKES`."""
    text = TIMED.read_text("utf-8")
    for find, put in MISTAKES:
        assert find in text
        text = text.replace(find, put)
    path = folder / "bad.yaml"
    path.write_text(text, "utf-8")
    (folder / "devices").symlink_to(BASE / "devices")
    return path
