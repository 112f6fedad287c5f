"""What the statuses say of a bus that is well, resets, stops and comes back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import pytest
import yaml

from fsoe_net.live.attachment import Attachment
from fsoe_net.live.control_values import ClocksStatus
from fsoe_net.live.health import HOLD_S, RecentChanges
from fsoe_net.ros2.diagnostics import RosLevel, RosStatus, ros_statuses
from fsoe_net.testing import fake_master
from fsoe_net.testing.fake_master import FakeMaster

OK, WARN, ERROR, STALE = RosLevel


class Watched:
    """A made-up fsn-master and what its statuses say, at a time of ours."""

    def __init__(self, master: FakeMaster) -> None:
        self.master = master
        self.attachment = Attachment(master.path)
        self.recent = RecentChanges()

    def at(self, now_s: float) -> dict[str, RosStatus]:
        view = self.attachment.look(0.0)
        if view.snapshot is not None:
            view = replace(view, changes=self.recent.take(view.snapshot, now_s))
        return {row.name: row for row in ros_statuses(view)}

    def levels(self, now_s: float) -> dict[str, RosLevel]:
        return {name: row.level for name, row in self.at(now_s).items()}


@pytest.fixture
def watched() -> Iterator[Watched]:
    with FakeMaster() as master:
        watched = Watched(master)
        yield watched
        watched.attachment.close()


def test_all_is_well(watched: Watched) -> None:
    found = watched.at(0.0)
    assert {name: row.level for name, row in found.items()} == {
        "bus": OK,
        "SubDevice drive_1": OK,
        "connection c1": OK,
    }
    assert found["connection c1"].message == "Data · ProcessData"
    values = dict(found["connection c1"].values)
    assert values["MainInstance"] == "logic"
    assert values["connection ID"] == "1"
    assert values["FSoE watchdog ms"] == "not known"
    assert dict(found["bus"].values)["working counter"] == "0 of 0"
    assert dict(found["bus"].values)["period 99.9 % us"] == "1010.0"


@pytest.mark.parametrize(
    ("state", "level", "text"),
    [
        (1, ERROR, "Reset; not in Data"),
        (2, ERROR, "Session; not in Data"),
        (4, ERROR, "Parameter; not in Data"),
        (5, WARN, "Data · FailSafeData; not ProcessData in both directions"),
        (6, OK, "Data · ProcessData"),
        (0, ERROR, "Silent; not in Data"),
    ],
)
def test_each_state_has_its_level(watched: Watched, state: int, level: RosLevel, text: str) -> None:
    watched.master.connection_state = state
    row = watched.at(0.0)["connection c1"]
    assert (row.level, row.message) == (level, text)


def test_a_reset_that_is_over_already_is_an_error_for_a_time(
    watched: Watched, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(fake_master.DIRECTION, "resets", 3)
    assert watched.levels(0.0)["connection c1"] is OK  # before anybody looked
    monkeypatch.setitem(fake_master.DIRECTION, "resets", 4)
    monkeypatch.setitem(fake_master.DIRECTION, "reset_code", 6)
    row = watched.at(1.0)["connection c1"]
    assert row.level is ERROR
    assert "last Reset: both ends sent: " in row.message
    assert watched.levels(1.0 + HOLD_S * 0.99)["connection c1"] is ERROR
    assert watched.levels(1.0 + HOLD_S)["connection c1"] is OK
    monkeypatch.setitem(fake_master.DIRECTION, "resets", 1)  # the bus was opened again
    assert watched.levels(20.0)["connection c1"] is OK
    monkeypatch.setitem(fake_master.DIRECTION, "resets", 2)
    assert watched.levels(21.0)["connection c1"] is ERROR


@pytest.mark.parametrize(
    ("change", "level", "text"),
    [
        (
            {"al": "SAFEOP+ERROR", "al_code": 0x1B},
            ERROR,
            "SAFEOP+ERROR, AL status code 0x001b: the SubDevice of the plan",
        ),
        ({"detail": "port 1 is open"}, WARN, "port 1 is open"),
        ({"known": False}, STALE, "not known now"),
        ({"al": "none", "found": 9}, OK, "absent, as it may be"),
    ],
)
def test_subdevice_has_level_and_message(
    watched: Watched,
    monkeypatch: pytest.MonkeyPatch,
    change: dict[str, object],
    level: RosLevel,
    text: str,
) -> None:
    for key, value in change.items():
        monkeypatch.setitem(fake_master.SUBDEVICE, key, value)
    found = watched.at(0.0)
    row = found["SubDevice drive_1"]
    assert (row.level, row.message) == (level, text)
    if level is OK:
        assert found["connection c1"].level is OK
        assert "one of its SubDevices is absent, as planned" in found["connection c1"].message


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("overruns", "late cycles in the last 5 s"),
        ("wkc_errors", "working counter incomplete in the last 5 s"),
        ("lost_frames", "frames lost in the last 5 s"),
    ],
)
def test_the_cycle_is_a_warning_for_a_time_after_a_counter_rose(
    watched: Watched, monkeypatch: pytest.MonkeyPatch, name: str, text: str
) -> None:
    monkeypatch.setitem(fake_master.STATISTICS, name, 7)
    assert watched.levels(0.0)["bus"] is OK
    monkeypatch.setitem(fake_master.STATISTICS, name, 8)
    row = watched.at(0.1)["bus"]
    assert (row.level, row.message) == (WARN, text)
    assert watched.levels(0.1 + HOLD_S)["bus"] is OK


@pytest.mark.parametrize(
    ("part", "state", "text"),
    [
        ("ring", "closed", ""),
        ("ring", "open", "ring open"),
        ("ring", "one way", "ring one way"),
        ("clocks", "synchronous", ""),
        ("clocks", "unknown", ""),
        ("clocks", "apart", "distributed clocks apart"),
        ("clocks", "no reference", "distributed clocks no reference"),
    ],
)
def test_ring_and_clocks_are_a_warning_while_they_are_not_as_they_should_be(
    watched: Watched, monkeypatch: pytest.MonkeyPatch, part: str, state: str, text: str
) -> None:
    rows = {
        "ring": {"state": state, "ways": [1, 1], "breaks": 0, "place": ""},
        "clocks": {f.name: 0 for f in fields(ClocksStatus)}
        | {"state": state, "set_by": "bus", "reference": "a", "place": ""},
    }
    monkeypatch.setitem(fake_master.STATUS, part, rows[part])
    row = watched.at(0.0)["bus"]
    running = "running, working counter complete"
    assert (row.level, row.message) == ((WARN, text) if text else (OK, running))


def test_a_working_counter_that_is_incomplete_now_is_an_error(
    watched: Watched, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(fake_master.STATISTICS, "expected_wkc", 9)
    row = watched.at(0.0)["bus"]
    assert (row.level, row.message) == (ERROR, "working counter 0 of 9")


def test_a_stopped_bus_makes_everything_stale(watched: Watched) -> None:
    watched.at(0.0)
    watched.master.state = "stopped"
    found = watched.at(1.0)
    assert (found["bus"].level, found["bus"].message) == (WARN, "the bus does not run (stopped)")
    assert found["connection c1"].level is found["SubDevice drive_1"].level is STALE
    assert found["connection c1"].message == "Data · ProcessData; not current, last known values"
    watched.master.state = "failed"
    assert watched.levels(2.0)["bus"] is ERROR


def test_an_fsn_master_that_is_gone_is_an_error(watched: Watched) -> None:
    watched.at(0.0)
    watched.master.close()
    found = watched.at(1.0)
    assert found["bus"].level is ERROR
    assert found["bus"].message.startswith("fsn-master does not answer: ")
    assert found["connection c1"].level is STALE


def test_the_aggregator_has_each_status_in_one_group(watched: Watched) -> None:
    """`GenericAnalyzer` takes the statuses whose name begins with one of its texts."""
    package = Path(__file__).parents[2] / "ros" / "fsoe_net_ros"
    config = yaml.safe_load((package / "config" / "diagnostics.yaml").read_text("utf-8"))
    groups = [g for g in config["analyzers"]["ros__parameters"].values() if isinstance(g, dict)]
    names = {*watched.at(0.0), "joints", "control"}
    assert len(names) > 4
    for name in names:
        fits = [g for g in groups if f"fsoe_net: {name}".startswith(tuple(g["startswith"]))]
        assert len(fits) == 1, name
