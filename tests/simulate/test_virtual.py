"""Runs in virtual time: what is observed, what is reported, and that it repeats."""

import itertools
import json
import shutil
from pathlib import Path

import pytest
from live.support import ESTOP, ROBOT, document, needs_core, run, session_of

from fsoe_net.simulate.session import run_virtual

pytestmark = needs_core

NAME = "el1918-ek1914"


@pytest.mark.uncounted
@pytest.mark.parametrize("folder", [ESTOP, ROBOT], ids=["estop", "el6910"])
@pytest.mark.parametrize("scenario", [True, False])
def test_two_runs_give_the_same_bytes(folder: Path, scenario: bool):
    file = folder / "scenario.yaml" if scenario else None
    one, two = (json.dumps(run(folder, file).to_json("0")) for _ in range(2))
    assert one == two


def test_keys_of_the_document():
    """Readers of the JSON rely on these; a change is a change of the documented format."""
    found = document(run(ESTOP, ESTOP / "scenario.yaml"))
    assert sorted(found) == [
        "bus",
        "connections",
        "duration_ms",
        "events",
        "events_lost",
        "expectations",
        "mode",
        "network",
        "plan_sha256",
        "result",
        "stalled_ms",
        "statistics",
        "subdevices",
        "tool",
        "version",
    ]
    assert sorted(found["connections"][0]) == [
        "address",
        "chosen",
        "configured",
        "connection_id",
        "data_to_main",
        "data_to_sub",
        "differs",
        "frames_to_main",
        "frames_to_sub",
        "fsoe_cycle_ms",
        "gaps",
        "last_reset_code",
        "last_reset_text",
        "main",
        "name",
        "net",
        "observed",
        "resets",
        "safe_to_main",
        "safe_to_sub",
        "state",
        "sub",
        "time_to_data_ms",
        "watchdog_ms",
        "wire_state",
        "wrong_to_main",
        "wrong_to_sub",
    ]
    assert sorted(found["events"][0]) == [
        "code", "end", "in_data", "kind", "source", "state", "text", "time_ms",
    ]  # fmt: skip
    assert sorted(found["expectations"][0]) == ["held", "place", "seen", "text"]
    for key in ("cycles", "overruns", "wkc_errors", "latency", "copy"):
        assert key in found["statistics"]


def test_without_a_scenario_reset_is_pressed_once():
    result = run(ESTOP)
    texts = [e.text for e in result.events if e.source in ("run", "el1918")]
    assert texts == ["no scenario: reset pressed once, all connections in Data", "outputs on"]
    (row,) = result.connections
    assert (row.state, row.wire_state, row.resets) == ("data_process", "data_process", 0)
    assert (row.data_to_sub, row.data_to_main) == ("process", "process")
    assert (row.safe_to_sub, row.safe_to_main) == ("03", "03")
    assert row.fsoe_cycle_ms == {"last": 2.0, "min": 2.0, "mean": 2.0, "max": 2.0}
    assert result.passed


def test_values_of_the_statistics():
    result = run(ESTOP)
    assert (result.mode, result.network, result.duration_ms) == ("virtual", "estop", 3000.0)
    s = result.statistics
    assert (s.cycles, s.wkc_errors, s.overruns) == (3000, 0, 0)
    assert s.bytes_copied == 3000 * 12


def test_unplugged_sub_reports_the_watchdog_and_comes_back(tmp_path: Path):
    result = run(
        ESTOP,
        """\
duration_s: 1
steps:
  - {at_ms: 100, press: reset}
  - {at_ms: 200, break: ek1914}
  - {at_ms: 500, heal: ek1914}
expect:
  - {during_ms: [110, 290], state: data_process}
  - {during_ms: [310, 500], safe_outputs: {ek1914.0x7001:01: 0}}
  - {at_ms: 195, max_resets: 0}
  - {at_ms: 499, min_resets: 2}
  - {at_ms: 1000, state: data_failsafe, outputs: off}
""",
        tmp=tmp_path,
    )
    assert [v.seen for v in result.verdicts if not v.held] == []
    codes = [e.code for e in result.events if e.source == NAME and 290 < e.time_ms < 310]
    assert codes == [5, 5]
    assert result.connections[0].last_reset_text == "watchdog expired"
    assert result.statistics.wkc_errors == 300


def test_unplugged_logic_comes_back(tmp_path: Path):
    result = run(
        ESTOP,
        """\
duration_s: 0.8
steps: [{at_ms: 100, press: reset}, {at_ms: 200, break: el1918}, {at_ms: 400, heal: el1918}]
expect:
  - {during_ms: [310, 800], safe_outputs: {ek1914.0x7001:01: 0}}
  - {at_ms: 800, state: data_failsafe}
""",
        tmp=tmp_path,
    )
    assert [v.seen for v in result.verdicts if not v.held] == []


