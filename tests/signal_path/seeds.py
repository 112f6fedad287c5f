"""The search with several seeds, on this machine or on a cluster; a file keeps completed pieces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from cluster_pieces import cluster_pieces, sources
from signal_path.path import Genes
from signal_path.search import EXCEEDED, GENES, HANDSHAKE, PRINTED, WORKED, Found, attack

from fsoe_net.simulate.kept_pieces import KeptPieces

ATTACKS = (*PRINTED, *HANDSHAKE, *EXCEEDED)

Piece = tuple[int, int, int]
"""Number of an attack, seed, schedules."""
Schedule = tuple[float, ...]


def pieces(schedules: int, seeds: range) -> list[Piece]:
    """Return the pieces of a search, with so many schedules for each attack and seed."""
    return [(at, seed, schedules) for seed in seeds for at in range(len(ATTACKS))]


def run_piece(piece: Piece) -> Schedule:
    """Return the worst schedule of a piece."""
    at, seed, schedules = piece
    return attack(ATTACKS[at], WORKED, schedules, seed).genes


def is_schedule(part: object, _piece: Piece) -> bool:
    """Whether an object from elsewhere is a schedule; its response is worked out here."""
    return (
        isinstance(part, tuple)
        and len(part) == GENES
        and all(type(gene) in (int, float) and 0 <= gene <= 1 for gene in part)
    )


def run_all(work: Sequence[Piece], cluster: str | None) -> Iterator[tuple[Piece, Schedule]]:
    """Run pieces here, or on the workers of a Dask scheduler."""
    if cluster is None:
        return ((piece, run_piece(piece)) for piece in work)
    return cluster_pieces(cluster, run_piece, is_schedule, work)


def worst_found(parts: dict[Piece, Schedule]) -> dict[int, tuple[Found, int]]:
    """Return the worst schedule of each attack, and the first seed that found one so bad."""
    worst: dict[int, tuple[Found, int]] = {}
    for (at, seed, _), genes in sorted(parts.items()):
        what = ATTACKS[at]
        found = Found(what.name, what.trial(WORKED, Genes(genes)), what.bound(WORKED), genes)
        if at not in worst or found.worst > worst[at][0].worst:
            worst[at] = found, seed
    return worst


class KeptSearch(KeptPieces[Schedule]):
    """The completed pieces of a search."""

    kind = "search"
    same = "schedules, seeds and sources"

    def __init__(self, path: Path, work: Sequence[Piece]) -> None:
        self._work = work
        super().__init__(path, sources(), work)

    def load(self, index: int, row: Any) -> Schedule | None:
        """Return the schedule of a piece; see `KeptPieces`."""
        genes = tuple(row)
        return genes if is_schedule(genes, self._work[index]) else None

    def row(self, part: Schedule) -> Schedule:
        """Return a schedule as data; see `KeptPieces`."""
        return part
