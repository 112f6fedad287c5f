"""Fuzzing on a cluster: inputs and crashes come back, are checked and merged by their content."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import replace
from hashlib import sha1
from pathlib import Path

import pytest
from dask_cluster import one_scheduler, three_workers  # noqa: F401 - fixtures
from fuzz import fuzz_cluster
from fuzz.piece import MOST_BYTES, Found, Piece, is_found, run_piece

from fsoe_net.errors import EnvironmentFault

PIECE = Piece(target="py-hex", seed=1, seconds=1, corpus=(b"36 01",), out="out")
FOUND = Found(passed=True, host="h", text="", corpus=(b"", b"x"), crashes=(("crash", b"y"),))


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def hashes(*inputs: bytes) -> list[str]:
    return sorted(sha1(data).hexdigest() for data in inputs)


@pytest.mark.weekly
def test_inputs_and_crashes_of_all_workers_are_merged(cluster, tmp_path, monkeypatch, capsys):
    address, (first, *_) = cluster
    (tmp_path / "crashes").mkdir()

    def fuzz(piece: Piece) -> Found:  # travels by value: what a fuzzer finds is random
        time.sleep(0.1)
        crash = (("crash", b"bad"),) if piece.target == "scan" else ()
        corpus = tuple(data for data in (b"same", b"%d" % piece.seed) if data not in piece.corpus)
        text = f"{piece.target}: \x1b[2J"
        return Found(passed=not crash, host="h", text=text, corpus=corpus, crashes=crash)

    def keep(*arguments: object) -> None:
        if first.poll() is None:
            os.kill(first.pid, signal.SIGKILL)
            first.wait()
        kept(*arguments)

    kept = fuzz_cluster.keep
    monkeypatch.setattr(fuzz_cluster, "run_piece", fuzz)
    monkeypatch.setattr(fuzz_cluster, "keep", keep)
    code = fuzz_cluster.main(address, str(tmp_path), "1", "5", "8", "py-hex", "scan")
    rows = capsys.readouterr().out.splitlines()
    assert code == 1
    assert first.returncode == -signal.SIGKILL
    assert sorted(rows) == sorted(
        rf"h, seed {seed}: {target}: \u001b[2J"
        for seed in range(5, 13)
        for target in ("py-hex", "scan")
    )
    expected = hashes(b"same", *(b"%d" % seed for seed in range(5, 13)))
    assert names(tmp_path / "corpus" / "py-hex") == expected
    assert names(tmp_path / "corpus" / "scan") == expected
    assert names(tmp_path / "crashes") == [f"scan-crash-{sha1(b'bad').hexdigest()}"]


@pytest.mark.weekly
def test_a_worker_fuzzes_from_the_inputs_that_it_got():
    pytest.importorskip("atheris", reason="the extra fuzz is not installed")
    found = run_piece(PIECE)
    assert is_found(found, PIECE)
    assert found.passed, found.text
    assert "fuzz: py-hex: Done" in found.text
    assert found.corpus
    assert PIECE.corpus[0] not in found.corpus
    assert found.crashes == ()


def test_a_worker_that_cannot_fuzz_says_why():
    with pytest.raises(EnvironmentFault, match="no target nothing; there are: plan"):
        run_piece(replace(PIECE, target="nothing"))


def test_results_of_other_types_or_sizes_are_rejected():
    assert is_found(FOUND, PIECE)
    for wrong in (
        None,
        replace(FOUND, passed=1),
        replace(FOUND, text=b""),
        replace(FOUND, text="x" * 100_000),
        replace(FOUND, corpus=[b"x"]),
        replace(FOUND, corpus=("x",)),
        replace(FOUND, corpus=(b"x",) * 100_000),
        replace(FOUND, corpus=(b"x" * (6 * MOST_BYTES),)),
        replace(FOUND, crashes=(("../crash", b""),)),
        replace(FOUND, crashes=(("crash", "x"),)),
        replace(FOUND, crashes=(("crash",),)),
    ):
        assert not is_found(wrong, PIECE), str(wrong)[:200]


def test_an_interrupted_run_keeps_its_inputs(tmp_path, monkeypatch, capsys):
    def interrupted(_address, _run, _check, work):
        yield next(work), FOUND
        raise KeyboardInterrupt

    (tmp_path / "crashes").mkdir()
    monkeypatch.setattr(fuzz_cluster, "cluster_pieces", interrupted)
    assert fuzz_cluster.main("", str(tmp_path), "1", "0", "2", "py-hex") == 130
    assert "continues from the corpus" in capsys.readouterr().err
    assert names(tmp_path / "corpus" / "py-hex") == hashes(b"", b"x")
    (piece,) = fuzz_cluster.pieces(tmp_path, ["py-hex"], 1, range(9, 10))
    assert piece == replace(PIECE, seed=9, corpus=(b"", b"x"), out=str(tmp_path))
