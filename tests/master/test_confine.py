"""What the running program has given up, by what the kernel says of its threads."""

from __future__ import annotations

from pathlib import Path

from master.rig import running

IPC_LOCK, DAC_OVERRIDE, NET_RAW = 1 << 14, 1 << 1, 1 << 13
FILTERED = "2"


def status_of(thread: Path) -> dict[str, str]:
    rows = (line.partition(":") for line in (thread / "status").read_text().splitlines())
    return {key: value.strip() for key, _, value in rows}


def test_every_thread_is_filtered_and_those_of_the_clients_have_no_capability(
    tmp_path: Path,
) -> None:
    """Before and after a restart of the bus, which makes threads anew."""
    options = ["--intervention-log", str(tmp_path), "--incidents", str(tmp_path)]
    with running(*options) as master, master.client() as client:
        client.good("events on")
        for _ in range(2):
            threads = sorted(Path(f"/proc/{master.process.pid}/task").iterdir())
            rows = {thread.name: status_of(thread) for thread in threads}
            assert len(rows) >= 4  # clients, log, bus, cycle
            assert {row["Seccomp"] for row in rows.values()} == {FILTERED}
            assert {row["NoNewPrivs"] for row in rows.values()} == {"1"}
            mine = rows[str(master.process.pid)]
            for key in ("CapEff", "CapPrm", "CapInh", "CapAmb"):
                assert int(mine[key], 16) & ~(IPC_LOCK | DAC_OVERRIDE) == 0
            with_raw = [row for row in rows.values() if int(row["CapEff"], 16) & NET_RAW]
            assert len(with_raw) <= 2  # the bus and its cycle
            client.good("restart")
            while client.event("state")["state"] != "running":
                pass
        client.good("incident files_are_written")
        assert client.event("incident")["whole"]
