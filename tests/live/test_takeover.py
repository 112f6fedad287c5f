"""`fsn-master --take-over` and `--standby`: a bus goes from one process to the next, on a wire."""

import statistics
import subprocess

import pytest
from live.on_the_wire import ATTEMPTS, REQUIRED, on_the_wire, why_not
from live.support import EXAMPLES
from wires import run_program

ROBOT = str(EXAMPLES / "el6910" / "network.yaml")
ESTOP = str(EXAMPLES / "estop" / "network.yaml")


def case(name, tmp, *networks, good=lambda _: True):
    return on_the_wire(name, *networks, tmp=tmp, good=good, script="live/takeover_rig.py")


def check_one_after_the_other(seen, take_overs):
    """No frame of a process reached the SubDevices after the first of the next one."""
    assert (seen["changes"], seen["senders"]) == (take_overs, take_overs + 1)
    assert set(seen["al"]) == {"OP"}
    assert seen["data"]


def undisturbed(seen):
    """On a busy machine a watchdog may bite, of EtherCAT or FSoE: then it is tried again."""
    left = seen.get("left") or set(seen["al"]) != {"OP"}
    return seen["data"] and not any(seen["returns"]) and not left


def test_three_take_overs_under_load(tmp_path):
    seen = case("planned", tmp_path, ROBOT, good=undisturbed)
    check_one_after_the_other(seen, 3)
    assert seen["codes"] == [0, 0, 0]
    assert seen["cycles"] == sorted(set(seen["cycles"]))  # it counts on
    assert statistics.median(seen["gaps"]) < 100  # cycles; far below is the rule
    assert [e for e in seen["events"] if e in ("start", "stop")] == ["start", "stop"] * 4
    assert "unfinished" not in seen["events"]


def test_outputs_of_a_client_fall_back(tmp_path):
    seen = case("output", tmp_path, ROBOT, good=undisturbed)
    check_one_after_the_other(seen, 1)
    assert seen["fallen"] == 8


def test_a_different_plan_is_rejected_before_the_bus_is_touched(tmp_path):
    seen = case("refused", tmp_path, ROBOT, ESTOP, good=undisturbed)
    check_one_after_the_other(seen, 1)
    assert set(seen["codes"].values()) == {1}
    said = {
        "nobody": "near: no fsn-master drives this interface and takes a successor",
        "plan": "it has another plan; a take-over keeps the plan, another one needs a stop",
        "cycle": "it has another --cycle, --dc-every, --dc-clock or --dc-shift; they belong",
        "lock": "another process answers on s; stop that fsn-master",
    }
    for name, text in said.items():
        assert text in seen["texts"][name]


def test_nonsense_at_the_lock_disturbs_no_one(tmp_path):
    seen = case("hostile", tmp_path, ROBOT, good=undisturbed)
    check_one_after_the_other(seen, 1)


def test_a_successor_that_is_silent_is_the_only_one_until_it_ends(tmp_path):
    seen = case("undecided", tmp_path, ROBOT, good=undisturbed)
    check_one_after_the_other(seen, 1)
    assert seen["code"] == 1
    assert "another one follows already, or has not ended yet" in seen["text"]


@pytest.mark.shows("R1")
def test_a_former_that_is_frozen_is_left_alone_and_thaws(tmp_path):
    # On a busy machine somebody may leave OP once more.
    seen = case("frozen", tmp_path, ROBOT, good=lambda s: s["data"] and set(s["al"]) == {"OP"})
    check_one_after_the_other(seen, 0)
    assert seen["code"] == 1
    assert "the take-over is refused, and the predecessor continues" in seen["text"]


def test_a_standby_takes_over_from_a_frozen_process_that_thaws_later(tmp_path):
    seen = case("standby_output", tmp_path, ROBOT, good=undisturbed)
    check_one_after_the_other(seen, 2)
    assert seen["named"]
    assert seen["code"] == -9  # it never came to send again
    assert seen["fallen"] == 8


def test_a_frozen_standby_that_blocks_the_bus_is_named(tmp_path):
    seen = case("frozen_standby", tmp_path, ROBOT)
    assert seen["code"] == 1
    assert (
        f"near is held by pid {seen['standby']} (fsn-master), uid 0 (root) since " in seen["text"]
    )
    assert ", stopped: secure the machine, then end it with SIGKILL" in seen["text"]
    check_one_after_the_other(seen, 1)


def test_in_maintenance_nothing_is_taken_over(tmp_path):
    seen = case("maintenance", tmp_path, ROBOT)
    assert seen["states"] == ["standby", False]
    assert seen["senders"] == 2  # one process, which opened the bus twice
    assert seen["codes"] == [0, 1]
    assert "ended in maintenance: nothing is taken over" in seen["text"]


def no_priority():
    """Why a process of this user has no real-time priority; empty when it may have one."""
    done = subprocess.run(["chrt", "-f", "10", "true"], capture_output=True, text=True, check=False)
    return done.stderr


@pytest.mark.weekly
def test_a_few_kills(tmp_path):
    """`scripts/rig/standby-kills`, short: no connection leaves Data, one sends at a time."""
    if why := why_not() or no_priority():
        (pytest.fail if REQUIRED else pytest.skip)(why)
    done = run_program("bench/standby_kills.py", "8", cwd=tmp_path)
    for _ in range(ATTEMPTS - 1):
        if done.returncode == 0:
            break
        done = run_program("bench/standby_kills.py", "8", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("8 take-overs (")
    assert "connections that left Data without such a stall: 0" in done.stdout
