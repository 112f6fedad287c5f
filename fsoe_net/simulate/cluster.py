"""Runs independent pieces of work in any order, on this machine or on a Dask cluster."""

from __future__ import annotations

import importlib
import pickle
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from itertools import islice
from typing import Any, Generic, Protocol, TypeVar

from fsoe_net.diag.packages import missing_package
from fsoe_net.errors import EnvironmentFault, FsnError
from fsoe_net.version import __version__

_CONNECT_S = 10.0  # time for the scheduler of a cluster to answer
_STOP_S = 2.0  # time to disconnect from it

P = TypeVar("P")
R = TypeVar("R")
P_contra = TypeVar("P_contra", contravariant=True)
R_co = TypeVar("R_co", covariant=True)


class Workers(Protocol[P_contra, R_co]):
    """Runs pieces of work in any order."""

    @property
    def slots(self) -> int:
        """Number of pieces that can run at the same time."""

    def start(self, piece: P_contra) -> Future[Any]:
        """Run one piece."""

    def result(self, future: Future[Any], piece: P_contra) -> R_co:
        """Return the result of a piece that has ended; raises `EnvironmentFault`."""

    def stop(self) -> None:
        """Give up all work."""


def run_pieces(
    work: Iterable[P],
    workers: Workers[P, R],
    every_s: float,
    waiting: Callable[[Iterable[P]], None] = lambda _running: None,
) -> Iterator[tuple[P, R]]:
    """Distribute the work; only a few pieces are queued ahead, so that stopping is fast.

    Args:
        work: The pieces; each is taken when it is queued.
        workers: Run the pieces, and are stopped at the end.
        every_s: Interval after which new workers get work.
        waiting: Called with the running pieces when none has ended in this interval.
    """
    queue = iter(work)
    running: dict[Future[Any], P] = {}
    try:
        while True:
            # A cluster may have lost workers since.
            free = max(2 * workers.slots + 1 - len(running), 0)
            for piece in islice(queue, free):
                running[workers.start(piece)] = piece
            if not running:
                return
            finished, _ = wait(running, timeout=every_s, return_when=FIRST_COMPLETED)
            for future in finished:
                piece = running.pop(future)
                yield piece, workers.result(future, piece)
            if not finished:
                waiting(running.values())
    finally:
        workers.stop()


class ClusterWorkers(Generic[P, R]):
    """Workers of a Dask cluster, which runs a piece again if its worker dies.

    Args:
        address: Address of the scheduler, such as ``tcp://10.0.0.1:8786``.
        run: Runs a piece on a worker.
        check: Whether an object from a worker is a result of this piece.

    Raises:
        EnvironmentFault: Dask is missing, or the scheduler does not answer or has no worker.
    """

    def __init__(
        self, address: str, run: Callable[[P], R], check: Callable[[object, P], bool]
    ) -> None:
        self._run, self._check = run, check
        try:
            dask: Any = importlib.import_module("distributed")
            # Also takes functions of a program, which a worker cannot import.
            self._dumps: Callable[[object], bytes] = importlib.import_module("cloudpickle").dumps
        except ImportError as exc:
            raise EnvironmentFault(missing_package("--cluster", exc.name, "cluster")) from exc
        try:
            # Certificates for tls:// come from the configuration of Dask.
            self._client = dask.Client(address, timeout=_CONNECT_S, set_as_default=False)
        except Exception as exc:  # Dask has no common class of errors
            raise EnvironmentFault(f"no Dask scheduler at {address!r}: {exc}") from exc
        self._pool = self._client.get_executor(pure=False)
        if not self.slots:
            self.stop()
            raise EnvironmentFault(f"the Dask scheduler at {address!r} has no worker")

    @property
    def slots(self) -> int:
        """Threads of its workers, which join and leave at any time."""
        return sum(self._client.nthreads().values())

    def start(self, piece: P) -> Future[Any]:
        """Run one piece; see `Workers`."""
        # A worker that lacks a module of a task ends. It can always read this one, and reports.
        data = self._dumps(_Call(self._run, piece))
        future: Future[Any] = self._pool.submit(pickle.loads, data)
        return future

    def result(self, future: Future[Any], piece: P) -> R:
        """Return the result of a piece after checking it; see `Workers`."""
        try:
            version, part = future.result()
        except FsnError:
            raise
        # Any exception may come from another machine: a dead worker, or a module missing there.
        except Exception as exc:
            raise EnvironmentFault(
                f"a worker of the cluster failed: {type(exc).__name__}: {exc}"
            ) from exc
        if version != __version__:
            raise EnvironmentFault(
                f"a worker of the cluster has fsoe-net {version!r}, not {__version__}: install one "
                "version on all machines"
            )
        if not self._check(part, piece):
            raise EnvironmentFault("a worker of the cluster returned an invalid result")
        result: R = part
        return result

    def stop(self) -> None:
        """Cancel all work and disconnect; see `Workers`."""
        self._pool.shutdown(wait=False)  # cancels what runs or waits
        self._client.close(timeout=_STOP_S)


class _Call:
    """A piece of work, run where it is unpickled, into its result."""

    def __init__(self, *arguments: object) -> None:
        self._arguments = arguments

    def __reduce__(self) -> tuple[Callable[..., object], tuple[object, ...]]:
        return _run_there, self._arguments


def _run_there(run: Callable[[P], R], piece: P) -> tuple[str, R]:
    return __version__, run(piece)
