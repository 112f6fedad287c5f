"""Recordings made by our own ends, in the form of §13."""

from __future__ import annotations

import json

from fsoe.pair import Bench


def row_of(bench: Bench, n: int, rx: tuple, tx: tuple, **changes) -> dict:
    main, sub = bench.main, bench.sub
    return {
        "type": "step",
        "n": n,
        "time_us": n * 1000,
        "commands": [],
        "master_app_out": "0000",
        "slave_app_in": "0000",
        "master_rx": rx[0] and rx[0].hex(),
        "slave_rx": rx[1] and rx[1].hex(),
        "master_tx": tx[0] and tx[0].hex(),
        "slave_tx": tx[1] and tx[1].hex(),
        "master_state": main.state.value,
        "slave_state": sub.state.value,
        "master_event": "none" if n else "by_master",
        "slave_event": "none" if n else "by_master",
        "master_reason": None if n else 0,
        "slave_reason": None if n else 0,
        "master_pd_valid": main.data_valid,
        "slave_pd_valid": sub.data_valid,
        "safe_inputs": main.received_safe_data.hex(),
        "safe_outputs": sub.received_safe_data.hex(),
        "master_session_id": "0x1122",
        "slave_session_id": "0x3344",
    } | changes


CONFIG = {
    "type": "config",
    "slave_address": 0x1234,
    "connection_id": 0xABCD,
    "master_session_id": 0x1122,
    "slave_session_id": 0x3344,
    "watchdog_ms": 20,
    "app_params": "",
    "out_size": 2,
    "in_size": 2,
    "bus_cycle_us": 1000,
    "master_impl": "A",
    "slave_impl": "A",
}


def own_run(cycles: int, bench: Bench | None = None) -> tuple[Bench, list[dict]]:
    bench = bench or Bench()
    rows = []
    for n in range(cycles):
        bench.now_ns = n * 1_000_000
        to_main = bench.to_main
        sent = bench.main_turn()
        answer = bench.sub_turn()
        rows.append(row_of(bench, n, (to_main, bench.to_sub), (sent, answer)))
    return bench, rows


def recording_text(rows: list[dict], **config) -> str:
    return "".join(json.dumps(row) + "\n" for row in (CONFIG | config, *rows))
