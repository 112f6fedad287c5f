"""Reads metrics with the parser of `prometheus_client`, and runs programs of Prometheus."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from urllib.request import urlopen

import pytest
from networks import EXAMPLES
from prometheus_client.parser import text_string_to_metric_families

from fsoe_net.fleet.exporter import Exporter

FLEET = EXAMPLES / "fleet"
Samples = dict[tuple[str, frozenset[tuple[str, str]]], float]


def prometheus_program(name: str) -> str:
    """Return the program; absent it skips, but fails where FSN_REQUIRE names ``prometheus``."""
    found = shutil.which(name)
    if found is None:
        if "prometheus" in os.environ.get("FSN_REQUIRE", "").split(","):
            pytest.fail(f"{name} is not installed")
        pytest.skip(f"{name} is not installed: apt install prometheus")
    return found


def promtool(*arguments: object, text: str = "") -> str:
    """Run promtool; it must not complain. Returns what it prints."""
    done = subprocess.run(
        [prometheus_program("promtool"), *map(str, arguments)],
        cwd=FLEET,
        input=text,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    return done.stdout


def exporter_of(*paths: Path | str) -> Exporter:
    """Return an exporter of control sockets, named by their number, on a free port."""
    masters = {f"m{n}": (lambda path=str(path): path) for n, path in enumerate(paths)}
    return Exporter(masters, address="127.0.0.1", port=0)


def scrape(port: int) -> str:
    with urlopen(f"http://127.0.0.1:{port}/metrics") as reply:
        return reply.read().decode()


def samples(text: str) -> Samples:
    """Return each value by name and labels; no name has two values for the same labels."""
    found: Samples = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            key = (sample.name, frozenset(sample.labels.items()))
            assert key not in found
            found[key] = sample.value
    return found


def value(found: Samples, name: str, **labels: str) -> float | None:
    """Return the only value with these labels, or None."""
    rows = [v for (n, words), v in found.items() if n == name and labels.items() <= set(words)]
    assert len(rows) <= 1, (name, labels, rows)
    return rows[0] if rows else None
