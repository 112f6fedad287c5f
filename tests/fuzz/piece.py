"""A piece of fuzzing on a cluster: a target with a seed, on a worker; inputs travel as bytes."""

from __future__ import annotations

import hashlib
import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

from cluster_pieces import ROOT

from fsoe_net.errors import EnvironmentFault

KINDS = ("crash", "leak", "oom", "slow-unit", "timeout")  # of libFuzzer
MOST_INPUTS, MOST_BYTES = 4096, 8 << 20  # of one folder
MOST_TEXT = 16_384


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """A target, the seed of the fuzzer, its time, the inputs to start from, and where they are."""

    target: str
    seed: int
    seconds: int
    corpus: tuple[bytes, ...]
    out: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a run printed, its new inputs, and those that failed with their kind."""

    passed: bool
    host: str
    text: str
    corpus: tuple[bytes, ...]
    crashes: tuple[tuple[str, bytes], ...]


def run_piece(piece: Piece) -> Found:
    """Fuzz on this machine, which has a checkout and the programs."""
    with tempfile.TemporaryDirectory(prefix="fsn-fuzz-") as name:
        corpus, crashes = Path(name, "corpus", piece.target), Path(name, "crashes")
        corpus.mkdir(parents=True)
        add_inputs(corpus, piece.corpus)
        options = ["--duration", f"{piece.seconds}s", "--seed", str(piece.seed), "--out", name]
        done = subprocess.run(
            [ROOT / "scripts" / "fuzz", piece.target, *options],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env={**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
        )
        host, text = socket.gethostname(), done.stdout.decode("utf-8", "replace")[-MOST_TEXT:]
        if done.returncode not in (0, 1):
            raise EnvironmentFault(f"{host}: {text.strip()}")
        kinds = {kind: crashes.glob(f"{piece.target}-{kind}-*") for kind in KINDS}
        return Found(
            passed=done.returncode == 0,
            host=host,
            text=text.replace(name, piece.out),
            corpus=read_inputs(corpus.iterdir(), set(piece.corpus)),
            crashes=tuple(
                (kind, data) for kind, paths in kinds.items() for data in read_inputs(paths)
            ),
        )


def is_found(part: object, _piece: Piece) -> bool:
    """Whether an object from a worker has the types and sizes of a result."""
    return (
        isinstance(part, Found)
        and type(part.passed) is bool
        and all(type(text) is str and len(text) <= MOST_TEXT for text in (part.host, part.text))
        and isinstance(part.corpus, tuple)
        and isinstance(part.crashes, tuple)
        and all(
            isinstance(row, tuple) and len(row) == 2 and row[0] in KINDS for row in part.crashes
        )
        and all(
            len(inputs) <= MOST_INPUTS * len(KINDS)
            and all(type(data) is bytes for data in inputs)
            and sum(map(len, inputs)) <= MOST_BYTES * len(KINDS)
            for inputs in (part.corpus, [data for _, data in part.crashes])
        )
    )


def add_inputs(folder: Path, inputs: Iterable[bytes], prefix: str = "") -> None:
    """Write each input once, under the name that libFuzzer gives it: the hash of its content."""
    for data in inputs:
        path = folder / f"{prefix}{hashlib.sha1(data).hexdigest()}"
        if not path.exists():
            path.write_bytes(data)


def read_inputs(paths: Iterable[Path], known: Collection[bytes] = ()) -> tuple[bytes, ...]:
    """Return the inputs that are not known, the smallest first, as many as travel."""
    inputs: list[bytes] = []
    left = MOST_BYTES
    for path in sorted(paths, key=lambda path: (path.stat().st_size, path.name)):
        if len(inputs) == MOST_INPUTS or path.stat().st_size > left:
            break
        data = path.read_bytes()
        if data not in known:
            inputs.append(data)
            left -= len(data)
    return tuple(inputs)
