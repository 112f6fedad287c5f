"""Pieces of work of a developer on a Dask cluster, whose machines have the same sources.

A worker is started in a checkout, with ``PYTHONPATH=tests``.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar

from fsoe_net.errors import EnvironmentFault
from fsoe_net.simulate.cluster import ClusterWorkers, run_pieces

ROOT = Path(__file__).parents[1]
P = TypeVar("P")
R = TypeVar("R")


@cache
def sources() -> str:
    """Return a digest of the sources in Python and C, which decide on the result of a piece."""
    digest = hashlib.sha256()
    folders = [ROOT / name for name in ("fsoe_net", "master_core", "tests")]
    files = {path for folder in folders for path in folder.rglob("*.[chp]*")}
    for path in sorted(files):
        if path.suffix in (".c", ".h", ".py"):
            digest.update(f"{path.relative_to(ROOT)}\n".encode() + path.read_bytes())
    return digest.hexdigest()


def cluster_pieces(
    address: str, run: Callable[[P], R], is_valid: Callable[[object, P], bool], work: Iterable[P]
) -> Iterator[tuple[P, R]]:
    """Run pieces on a cluster; yield the result of each, in any order.

    Args:
        address: Address of the scheduler.
        run: Runs a piece on a worker; a function of a module.
        is_valid: Whether an object from a worker is a result of this piece.
        work: The pieces; each is taken when it is queued.

    Raises:
        EnvironmentFault: The cluster cannot be used, a worker has other sources or failed.
    """

    def check(part: Any, piece: P) -> bool:
        if not (isinstance(part, tuple) and len(part) == 2):
            return False
        if part[0] != sources():
            raise EnvironmentFault(
                "a worker of the cluster has other sources: start the workers again from this "
                "commit, without local changes"
            )
        return is_valid(part[1], piece)

    workers = ClusterWorkers[P, tuple[str, R]](address, partial(_with_sources, run), check)
    for piece, (_, result) in run_pieces(work, workers, every_s=1.0):
        yield piece, result


def _with_sources(run: Callable[[P], R], piece: P) -> tuple[str, R]:
    return sources(), run(piece)
