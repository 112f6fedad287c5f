"""Processes of this machine that run the pieces of a campaign, and the check of their results."""

from __future__ import annotations

import gc
import math
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import MutableSequence, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

from fsoe_net.campaign.collision_proof import Collision
from fsoe_net.campaign.trials import CampaignConfig, ClassResult, run_trials
from fsoe_net.errors import EnvironmentFault
from fsoe_net.simulate.device_logic import divert_stdout

_STOP_S = 2.0  # time for a process to end by itself

Piece = tuple[int, str, range]
"""A piece of work: its number, the class of faults and its trials."""


class LocalWorkers:
    """Processes of this machine.

    Args:
        config: The campaign.
        jobs: Their number.
        work: The pieces of work.
    """

    def __init__(self, config: CampaignConfig, jobs: int, work: Sequence[Piece]) -> None:
        self._config = config
        # With fork, a copy of a thread could hold a lock forever.
        context = multiprocessing.get_context("spawn")
        # Each piece of work has its own place: no lock that a dying process could keep.
        places = max((index + 1 for index, _, _ in work), default=1)
        self._done: MutableSequence[int] = context.RawArray("i", places)
        self.slots = max(1, min(jobs, len(work)))
        self._pool = ProcessPoolExecutor(
            max_workers=self.slots,
            mp_context=context,
            initializer=_prepare_process,
            initargs=(self._done,),
        )

    def start(self, piece: Piece) -> Future[ClassResult]:
        """Run one piece; see `Workers`."""
        return self._pool.submit(_run_here, self._config, piece)

    def result(self, future: Future[ClassResult], piece: Piece) -> ClassResult:
        """Return the result of a piece; see `Workers`."""
        try:
            return future.result()
        except BrokenProcessPool as exc:
            raise EnvironmentFault(
                "a process of the campaign died, as by os._exit() or a crash of the device; "
                "--jobs 1 shows what a crash prints"
            ) from exc

    def done(self, index: int) -> int:
        """Return how many trials of a running piece are done."""
        return self._done[index]

    def stop(self) -> None:
        """End the processes; see `Workers`."""
        processes = list((self._pool._processes or {}).values())
        self._pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.terminate()
        for process in processes:
            process.join(_STOP_S)
            process.kill()  # a device may have caught SIGTERM
            process.join()


_done: MutableSequence[int] = []
"""Trials done per piece of work; shared with the parent of this process."""


def _prepare_process(done: MutableSequence[int]) -> None:
    global _done  # the only way to pass it from the start of a process to its calls
    _done = done
    threading.Thread(target=_end_with_parent, daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides when to stop
    gc.set_threshold(200_000)  # trials create no reference cycles; the search takes time
    divert_stdout()  # output of a device does not belong in the report
    sys.stdout = sys.stderr


def _end_with_parent() -> None:  # pragma: no cover - ends its process, and the counts with it
    """End this process when its parent has ended, even by SIGKILL.

    Otherwise it would wait for work forever, together with the process of `multiprocessing` that
    removes the semaphores of the parent.
    """
    parent = multiprocessing.parent_process()
    assert parent is not None  # noqa: S101 - a process of the pool has one
    parent.join()
    os._exit(1)


def _run_here(config: CampaignConfig, piece: Piece) -> ClassResult:
    index, name, trials = piece

    def on_trial(done: int) -> None:
        _done[index] = done

    return run_trials(config, name, trials, on_trial)


def is_of(part: object, config: CampaignConfig, piece: Piece) -> bool:
    """Whether a result from elsewhere has the trials of a piece, each with one outcome."""
    _, name, trials = piece
    if not isinstance(part, ClassResult) or part.name != name:
        return False
    links = {link.name for link in config.links}
    outcomes = (
        *(part.detected, part.tolerated, part.collisions),
        *(part.wrongly_accepted, part.wrong_reactions),
    )
    return (
        _has_numbers(part)
        and sum(outcomes) == part.injected == len(trials)
        and all(row.trial in trials and row.link in links for row in part.failures + part.shown)
        and all(isinstance(row.reason, str) for row in part.failures)
        and all(_is_proof(row.proof) for row in part.shown)
    )


def _has_numbers(part: ClassResult) -> bool:
    counts = (
        *(part.injected, part.detected, part.tolerated, part.collisions),
        *(part.wrongly_accepted, part.wrong_reactions, part.exposed, part.exposed_collisions),
        *(part.latency_sum_ns, part.latency_max_ns, part.latency_min_ns or 0),
        *part.codes.values(),
        *(code + 1 for code in part.codes),
    )
    shares = (part.expected, part.latency_max_share)
    return all(type(count) is int and count >= 0 for count in counts) and all(
        type(share) in (int, float) and 0 <= share < math.inf for share in shares
    )


def _is_proof(proof: Collision) -> bool:
    return (
        proof.end in ("main", "sub")
        and isinstance(proof.frame, bytes)
        and isinstance(proof.right, bytes)
        and type(proof.old_crc) is int
        and type(proof.sequence) is int
    )
