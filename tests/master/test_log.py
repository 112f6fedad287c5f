"""The log of fsn-master: nobody waits for who reads it, and what was lost is told."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from master.rig import ROOT, Client, JsonObject, killed_at_the_end, program, when_it_listens
from tied import tied

from fsoe_net.formats.own.network import load_network
from fsoe_net.model.resolve import resolve
from fsoe_net.plan.compile import compile_plan

PAGE_BYTES = 4096


def plan_with_long_names(folder: Path) -> Path:
    network = shutil.copytree(ROOT / "examples" / "el6910", folder / "el6910") / "network.yaml"
    text = network.read_text("utf-8")
    for name in ("drive_1", "drive_2"):
        text = text.replace(name, name.ljust(200, "_"))
    network.write_text(text, "utf-8")
    plan = folder / "n.fsnplan"
    plan.write_bytes(compile_plan(resolve(load_network([network]).network)).to_bytes())
    return plan


def drained(end: int) -> bytes:
    """Return what is in a pipe now."""
    found = b""
    try:
        while more := os.read(end, 1 << 16):
            found += more
    except BlockingIOError:
        pass
    return found


def outputs_of(client: Client) -> list[str]:
    rows = client.good("symbols")["symbols"]
    return [r["name"] for r in rows if r.get("open") and not r["restart_relevant"]]


def fall_back(path: Path, told: Client, names: list[str], log: int | None = None) -> JsonObject:
    """Write outputs and go: an event with all their names, for which the log has room."""
    with Client(path) as writer:
        writer.good("lease 0")
        for name in names:
            writer.good(f"set {name}=1")
            if log is not None:
                drained(log)  # a line for each output that is taken
        if log is not None:
            told.good("status")
            told.events.clear()
    while True:
        told.events.append(told.line())
        if told.events[-1]["event"] == "fallback":
            return told.events[-1]


def until_the_end(told: Client) -> None:
    with contextlib.suppress(EOFError, ConnectionResetError):
        while True:
            told.events.append(told.line())


def test_an_unread_log_delays_nothing_and_counts_lost_lines() -> None:
    end, start = os.pipe()
    fcntl.fcntl(start, fcntl.F_SETPIPE_SZ, PAGE_BYTES)
    os.set_blocking(end, False)
    with tempfile.TemporaryDirectory(prefix="fsn-") as text:
        path = Path(text) / "s"
        words = [
            program(),
            plan_with_long_names(Path(text)),
            "--bus",
            "emulated",
            "--policy",
            "other",
        ]
        process = subprocess.Popen(tied(*words, "--socket", path, "--log", "json"), stderr=start)
        os.close(start)
        with killed_at_the_end(process), when_it_listens(path, process) as told:
            told.good("events on")
            while told.good("status")["state"] != "running":
                pass
            names = outputs_of(told)
            fall_back(path, told, names[:1])
            log = drained(end)  # all so far: events come behind their lines
            told.events.clear()
            long = fall_back(path, told, names, end)
            assert len(json.dumps(long)) > PAGE_BYTES
            for _ in range(50):
                fall_back(path, told, names[:1])
            log = b""
            while b"were lost" not in log:  # said with the next line that there is room for
                fall_back(path, told, names[:1])
                log += drained(end)
            os.set_blocking(end, True)
            told.good("shutdown")
            until_the_end(told)
            while more := os.read(end, 1 << 16):
                log += more
    os.close(end)
    lines = [json.loads(line) for line in log.splitlines()]
    assert long in lines
    lost = next(line for line in lines if "were lost" in line["text"])
    count = int(lost["text"].split()[-1])
    assert lost == {
        "event": "log",
        "utc": lost["utc"],
        "level": "warning",
        "text": f"lines of this log that were lost unread: {count}",
    }
    kept = [line for line in lines if line["event"] != "log"]
    assert len(kept) + count == len(told.events)
