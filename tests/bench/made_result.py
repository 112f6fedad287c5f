"""Results of `fsoe-net bench` as data."""

from __future__ import annotations

import json
from pathlib import Path

from live.support import ROOT

from fsoe_net.bench.result import Measured

SCHEMA = json.loads((ROOT / "schemas/bench.schema.json").read_text("utf-8"))


def result(**values: object) -> dict:
    times = {"count": 10, "p50_ns": 1000, "p99_ns": 2000, "p999_ns": 3000, "max_ns": 4000}
    host = {
        "kernel": "6.1", "processor": "p", "cpus": 4, "warnings": 1, "realtime": True,
        "others_share": 0.02,
    }  # fmt: skip
    return {
        "bench": 1, "version": "0.1.0", "utc": "2026-11-28T12:00:00Z", "host": host,
        "cycle_ns": 1_000_000, "seconds": 1.0, "emulated_per_s": 9000.0,
        "times": {name.value: times for name in Measured},
    } | values  # fmt: skip


def write(path: Path, row: object) -> str:
    path.write_text(json.dumps(row), "utf-8")
    return str(path)
