"""The verdict of ``scripts/rig/soak``: which losses a stall of the machine explains."""

import os
import subprocess
import sys

import pytest
from bench.soak import AFTER_NS, Stall, events_of, losses, read_stalls
from live.support import ROOT

MS = 1_000_000
START = 1_000 * MS


def event(now_ms, before="process data", after="reset", name="a"):
    return {
        "event": "connection",
        "now_ns": now_ms * MS,
        "connection": name,
        "before": before,
        "after": after,
        "text": f"{before} -> {after}",
    }


def stall(from_ms, length_ms, cpu=0):
    return Stall(cpu=cpu, from_ns=from_ms * MS, until_ns=(from_ms + length_ms) * MS)


def judged(events, stalls):
    return losses(events, stalls, {"a": 90 * MS, "b": 190 * MS}, START)


@pytest.mark.parametrize(
    ("stalls", "explained"),
    [
        pytest.param([], False, id="no stall"),
        pytest.param([stall(1_900, 90)], True, id="as long as what is left of the watchdog"),
        pytest.param([stall(1_900, 89)], False, id="shorter"),
        pytest.param([stall(1_900, 80), stall(1_980, 80)], False, id="two short ones"),
        pytest.param([stall(1_950, 100)], True, id="it goes on"),
        pytest.param([stall(2_001, 500)], False, id="after the loss"),
        pytest.param([stall(900, 99)], False, id="more than a second before"),
        pytest.param([stall(900, 100)], True, id="a second before"),
        pytest.param([stall(1_900, 40), stall(1_850, 120, cpu=1)], True, id="of another CPU"),
    ],
)
def test_a_stall_longer_than_the_watchdog_explains_a_loss(stalls, explained):
    assert AFTER_NS == 1_000 * MS
    (found,) = judged([event(2_000)], stalls)
    assert (found.connection, found.now_ns) == ("a", 2_000 * MS)
    assert (found.stall is not None) == explained


def test_each_connection_has_its_own_watchdog():
    short, long = judged([event(2_000), event(2_000, name="b")], [stall(1_900, 100)])
    assert short.stall == stall(1_900, 100)
    assert long.stall is None


def test_the_longest_stall_is_named():
    (found,) = judged([event(2_000)], [stall(1_800, 100), stall(1_850, 130, cpu=1)])
    assert found.stall == stall(1_850, 130, cpu=1)


def test_other_events_are_not_counted_as_losses():
    others = [
        event(999),
        event(2_000, after="failsafe data"),
        event(2_000, before="reset", after="process data"),
        event(2_000, before="session", after="connection"),
        {"event": "wkc", "now_ns": 2_000 * MS},
    ]
    assert judged(others, []) == []
    assert len(judged([*others, event(2_000, before="failsafe data", after="silent")], [])) == 1


def test_only_stalls_are_read_of_a_watcher():
    assert read_stalls(3, "watching\n5 9\n20 31\n") == [
        Stall(cpu=3, from_ns=5, until_ns=9),
        Stall(cpu=3, from_ns=20, until_ns=31),
    ]


def test_only_events_are_read_of_a_log(tmp_path):
    log = tmp_path / "log"
    log.write_text('{"event":"state"}\nno JSON\n{"other":1}\n', "utf-8")
    assert events_of(log) == [{"event": "state"}]


def test_the_page_has_each_option():
    page = (ROOT / "docs/development/soak.md").read_text("utf-8")
    said = subprocess.run(
        [sys.executable, ROOT / "tests/bench/soak.py", "--help"],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": f"{ROOT}:{ROOT}/tests"},
    )
    for option in ("seconds", "--cpu", "--copies"):
        assert option in said.stdout
        assert option in page.replace("SECONDS", "seconds")
