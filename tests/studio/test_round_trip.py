"""What is drawn in the page is what the network means, for the networks of the examples."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from fsoe_net.studio.workspace import Workspace

EXAMPLES = Path(__file__).parents[2] / "examples"
NETWORKS = sorted(p.parent.name for p in EXAMPLES.glob("*/network.yaml"))


@pytest.mark.parametrize("name", NETWORKS)
def test_every_connection_is_drawn_again_as_it_was(tmp_path: Path, name: str) -> None:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    workspace = Workspace(str(tmp_path / "examples" / name / "network.yaml"))
    before = workspace.text
    drawn = workspace.checked.resolution.connections
    facts = {(c.main.name, c.sub.name, c.slot): c.stated for c in drawn}
    for _ in drawn:
        workspace.change(workspace.version, {"change": "disconnect", "connection": 0})
    assert workspace.checked.resolution.connections == ()
    kept = [line for line in before.splitlines() if line.startswith("#")]
    assert [line for line in workspace.text.splitlines() if line.startswith("#")] == kept
    for c in drawn:
        ends = {"main": c.main.name, "slot": c.slot, "sub": c.sub.name, "sub_slot": c.sub_slot}
        workspace.change(workspace.version, {"change": "connect", **ends})
    for number, c in enumerate(workspace.checked.resolution.connections):
        stated = facts[c.main.name, c.sub.name, c.slot]
        for key in ("address", "connection_id", "watchdog_ms"):
            change = {"change": "set", "connection": number, "key": key}
            workspace.change(workspace.version, {**change, "value": getattr(stated, key)})
        workspace.change(workspace.version, {"change": "confirm", "connection": number})
    again = workspace.checked.resolution.connections
    assert {(c.main.name, c.sub.name, c.slot, c.sub_slot) for c in again} == {
        (c.main.name, c.sub.name, c.slot, c.sub_slot) for c in drawn
    }
    assert [d for d in workspace.checked.diagnostics if d.level.value == "error"] == []
    for sub in workspace.checked.resolution.network.subdevices:
        change = {"change": "place", "subdevice": sub.name, "position": sub.position + 100}
        workspace.change(workspace.version, change)
    moved = workspace.checked.resolution.network.subdevices
    assert all(sub.position >= 100 for sub in moved)
    while workspace.can_undo:
        workspace.undo(workspace.version)
    assert workspace.text == before