def test_failed_expectation_names_where_what_and_when(tmp_path: Path):
    result = run(
        ESTOP,
        """\
duration_s: 0.2
expect:
  - {at_ms: 100, state: data_process}
  - {during_ms: [50, 200], outputs: on}
  - {at_ms: 100, safe_outputs: {ek1914.0x7001:02: 1}}
  - {at_ms: 100, connection: el1918-ek1914, min_resets: 1}
  - {at_ms: 900, state: data}
  - {at_ms: 100, state: data}
""",
        tmp=tmp_path,
    )
    assert not result.passed
    rows = [
        (v.place.rpartition("scenario.yaml")[2], v.text, v.held, v.seen) for v in result.verdicts
    ]
    assert rows == [
        (
            ":4:5",
            "at 100 ms: every connection in data_process",
            False,
            f"{NAME} was in data_failsafe at 100 ms",
        ),
        (":5:5", "from 50 to 200 ms: outputs on", False, "outputs of el1918 were off at 50 ms"),
        (":6:5", "at 100 ms: ek1914.0x7001:02 = 1", False, "ek1914.0x7001:02 was 0 at 100 ms"),
        (
            ":7:5",
            f"at 100 ms: {NAME} with at least 1 reset",
            False,
            f"{NAME} had 0 resets at 100 ms",
        ),
        (":8:5", "at 900 ms: every connection in data", False, "the run ended before"),
        (":9:5", "at 100 ms: every connection in data", True, ""),
    ]


def test_connection_that_is_not_in_data_at_the_end_is_not_a_pass(tmp_path: Path):
    text = "duration_s: 0.5\nsteps: [{at_ms: 100, break: ek1914}]\n"
    result = run(ESTOP, text, tmp=tmp_path)
    assert result.verdicts == ()
    assert not result.passed
    assert result.connections[0].data_to_sub == "none"


def test_the_scenario_may_want_it_so(tmp_path: Path):
    text = (
        "duration_s: 0.5\nsteps: [{at_ms: 100, break: ek1914}]\n"
        "expect: [{at_ms: 500, safe_outputs: {ek1914.0x7001:01: 0}}]\n"
    )
    assert run(ESTOP, text, tmp=tmp_path).passed


def test_steps_after_the_end_are_reported(tmp_path: Path):
    text = "duration_s: 0.1\nsteps: [{at_ms: 50, press: reset}, {at_ms: 500, release: reset}]\n"
    result = run(ESTOP, text, tmp=tmp_path)
    assert result.events[-1].text == "the run ended before 1 of 2 steps"


def test_too_many_resets(tmp_path: Path):
    text = (
        "duration_s: 0.3\nsteps: [{at_ms: 100, local_reset: el1918-ek1914}]\n"
        "expect: [{at_ms: 99, max_resets: 0}, {at_ms: 250, max_resets: 0}]\n"
    )
    rows = [(v.held, v.seen) for v in run(ESTOP, text, tmp=tmp_path).verdicts]
    assert rows == [(True, ""), (False, f"{NAME} had 1 reset at 250 ms")]


def test_an_expectation_due_after_the_last_step_is_judged(tmp_path: Path):
    """Live, the last step of the devices comes a little before the end of the run."""
    text = (
        "expect: [{at_ms: 60.4, state: data}, {at_ms: 60.4, outputs: on}, {at_ms: 61, state: data}]"
    )
    session = session_of(ESTOP, text + "\n", tmp=tmp_path)
    for number in range(1, 61):
        session.core.cycle(number * 1_000_000)
        session.step_devices(number * 1_000_000)
    seen = [v.seen for v in session.result("live", 60_500_000).verdicts]
    assert seen == ["", "outputs of el1918 were off at 60.5 ms", "the run ended before"]


def test_initial_value_and_chosen_logic(tmp_path: Path):
    result = run(
        ESTOP,
        """\
duration_s: 0.3
initial: {ek1914.0x6001:02: 0}
logic: {inputs: [ek1914.0x6001:01], outputs: [ek1914.0x7001:02]}
steps: [{at_ms: 100, press: reset}]
expect: [{at_ms: 200, safe_outputs: {ek1914.0x7001:01: 0, ek1914.0x7001:02: 1}}]
""",
        tmp=tmp_path,
    )
    assert result.passed
    assert result.connections[0].safe_to_main == "01"


