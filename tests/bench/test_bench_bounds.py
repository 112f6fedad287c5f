"""The search of bounds with several seeds: on a cluster, interrupted and continued."""

from __future__ import annotations

import os
import signal
from itertools import islice

import cluster_pieces
import pytest
from bench import bench_bounds
from dask_cluster import one_scheduler, three_workers  # noqa: F401 - fixtures
from signal_path.search import GENES, WORKED, attack
from signal_path.seeds import ATTACKS, is_schedule, pieces, run_all, worst_found

from fsoe_net.errors import EnvironmentFault, InputError

SEEDS = range(7, 10)


def test_the_worst_of_several_seeds_is_found(tmp_path):
    worst, _ = bench_bounds.search(50, SEEDS, None, None)
    for at, what in enumerate(ATTACKS):
        rows = [attack(what, WORKED, 50, seed) for seed in SEEDS]
        most = max(row.worst for row in rows)
        first = [row.worst for row in rows].index(most)
        assert worst[at] == (rows[first], SEEDS[first])


@pytest.mark.weekly
def test_a_cluster_finds_the_same_even_if_a_worker_dies(cluster, monkeypatch):
    address, (first, *others) = cluster
    work = pieces(400, SEEDS)
    parts = {}
    for piece, schedule in run_all(work, address):
        if not parts:
            os.kill(first.pid, signal.SIGKILL)
            first.wait()
        parts[piece] = schedule
    assert [process.poll() for process in others] == [None, None]
    assert sorted(parts) == sorted(work)
    assert worst_found(parts) == worst_found(dict(run_all(work, None)))

    monkeypatch.setattr(cluster_pieces, "sources", lambda: "others")
    with pytest.raises(EnvironmentFault, match="has other sources"):
        list(run_all(work[:1], address))


def test_an_interrupted_search_continues_from_its_file(tmp_path, monkeypatch):
    file, runs = tmp_path / "kept", []

    def stop_after(number):
        def run(work, cluster):
            runs.append(len(work))
            yield from islice(run_all(work, cluster), number)
            raise KeyboardInterrupt

        return run

    for number in (20, 30):
        monkeypatch.setattr(bench_bounds, "run_all", stop_after(number))
        assert bench_bounds.search(50, SEEDS, None, file)[1]
    monkeypatch.undo()
    found = bench_bounds.search(50, SEEDS, None, file)
    assert runs == [54, 34]  # 18 attacks with 3 seeds
    assert found == bench_bounds.search(50, SEEDS, None, None)
    with pytest.raises(InputError, match="is not of this search"):
        bench_bounds.search(51, SEEDS, None, file)
    lines = file.read_text("utf-8").splitlines()
    file.write_text("\n".join([*lines[:2], "[0, [2]]", ""]), "utf-8")
    with pytest.raises(InputError, match=r"kept:3: not a result of this search"):
        bench_bounds.search(50, SEEDS, None, file)


@pytest.mark.parametrize(
    "part",
    [None, [0.5] * GENES, (0.5,) * (GENES - 1), (1.5,) * GENES, (float("nan"),) * GENES, ("",)],
)
def test_what_is_not_a_schedule_is_rejected(part):
    assert is_schedule((0.5,) * GENES, (0, 1, 1))
    assert not is_schedule(part, (0, 1, 1))


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["x"], 2, "invalid number value: 'x'"),
        (["1e400"], 2, "invalid number value: '1e400'"),
        (["18", "--seeds", "0"], 2, "--seeds must be 1 or more"),
        (["18", "--resume", "missing/kept"], 3, "bench bounds: cannot write missing/kept"),
    ],
)
def test_usage_errors_are_reported(arguments, code, words, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["bounds", *arguments])
    try:
        found = bench_bounds.main()
    except SystemExit as ended:
        found = ended.code
    assert found == code
    assert words in capsys.readouterr().err


def test_the_seed_of_each_worst_schedule_is_printed(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["bounds", "900", "7", "--seeds", "3"])
    bench_bounds.main()
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  ")]
    assert len(rows) == 18
    for row, what in zip(rows, ATTACKS, strict=True):
        seed = int(row.split("  seed ")[1].split()[0])
        assert f"worst {attack(what, WORKED, 50, seed).worst:9.4f} ms" in row
