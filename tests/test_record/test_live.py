"""`fsoe-net test-record --live`: a terminal, fsn-master and the emulated segment on a wire."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from live.on_the_wire import on_the_wire
from live.support import ROOT

from fsoe_net.model.test_record import EMULATED_NOTE

TIMED = ROOT / "tests/diagnostics/base/timed.yaml"
WATCHDOG_MS = 2000.0


@pytest.fixture(name="network")
def slow(tmp_path: Path) -> Path:
    """A bus that a busy machine keeps up with."""
    text = TIMED.read_text("utf-8")
    for before, after in (
        ("cycle_us: 1000", "cycle_us: 10000"),
        ("watchdog_ms: 100", f"watchdog_ms: {WATCHDOG_MS:g}"),
        ("required_reaction_ms: 300", "required_reaction_ms: 9000"),
        ("config: devices", f"config: {TIMED.parent}/devices"),
    ):
        assert before in text
        text = text.replace(before, after)
    path = tmp_path / "slow.yaml"
    path.write_text(text, "utf-8")
    return path


def live_of(seen: dict[str, str]) -> dict[str, dict[str, object]]:
    document = yaml.safe_load(seen["file"])
    assert all(not any(step.get("machine", {}).values()) for step in document["steps"])
    assert all(step["emulated"] is None for step in document["steps"])
    return {step["id"]: step["live"] for step in document["steps"] if step["live"]}


def try_test_record(case: str, *networks: Path, tmp: Path, good=lambda _: True):
    names = map(str, networks)
    return on_the_wire(case, *names, tmp=tmp, good=good, script="test_record/live_test_rig.py")


def test_losses_are_asked_for_measured_and_marked(network, tmp_path):
    def good(seen):  # nobody has left OP by itself, on a machine that is late
        return seen["code"] == 0 and "was not in OP" not in seen["file"]

    seen = try_test_record("whole", network, tmp=tmp_path, good=good)
    steps = live_of(seen)
    assert list(steps) == [
        "start-up logic-io",
        "start-up logic-io2",
        "loss io",
        "loss io2",
        "loss logic",
    ]
    for step in steps.values():
        assert step["result"] == "as expected", step["remark"]
        assert step["remark"].startswith(f"{EMULATED_NOTE}: near is not a network card (veth)")
    assert 0 < steps["loss logic"]["measured_ms"] < 2 * WATCHDOG_MS
    assert "bus cycle of 10 ms" in steps["loss logic"]["time_is"]
    # io2 stands before the logic: both ends of its connection are off the bus.
    assert "logic-io2 fell silent with both ends off the bus" in steps["loss io2"]["remark"]
    assert steps["loss io"]["measured_ms"] is None  # the first one of the line: everybody is off
    assert seen["told"].count("Is the area guarded, with no person in it?") == 3
    assert "6 of 6 open at the machine" in seen["told"]


def test_measurements_are_kept_after_an_interruption(network, tmp_path):
    def good(seen):  # nobody has left OP by itself, on a machine that is late
        stayed = "was not in OP" not in seen["left_out"]["file"]
        return stayed and "loss io: as expected" in seen["interrupt"]["told"]

    seen = try_test_record("broken_off", network, tmp=tmp_path, good=good)
    interrupt, left_out, gone = (seen[name] for name in ("interrupt", "left_out", "gone"))
    assert interrupt["code"] == 130
    assert "broken off: test-record.yaml has the 3 steps tried so far" in interrupt["told"]
    assert list(live_of(interrupt)) == ["start-up logic-io", "start-up logic-io2", "loss io"]
    assert TAKE not in left_out["told"]
    assert live_of(left_out)["loss io"] == live_of(interrupt)["loss io"]
    for name in ("io2", "logic"):
        assert "not confirmed" in live_of(left_out)[f"loss {name}"]["remark"]
    assert gone["code"] == 3
    assert live_of(gone) == live_of(left_out)
    assert "Traceback" not in interrupt["told"] + left_out["told"] + gone["told"]


TAKE = "off the bus now"


def test_another_configuration_and_no_one_at_a_terminal(network, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text(network.read_text("utf-8").replace("address: 2", "address: 3"), "utf-8")
    seen = try_test_record("refused", network, other, tmp=tmp_path)
    assert seen["other"]["code"] == 1
    assert "differs in connections" in seen["other"]["told"]
    assert seen["no_terminal"]["code"] == 2
    assert "from a terminal" in seen["no_terminal"]["told"]
    assert not seen["written"]