def test_standard_process_data(tmp_path: Path):
    text = (
        "duration_s: 0.1\nsteps:\n"
        "  - {at_ms: 20, set: {ek1914.input_2: 1}, output: {ek1914.output_1: 1}}\n"
    )
    session = session_of(ESTOP, text, tmp=tmp_path)
    result = run_virtual(session, session.duration_ns)
    plan = session.plan
    assert session.core.read_symbol(plan.inputs["ek1914.input_2"]) == 1
    assert session.core.read_symbol(plan.outputs["ek1914.output_1"]) == 1
    sm = session.plan.sync_manager("ek1914", 2)
    assert session.bus.read_outputs(sm)[6] == 1
    assert result.connections[0].state == "data_failsafe"


def test_set_drive_status_no_longer_follows_the_command(tmp_path: Path):
    result = run(
        ROBOT,
        """\
duration_s: 0.5
logic: {inputs: [el1904.0x6001:01], outputs: [drive_1.0x6640:00, drive_2.0x6640:00]}
steps: [{at_ms: 100, press: reset}, {at_ms: 300, set: {drive_1.0x6640:00: 0}}]
""",
        tmp=tmp_path,
    )
    rows = {c.name: c for c in result.connections}
    assert rows["el6910-drive_1"].safe_to_sub[:2] == rows["el6910-drive_2"].safe_to_sub[:2] == "01"
    assert int(rows["el6910-drive_1"].safe_to_main[:2], 16) & 1 == 0
    assert int(rows["el6910-drive_2"].safe_to_main[:2], 16) & 1 == 1


def test_keyboard_interrupt_keeps_the_result(monkeypatch: pytest.MonkeyPatch):
    session = session_of(ESTOP)
    step, seen = session.step_devices, []

    def interrupted(now_ns: int) -> None:
        seen.append(now_ns)
        if len(seen) == 500:
            raise KeyboardInterrupt
        step(now_ns)

    monkeypatch.setattr(session, "step_devices", interrupted)
    result = run_virtual(session, session.duration_ns)
    assert result.duration_ms == 500
    assert result.events[-1].text == "interrupted by the user"


def test_a_reset_of_one_logic_leaves_the_other_off(tmp_path: Path):
    shutil.copytree(ESTOP / "devices", tmp_path / "devices")
    devices = {"logic": "el1918", "stop": "ek1914"}
    subs = [
        f"  - {{name: {kind}_{cell}, position: {place}, config: devices/{config}.yaml}}"
        for place, (cell, (kind, config)) in enumerate(itertools.product("ab", devices.items()))
    ]
    nets = [
        f"  - name: cell_{cell}\n    safety_master: logic_{cell}\n    transfers: []\n"
        f"    connections:\n      - {{main: logic_{cell}, sub: stop_{cell}, address: {number}, "
        f"connection_id: {number}, watchdog_ms: 100}}"
        for number, cell in enumerate("ab", 1)
    ]
    text = "\n".join(["version: 1", "name: two", "cycle_us: 1000", "subdevices:", *subs, "nets:"])
    (tmp_path / "network.yaml").write_text("\n".join([text, *nets, ""]), "utf-8")
    found = run(
        tmp_path,
        "duration_s: 0.6\n"
        "initial: {stop_a.0x6001:01: 1, stop_a.0x6001:02: 1, "
        "stop_b.0x6001:01: 1, stop_b.0x6001:02: 1}\n"
        "steps:\n  - {at_ms: 300, press: logic_b}\n  - {at_ms: 350, release: logic_b}\n"
        "expect:\n  - {at_ms: 500, safe_outputs: {stop_a.0x7001:01: 0, stop_b.0x7001:01: 1}}\n",
        tmp=tmp_path,
    )
    assert found.passed, [v.seen for v in found.verdicts]


LONG_NS = 1_000_000_000


def test_a_run_until_settled_shows_what_a_long_one_shows():
    session = session_of(ESTOP)
    short = run_virtual(session, LONG_NS, until_settled=True)
    long = run_virtual(session_of(ESTOP), LONG_NS)
    assert short.passed
    assert short.duration_ms < long.duration_ms == 1000
    assert short.events == long.events
    (connection,) = short.connections
    assert short.duration_ms >= connection.time_to_data_ms + 2 * connection.watchdog_ms
    session.engine.resets[NAME] = 1
    assert not session.engine.is_settled(LONG_NS)


def test_a_run_without_data_does_not_settle(tmp_path: Path):
    folder = tmp_path / "estop"
    shutil.copytree(ESTOP, folder)
    text = (folder / "network.yaml").read_text("utf-8")
    # A frame takes longer than this from one end to the other and back.
    (folder / "network.yaml").write_text(text.replace("watchdog_ms: 100", "watchdog_ms: 1"))
    found = run_virtual(session_of(folder), LONG_NS, until_settled=True)
    assert (found.passed, found.duration_ms) == (False, 1000)
