"""Metrics of masters whose answers a test sets."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
import yaml
from cli.tool import fsn
from fleet.rig import FLEET, exporter_of, promtool, samples, scrape, value
from live.support import ROOT, needs_core
from live.watched_master import WatchedMaster, direction, subdevice
from master.rig import running

from fsoe_net.fleet import watcher
from fsoe_net.fleet.labels import LABEL_CHARS
from fsoe_net.fleet.metrics import MOST_SUBJECTS
from fsoe_net.live.health import HealthReason
from fsoe_net.testing.fake_master import FakeMaster


@pytest.fixture
def master():
    folder = Path(tempfile.mkdtemp(prefix="fsn-"))  # the path of a socket must be short
    server = WatchedMaster(folder / "s")
    yield server
    server.close()
    shutil.rmtree(folder)


def once(*masters) -> str:
    done = fsn("export", "--once", *(w for m in masters for w in ("--socket", str(m))))
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def until(exporter, is_so):
    """Scrape until the values are as expected."""
    while True:
        found = samples(scrape(exporter.port))
        if is_so(found):
            return found


def test_a_connection_has_its_counters_and_its_margin(master):
    master.wire |= {"to_main": direction(resets=3, wrong=2), "gaps": 4}
    found = samples(once(master.path))
    expected = {
        # Of `WatchedMaster`: the longest cycle is 90 ms, the watchdog 100 ms.
        "fsoe_connection_cycle_longest_seconds": 0.09,
        "fsoe_connection_cycle_mean_seconds": 0.004,
        "fsoe_connection_watchdog_seconds": 0.1,
        "fsoe_connection_watchdog_margin_ratio": pytest.approx(0.1),
        "fsoe_connection_in_data": 1,
        "fsoe_connection_resets_total": 3,
        "fsoe_connection_wrong_crc_frames_total": 2,
        "fsoe_connection_gaps_total": 4,
        "fsoe_connection_parameter_differences": 0,
    }
    assert {name: value(found, name, connection="c1") for name in expected} == expected
    assert value(found, "fsoe_bus_period_seconds") == 0.001
    assert value(found, "fsoe_bus_cycles_total") == 1000


def test_an_unknown_watchdog_has_no_metric(master):
    master.watchdog_ms = None
    found = samples(once(master.path))
    assert value(found, "fsoe_connection_in_data") == 1
    for name in ("fsoe_connection_watchdog_seconds", "fsoe_connection_watchdog_margin_ratio"):
        assert value(found, name) is None


def test_a_connection_without_a_cycle_has_no_margin(master):
    still = {"interval_max_ns": 0, "interval_sum_ns": 0, "intervals": 0}
    master.wire |= {"to_sub": direction(**still), "to_main": direction(**still)}
    found = samples(once(master.path))
    assert value(found, "fsoe_connection_watchdog_seconds") == 0.1
    for name in ("cycle_mean_seconds", "cycle_longest_seconds", "watchdog_margin_ratio"):
        assert value(found, f"fsoe_connection_{name}") is None


def test_wake_ups_are_counted_up_to_each_bound(master):
    # 10 of 8 us, 5 of 16 us, one of 2 ms and more: its bucket begins there.
    found = samples(once(master.path))
    name = "fsoe_bus_wakeup_latency_seconds_bucket"
    bounds = {"1e-05": 10, "2e-05": 15, "0.001": 15, "0.002": 15, "0.005": 16, "+Inf": 16}
    assert {le: value(found, name, le=le) for le in bounds} == bounds
    assert value(found, "fsoe_bus_wakeup_latency_seconds_count") == 16


def test_health_is_that_of_monitor(master):
    master.subdevices = [subdevice("logic"), subdevice("drive", al="SAFEOP", al_code=0x1B)]
    found = samples(once(master.path))
    levels = {
        dict(words)["name"]: level
        for (name, words), level in found.items()
        if name == "fsoe_health_level"
    }
    assert levels == {"": 0, "logic": 0, "drive": 3, "c1": 3}
    reasons = {
        (dict(words)["name"], dict(words)["reason"])
        for name, words in found
        if name == "fsoe_health_reason"
    }
    assert reasons == {
        ("drive", "not_in_op"),
        ("c1", "end_not_in_op"),
        ("c1", "watchdog_reserve"),
    }


def test_an_absent_master_has_no_values_and_the_others_continue(master):
    with FakeMaster() as other, exporter_of(master.path, other.path) as exporter:
        in_data = "fsoe_connection_in_data"
        until(exporter, lambda f: all(value(f, in_data, master=m) == 1 for m in ("m0", "m1")))
        master.close()
        found = until(exporter, lambda f: value(f, "fsoe_master_up", master="m0") == 0)
        of_master = {name for name, words in found if ("master", "m0") in words}
        assert of_master == {"fsoe_master_up", "fsoe_health_level", "fsoe_health_reason"}
        assert value(found, "fsoe_health_reason", master="m0") == 1
        assert value(found, "fsoe_health_reason", reason="master_gone") == 1
        assert value(found, in_data, master="m1") == 1
        master.reopen()
        until(exporter, lambda f: value(f, in_data, master="m0") == 1)


def test_a_view_that_is_too_old_counts_as_missing(master, monkeypatch):
    reader = watcher.MasterWatcher("m", lambda: str(master.path))
    assert reader.look_once().up
    monkeypatch.setattr(watcher, "MAX_AGE_S", -1.0)
    assert not reader.reading().up


def test_a_stopped_bus_has_no_values(master):
    with exporter_of(master.path) as exporter:
        until(exporter, lambda f: value(f, "fsoe_connection_in_data") == 1)
        master.state = "stopped"
        stopped = HealthReason.BUS_STOPPED.key
        found = until(exporter, lambda f: value(f, "fsoe_health_reason", reason=stopped) == 1)
    assert value(found, "fsoe_master_up") == 1
    for name in ("fsoe_connection_in_data", "fsoe_bus_cycles_total", "fsoe_subdevice_in_op"):
        assert value(found, name) is None


def test_resets_are_counted_by_end_and_code(master):
    reset = {"event": "connection", "connection": "c1", "now_ns": 5, "before": "process data"}
    reset |= {"after": "reset", "reset_by": "sub", "level": "detail"}
    name = "fsoe_connection_resets_by_cause_total"
    with exporter_of(master.path) as exporter:
        until(exporter, lambda f: value(f, name, end="sub", code="watchdog") == 0)
        for code in (5, 5, 4, 0x81, 0x92):
            master.tell(**reset, reset_code=code)
        master.tell(**reset | {"connection": "not-in-the-plan"}, reset_code=5)
        found = until(exporter, lambda f: value(f, name, end="sub", code="other") == 2)
    assert value(found, name, end="sub", code="watchdog") == 2
    assert value(found, name, end="sub", code="crc") == 1
    assert sum(v for (n, _), v in found.items() if n == name) == 5


def hostile(master, names):
    """Let the master report connections and SubDevices with these names."""
    master.subdevices = [subdevice(name) for name in names]
    row, planned = master._snapshot()["connections"][0], master._layout()["connections"][0]
    document = master._snapshot() | {
        "connections": [row | {"name": name} for name in names],
        "subdevices": master.subdevices,
    }
    layout = master._layout() | {"connections": [planned | {"name": n} for n in names]}
    master._snapshot = lambda: document
    master._layout = lambda: layout


def test_hostile_names_are_bounded_escaped_and_distinct(master):
    long = "x" * 5000
    hostile(
        master, ['a"} 1\nup 1', "\x1b[31m", "a\\", "", long, f"{long}y", "\ud800", "same", "same"]
    )
    text = once(master.path)
    promtool("check", "metrics", text=text)
    found = samples(text)
    labels = [dict(words)["subdevice"] for name, words in found if name == "fsoe_subdevice_in_op"]
    assert len(set(labels)) == 9
    assert max(map(len, labels)) == LABEL_CHARS
    assert {"same", "same~2", "a\\", "\\u001b[31m"} <= set(labels)
    assert not [c for label in labels for c in label if not c.isprintable()]
    assert value(found, "up") is None


def test_the_number_of_parts_is_bounded(master):
    hostile(master, [f"n{i}" for i in range(MOST_SUBJECTS + 7)])
    found = samples(once(master.path))
    for name in ("fsoe_subdevice_in_op", "fsoe_connection_in_data"):
        assert len([1 for n, _ in found if n == name]) == MOST_SUBJECTS
    assert value(found, "fsoe_master_omitted_subjects") == 14


@needs_core
def test_promtool_accepts_the_metrics_of_a_real_master():
    with running() as master:
        text = once(master.path)
    assert value(samples(text), "fsoe_master_up") == 1
    promtool("check", "metrics", text=text)


def test_promtool_accepts_the_rules_and_each_alert_has_a_case():
    promtool("check", "config", "prometheus.yml")
    promtool("test", "rules", "alerts-test.yml")
    rules = yaml.safe_load((FLEET / "alerts.yml").read_text("utf-8"))["groups"][0]["rules"]
    cases = (FLEET / "alerts-test.yml").read_text("utf-8")
    for rule in rules:
        assert re.search(rf'alertname(: |="){rule["alert"]}\b', cases), rule["alert"]


def test_rules_and_dashboard_use_metrics_that_exist(master):
    names = {name for name, _ in samples(once(master.path))}
    texts = [p.read_text("utf-8") for p in (FLEET / "alerts.yml", FLEET / "dashboard.json")]
    used = set(re.findall(r"\bfsoe_[a-z_]+\b", " ".join(texts)))
    assert used - names == set()
    assert len(used) > 15


def test_the_page_lists_each_metric(master):
    text = once(master.path)
    names = {
        name + "_total" * (kind == "counter" and not name.endswith("_total"))
        for name, kind in re.findall(r"^# TYPE (\S+) (\S+)", text, re.MULTILINE)
    }
    page = (ROOT / "docs/howto/fleet.md").read_text("utf-8")
    assert set(re.findall(r"`(fsoe_[a-z_]+)`", page)) == names


def test_each_panel_of_the_dashboard_has_its_own_place():
    panels = json.loads((FLEET / "dashboard.json").read_text("utf-8"))["panels"]
    cells = [
        (x, y)
        for g in (p["gridPos"] for p in panels)
        for x in range(g["x"], g["x"] + g["w"])
        for y in range(g["y"], g["y"] + g["h"])
    ]
    assert len(cells) == len(set(cells))
    assert max(x for x, _ in cells) < 24
    assert len({p["id"] for p in panels}) == len(panels)


def test_a_missing_package_is_named_with_its_command(tmp_path):
    # A module that fails to import stands for an absent one.
    (tmp_path / "prometheus_client.py").write_text(
        "raise ModuleNotFoundError('no', name='prometheus_client')", "utf-8"
    )
    done = subprocess.run(
        [sys.executable, "-m", "fsoe_net.cli", "export", "--socket", "s"],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 3
    assert done.stderr.startswith("error: export needs prometheus_client, which is not installed; ")
    assert "'prometheus_client>=" in done.stderr


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ((), "give --interface IF or --socket PATH"),
        (("--socket", "a", "--socket", "a"), "one fsn-master is given twice"),
        (("--socket", "a", "--once", "--duration", "1s"), "leave out --duration"),
        (("--socket", "a", "--port", "70000"), "70000"),
    ],
)
def test_usage_errors(words, text):
    done = fsn("export", *words)
    assert done.returncode == 2
    assert text in done.stderr


def test_an_address_that_cannot_be_used_is_reported():
    with exporter_of("s") as exporter:
        done = fsn("export", "--socket", "s", "--port", str(exporter.port))
    assert (done.returncode, done.stdout) == (3, "")
    assert f"127.0.0.1 port {exporter.port}: Address already in use" in done.stderr
    done = fsn("export", "--socket", "s", "--listen", "no such host.invalid")
    assert done.returncode == 3
    assert done.stderr.startswith("error: no such host.invalid port 9977: ")
