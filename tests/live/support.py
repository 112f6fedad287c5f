"""What tests of runs share: sessions of the examples, and a mark for tests that need the core."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

import pytest

from fsoe_net.formats.own.network import load_network
from fsoe_net.live.result import Run
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.project.simulate import prepare
from fsoe_net.simulate.session import Session, run_virtual

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
ESTOP = EXAMPLES / "estop"
ROBOT = EXAMPLES / "el6910"

needs_core = pytest.mark.skipif(
    importlib.util.find_spec("fsoe_net.core._core") is None,
    reason="the compiled core is not built; `pip install -e .` builds it",
)


def resolution_of(folder: Path) -> Resolution:
    """Load one of the examples."""
    network = load_network([folder / "network.yaml"]).network
    assert network is not None
    return resolve(network)


def session_of(
    folder: Path, scenario: str | Path | None = None, *, tmp: Path | None = None
) -> Session:
    """Prepare a virtual session; ``scenario`` is a file, or text that is written to ``tmp``."""
    if isinstance(scenario, str):
        assert tmp is not None
        path = tmp / "scenario.yaml"
        path.write_text("version: 1\n" + scenario, "utf-8")
        scenario = path
    file = None if scenario is None else str(scenario)
    return prepare(resolution_of(folder), None, file, virtual=True)


def run(folder: Path, scenario: str | Path | None = None, *, tmp: Path | None = None) -> Run:
    """Run in virtual time to the end of the scenario."""
    session = session_of(folder, scenario, tmp=tmp)
    return run_virtual(session, session.duration_ns)


def document(result: Run) -> dict[str, Any]:
    """Return the JSON document of a run, as a reader gets it."""
    loaded: dict[str, Any] = json.loads(json.dumps(result.to_json("0")))
    return loaded
