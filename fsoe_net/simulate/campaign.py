"""A fault campaign over the connections of a network, on all CPU cores or on a cluster."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from fsoe_net.campaign.clean_run import MainFactory, SubFactory, TrialConnection
from fsoe_net.campaign.shrink import shrink
from fsoe_net.campaign.trials import (
    CampaignConfig,
    ClassResult,
    Trials,
    merge,
    run_trials,
    trial_count,
)
from fsoe_net.errors import InputError
from fsoe_net.fsoe.config import MainConfig
from fsoe_net.model.resolve import Resolution
from fsoe_net.simulate.cluster import ClusterWorkers, run_pieces
from fsoe_net.simulate.kept_pieces import KeptCampaign
from fsoe_net.simulate.scenario_run import DEFAULT_CYCLE_NS
from fsoe_net.simulate.setup import choose_setups
from fsoe_net.simulate.workers import LocalWorkers, Piece, is_of

_CHUNK = 8192  # independent of the number of processes, so that sums are equal
_FEW = 4096  # trials for which starting processes is too slow
_SHOWN_EVERY_S = 0.25  # interval of progress reports within a piece of work

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignResult:
    """Result of a campaign.

    Attributes:
        config: Connections and seed.
        faults: Requested faults per class.
        classes: One row per class, in the requested order; classes never begun are missing.
        interrupted: Whether it was stopped before its end.
    """

    config: CampaignConfig
    faults: int
    classes: tuple[ClassResult, ...]
    interrupted: bool

    @property
    def passed(self) -> bool:
        """Whether no end failed, every rate is plausible and not too many faults were tolerated."""
        return all(row.passed for row in self.classes)


def campaign_links(
    resolution: Resolution,
    *,
    connection: str | None = None,
    main_factory: MainFactory | None = None,
    sub_factory: SubFactory | None = None,
) -> tuple[TrialConnection, ...]:
    """Return the connections of a network, ready for a campaign.

    Args:
        resolution: The network; the default cycle is 1 ms.
        connection: Name of the only connection to use.
        main_factory: Makes a foreign main.
        sub_factory: Makes a foreign sub.

    Raises:
        InputError: There is no connection, or none with this name.
    """
    setups = choose_setups(resolution)
    if not setups:
        raise InputError("nothing to try: these files hold no FSoE connection")
    names = [setup.connection.name for setup in setups]
    if connection is not None and connection not in names:
        raise InputError(f"no connection {connection!r}; there are {', '.join(names)}")
    cycle_ns = resolution.network.cycle_ns or DEFAULT_CYCLE_NS
    mains = [setup.main for setup in setups]
    return tuple(
        TrialConnection(
            name=setup.connection.name,
            main=setup.main,
            sub=setup.sub,
            other=_other(setup.main, mains),
            cycle_ns=cycle_ns,
            main_factory=main_factory,
            sub_factory=sub_factory,
        )
        for setup in setups
        if connection in (None, setup.connection.name)
    )


def _other(main: MainConfig, mains: Sequence[MainConfig]) -> MainConfig:
    """Return another connection of the same sizes, from the network if there is one."""
    sizes = (main.safe_out_bytes, main.safe_in_bytes)
    # A foreign frame of equal length is the hardest case: only ConnID and CRC distinguish it.
    for row in mains:
        if row is not main and (row.safe_out_bytes, row.safe_in_bytes) == sizes:
            return row
    used = {row.connection_id for row in mains}
    free = next(number for number in range(1, 0x10000) if number not in used)
    # The address also differs: the two connections must differ in all identifying values.
    return replace(main, connection_id=free, address=main.address ^ 1)


def run_campaign(
    config: CampaignConfig,
    names: Sequence[str],
    faults: int,
    *,
    jobs: int | None = None,
    cluster: str | None = None,
    resume: Path | None = None,
    on_progress: Progress | None = None,
) -> CampaignResult:
    """Run a campaign.

    Args:
        config: Connections and seed.
        names: Classes of faults.
        faults: Faults per class.
        jobs: Number of processes; default: one per core, or only this process for few faults.
        cluster: Address of a Dask scheduler whose workers run the campaign instead.
        resume: File of completed work, which is not done again; it is created if it is missing,
            and gets what is completed now.
        on_progress: Called in this process several times a second, unless a single fault takes
            longer. Arguments: completed faults, all faults, current class.

    Returns:
        The result. After Ctrl-C, the results so far, marked as interrupted.

    Raises:
        ConfigError: Unknown class, or a connection that never reaches state Data.
        InputError: The file of completed work is of another campaign.
        EnvironmentFault: A device under test raised an exception or took its process with it, or
            the cluster or the file cannot be used.
    """
    work = _pieces(config, names, faults)
    total = sum(len(trials) for _, _, trials in work)
    reports = _Reports(on_progress, total)
    # Starting a process takes longer than a few faults.
    if jobs is None:
        jobs = 1 if total <= _FEW else _cores()
    interrupted = False
    with nullcontext() if resume is None else KeptCampaign(resume, config, work) as kept:
        parts = {} if kept is None else kept.parts
        for part in parts.values():
            reports.finished(part.injected, part.name)
        left = [piece for piece in work if piece[0] not in parts]
        try:
            for (index, _, _), part in _steps(config, left, jobs, cluster, reports):
                parts[index] = part
                if kept is not None:
                    kept.add(index, part)
                reports.finished(part.injected, part.name)
        # The results so far are kept, because campaigns run for hours.
        except KeyboardInterrupt:
            interrupted = True
    return CampaignResult(
        config=config, faults=faults, classes=_merged(parts, names), interrupted=interrupted
    )


def _merged(parts: Mapping[int, ClassResult], names: Sequence[str]) -> tuple[ClassResult, ...]:
    """Join in the order of the work, whatever the order in which processes finished."""
    found = [parts[index] for index in sorted(parts)]
    rows = [[part for part in found if part.name == name] for name in names]
    return tuple(merge(row) for row in rows if row)


def _pieces(config: CampaignConfig, names: Sequence[str], faults: int) -> list[Piece]:
    """Divide by number, not by process, so that the result does not depend on ``jobs``."""
    chunks = [
        (name, range(at, min(at + _CHUNK, count)))
        for name in names
        for count in [trial_count(config, name, faults)]
        for at in range(0, count, _CHUNK)
    ]
    return [(index, name, trials) for index, (name, trials) in enumerate(chunks)]


def save_failures(result: CampaignResult, folder: Path) -> dict[tuple[str, int], Path | None]:
    """Minimise the first wrong acceptances of each class and write them as recordings.

    Args:
        result: Result of the campaign.
        folder: Target folder; created if needed.

    Returns:
        Class and trial, and the file for `fsoe_net.campaign.recording.replay.replay_file`; ``None``
        for a case that fails only after the long run in which it was found.
    """
    saved: dict[tuple[str, int], Path | None] = {}
    for row in result.classes:
        if not row.failures:
            continue
        trials = Trials(result.config, row.name)
        for failure in row.failures:
            small = shrink(trials.case(failure.trial))
            saved[row.name, failure.trial] = None
            if small is not None:
                path = folder / f"{row.name.replace('+', '-and-')}-{failure.trial}.jsonl"
                folder.mkdir(parents=True, exist_ok=True)
                path.write_text("\n".join(small.lines) + "\n", encoding="utf-8")
                saved[row.name, failure.trial] = path
    return saved


_Work = Sequence[Piece]
_Steps = Iterator[tuple[Piece, ClassResult]]


class _Reports:
    """Reports the progress of a campaign; never the same number twice, never a smaller one."""

    def __init__(self, on_progress: Progress | None, total: int) -> None:
        self.call, self._total = on_progress, total
        self._done, self._last = 0, 0

    def finished(self, trials: int, name: str) -> None:
        """Report a completed piece of work."""
        self._done += trials
        self._tell(self._done, name)

    def within(self, trials: int, name: str) -> None:
        """Report the number of trials done in the current pieces of work."""
        self._tell(min(self._done + trials, self._total - 1), name)

    def _tell(self, done: int, name: str) -> None:
        if self.call is not None and done > self._last:
            self._last = done
            self.call(done, self._total, name)


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))  # CPUs available to this process
    return os.cpu_count() or 1


def _steps(
    config: CampaignConfig, work: _Work, jobs: int, cluster: str | None, reports: _Reports
) -> _Steps:
    if cluster is not None:
        far = ClusterWorkers[Piece, ClassResult](
            cluster,
            partial(_run_there, config),
            lambda part, piece: is_of(part, config, piece),
        )
        return run_pieces(work, far, _SHOWN_EVERY_S)
    if jobs == 1:
        return _alone(config, work, reports)
    near = LocalWorkers(config, jobs, work)

    def waiting(running: Iterable[Piece]) -> None:
        # Report the progress of the pieces, so that it does not look stuck.
        at = {piece: done for piece in running if (done := near.done(piece[0]))}
        if at:
            reports.within(sum(at.values()), min(at)[1])

    return run_pieces(work, near, _SHOWN_EVERY_S, waiting)


def _run_there(config: CampaignConfig, piece: Piece) -> ClassResult:
    _, name, trials = piece
    return run_trials(config, name, trials)


def _alone(config: CampaignConfig, work: _Work, reports: _Reports) -> _Steps:
    for piece in work:
        _, name, trials = piece
        on_trial = _now_and_then(reports.within, name) if reports.call else None
        yield piece, run_trials(config, name, trials, on_trial)


def _now_and_then(tell: Callable[[int, str], None], name: str) -> Callable[[int], None]:
    due_s = time.monotonic() + _SHOWN_EVERY_S

    def on_trial(done: int) -> None:
        nonlocal due_s
        if time.monotonic() >= due_s:
            tell(done, name)
            due_s = time.monotonic() + _SHOWN_EVERY_S

    return on_trial
