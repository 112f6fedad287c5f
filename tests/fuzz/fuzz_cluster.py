"""Fuzzes on the workers of a Dask scheduler; started by ``scripts/fuzz --cluster``.

Each target and seed is a piece of work, which begins with the corpus of that moment. New inputs and
failing ones are written here as soon as a piece has ended, so the next run continues from them.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import click

sys.path.insert(0, str(Path(__file__).parents[1]))

from cluster_pieces import cluster_pieces
from fuzz.piece import Found, Piece, add_inputs, is_found, read_inputs, run_piece

from fsoe_net.cli.progress import progress_bar
from fsoe_net.diag.printable import printable
from fsoe_net.errors import FsnError


def pieces(out: Path, targets: Sequence[str], seconds: int, seeds: range) -> Iterator[Piece]:
    """Yield each target with each seed, and the inputs found so far."""
    for seed in seeds:
        for target in targets:
            corpus = out / "corpus" / target
            corpus.mkdir(parents=True, exist_ok=True)
            inputs = read_inputs(corpus.iterdir())
            yield Piece(target=target, seed=seed, seconds=seconds, corpus=inputs, out=str(out))


def keep(out: Path, piece: Piece, found: Found) -> None:
    """Write the inputs of a piece that are new."""
    add_inputs(out / "corpus" / piece.target, found.corpus)
    for kind, data in found.crashes:
        add_inputs(out / "crashes", [data], f"{piece.target}-{kind}-")


def main(address: str, folder: str, *numbers_and_targets: str) -> int:
    """Fuzz and print; return the exit code."""
    seconds, seed, rounds = map(int, numbers_and_targets[:3])
    out, targets = Path(folder), numbers_and_targets[3:]
    first = seed or random.randrange(1, 1 << 31)
    work = pieces(out, targets, seconds, range(first, first + rounds))
    rows: list[str] = []
    failed, end, code = 0, "", 0
    try:
        with progress_bar("fuzz") as bar:
            for piece, found in cluster_pieces(address, run_piece, is_found, work):
                keep(out, piece, found)
                text = printable(found.text.strip(), keep="\n")
                rows.append(f"{printable(found.host)}, seed {piece.seed}: {text}")
                failed += not found.passed
                if bar is not None:
                    bar(len(rows), rounds * len(targets), f"{piece.target}, {failed} failed")
    except KeyboardInterrupt:
        end, code = "interrupted; the next run continues from the corpus", 130
    except (FsnError, OSError) as exc:
        end, code = printable(str(exc), keep="\n"), 3
    if rows:
        click.echo("\n".join(rows))
    if end:
        click.echo(f"fuzz: {end}", err=True)
    return code or int(failed > 0)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
