"""Debian's Prometheus scrapes ten emulated masters; the dashboard asks it."""

from __future__ import annotations

import contextlib
import json
import socket
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.error import URLError
from urllib.parse import urlencode
from urllib.request import urlopen

import yaml
from fleet.rig import FLEET, exporter_of, prometheus_program
from live.support import needs_core
from master.rig import killed_at_the_end, running
from tied import tied

MASTERS = 10
_VARIABLES = {
    "$instance": ".*", "$master": ".*", "$__range": "1m", "$__rate_interval": "10s",
}  # fmt: skip


@contextlib.contextmanager
def prometheus(folder: Path, target: int) -> Iterator[Callable[[str], list]]:
    """Run Prometheus with the example's file; yields a function that evaluates an expression."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    config = yaml.safe_load((FLEET / "prometheus.yml").read_text("utf-8"))
    config["global"] = {"scrape_interval": "1s", "evaluation_interval": "1s"}
    config["rule_files"] = [str(FLEET / "alerts.yml")]
    config["scrape_configs"][0]["static_configs"] = [{"targets": [f"127.0.0.1:{target}"]}]
    (folder / "p.yml").write_text(yaml.safe_dump(config), "utf-8")
    command = tied(
        prometheus_program("prometheus"),
        f"--config.file={folder / 'p.yml'}",
        f"--storage.tsdb.path={folder / 'data'}",
        f"--web.listen-address={address}",
        "--log.level=error",
    )
    with killed_at_the_end(subprocess.Popen(command)) as process:

        def query(expression: str) -> list:
            url = f"http://{address}/api/v1/query?{urlencode({'query': expression})}"
            while True:
                with contextlib.suppress(URLError, ConnectionError), urlopen(url) as reply:
                    return json.load(reply)["data"]["result"]
                assert process.poll() is None

        yield query


def number(rows: list) -> float | None:
    return float(rows[0]["value"][1]) if rows else None


def until(query: Callable[[str], list], expression: str, expected: float) -> None:
    """Evaluate an expression until it has this value; the time-out of the test ends it."""
    while number(query(expression)) != expected:
        pass


def expressions() -> list[str]:
    """Return the expressions of the dashboard, with values for its variables."""
    panels = json.loads((FLEET / "dashboard.json").read_text("utf-8"))["panels"]
    found = [t["expr"] for p in panels for t in p["targets"]]
    for name, value in _VARIABLES.items():
        found = [expression.replace(name, value) for expression in found]
    return found


@needs_core
def test_ten_masters_of_which_one_ends(tmp_path):
    prometheus_program("prometheus")
    with contextlib.ExitStack() as stack:
        masters = [stack.enter_context(running("--cycle", "10ms")) for _ in range(MASTERS)]
        exporter = stack.enter_context(exporter_of(*(m.path for m in masters)))
        query = stack.enter_context(prometheus(tmp_path, exporter.port))
        until(query, "sum(fsoe_master_up)", MASTERS)
        # The emulated bus has no devices: connections exist, and none is in Data.
        per_master = len(query('fsoe_connection_in_data{master="m3"}'))
        assert per_master > 0
        until(query, "count(fsoe_connection_in_data)", MASTERS * per_master)
        until(query, "count(rate(fsoe_bus_cycles_total[10s]) > 0)", MASTERS)
        until(query, 'count(ALERTS{alertname="FsoeHealthError"}) > bool 0', 1)
        answers = {e: query(e) for e in expressions()}
        masters[3].process.kill()
        until(query, 'fsoe_master_up{master="m3"}', 0)
        # Prometheus marks the values as ended at once, instead of showing them for five minutes.
        until(query, 'count({__name__=~"fsoe_.*", master="m3"})', 3)
        until(query, 'count(ALERTS{alertname="FsoeMasterDown", master="m3"})', 1)
        assert number(query("sum(fsoe_master_up)")) == MASTERS - 1
    # Without devices there is no Reset, and no FSoE cycle whose length could be shown.
    silent = ("resets_by_cause", "watchdog_margin", "cycle_mean", "cycle_longest")
    empty = [e for e, rows in answers.items() if not rows]
    assert [e for e in empty if not any(word in e for word in silent)] == []
