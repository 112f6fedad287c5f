"""Fault campaigns: many seeded faults of a class, each injected into a clean run and judged.

A trial depends only on the connections, the class, the seed and its own number. It does not depend
on earlier trials or on the number of worker processes.
"""

from __future__ import annotations

import hashlib
import random
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace

from fsoe_net.campaign.bit_errors import error_sets
from fsoe_net.campaign.channel import Channel, Way
from fsoe_net.campaign.clean_run import RunSource, Scene, TrialConnection, miswired
from fsoe_net.campaign.collision_proof import Collision
from fsoe_net.campaign.fault_classes import CATALOGUE, FaultClass
from fsoe_net.campaign.faults import Flip
from fsoe_net.campaign.faulty_main import FaultyMain
from fsoe_net.campaign.injection import ForeignFrames, Injection
from fsoe_net.campaign.judge import FAILURES, TrialFinding, TrialOutcome, judge
from fsoe_net.campaign.statistics import count_interval
from fsoe_net.diag.guesses import guesses, one_of
from fsoe_net.errors import ConfigError

EXHAUSTIVE = "bit_errors"
_ADDRESSING, _PARAMETERS = "addressing", "parameters"
_UNDRAWN = (EXHAUSTIVE, _PARAMETERS)  # no fault at a point of a run, so they cannot be combined
_SURE = 1 - 2e-6  # a correct end must not exceed the bound in a thousand campaigns
_MISWIRED_SHARE = 1 / 32  # of its trials; each one is a separate start-up
_PER_WALK = 1024  # trials that share a run
_WALKS = 4  # runs that alternate, so that a short campaign covers each kind of run
_KEPT_FAILURES = 5
_KEPT_COLLISIONS = 100
_MAX_DRAWS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignConfig:
    """The connections of a campaign; trials are distributed to them in turn."""

    links: tuple[TrialConnection, ...]
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.links:
            raise ConfigError("a campaign needs at least one connection")


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """A trial in which an end failed.

    Attributes:
        trial: Number of the trial.
        link: Name of the connection.
        reason: The wrong acceptance, or the action taken instead of the required one.
    """

    trial: int
    link: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """A trial that ended in a real collision, and the proof."""

    trial: int
    link: str
    proof: Collision


@dataclass(slots=True, kw_only=True)
class ClassResult:
    """Outcomes of the faults of one class; partial results can be merged.

    Attributes:
        name: Class, or classes joined by ``+``.
        injected: Faults injected.
        detected: Faults an end noticed.
        tolerated: Faults no end had to notice.
        collisions: Acceptances shown to be true CRC collisions.
        wrongly_accepted: Acceptances without a CRC collision, or wrong or old data.
        wrong_reactions: Ends that deviated from their state table.
        codes: Codes of the Resets by which faults were detected; -1 for a new Session or silence.
        latency_min_ns: Shortest detection latency, ``None`` without detection.
        latency_sum_ns: Sum over ``detected``.
        latency_max_ns: Longest.
        latency_max_share: Longest latency as a share of the watchdog of its connection.
        exposed: Faults that only the CRC could detect, with a known probability.
        exposed_collisions: Collisions among them.
        expected: Expected number of such collisions.
        failures: First wrong acceptances and reactions.
        shown: First collisions, with proof.
    """

    name: str
    injected: int = 0
    detected: int = 0
    tolerated: int = 0
    collisions: int = 0
    wrongly_accepted: int = 0
    wrong_reactions: int = 0
    codes: Counter[int] = field(default_factory=Counter)
    latency_min_ns: int | None = None
    latency_sum_ns: int = 0
    latency_max_ns: int = 0
    latency_max_share: float = 0.0
    exposed: int = 0
    exposed_collisions: int = 0
    expected: float = 0.0
    failures: list[Failure] = field(default_factory=list)
    shown: list[Shown] = field(default_factory=list)

    @property
    def interval(self) -> tuple[int, int] | None:
        """Plausible range of the number of collisions among ``exposed``, at 99 %."""
        if self.name == EXHAUSTIVE:
            return 0, 0
        return count_interval(self.expected) if self.exposed else None

    @property
    def rate_ok(self) -> bool:
        """Whether the number of collisions is plausible for the CRC."""
        if self.name == EXHAUSTIVE:
            return self.collisions == 0
        interval = self.interval
        return interval is None or interval[0] <= self.exposed_collisions <= interval[1]

    @property
    def most_tolerated(self) -> int:
        """Largest plausible number of tolerated faults, by the share that the catalogue allows."""
        share = max(CATALOGUE[part].tolerable for part in self.name.split("+"))
        return min(self.injected, count_interval(share * self.injected, _SURE)[1])

    @property
    def failed(self) -> int:
        """Faults on which an end failed."""
        return self.wrongly_accepted + self.wrong_reactions

    @property
    def passed(self) -> bool:
        """Whether no end failed, the rate is plausible and not too many faults were tolerated."""
        return not self.failed and self.rate_ok and self.tolerated <= self.most_tolerated

    def add(self, finding: TrialFinding, link: TrialConnection, chance: float | None) -> None:
        """Count one trial."""
        self.injected += 1
        # Only faults with a known chance can be compared with the expected number of collisions.
        if finding.exposed and chance is not None:
            self.exposed += 1
            self.expected += chance
            self.exposed_collisions += finding.verdict is TrialOutcome.COLLISION
        if finding.verdict is TrialOutcome.DETECTED:
            self.detected += 1
            self.codes[-1 if finding.code is None else finding.code] += 1
            self._latency(finding.latency_ns, finding.latency_ns / link.watchdog_ns)
        elif finding.verdict is TrialOutcome.TOLERATED:
            self.tolerated += 1
        elif finding.verdict is TrialOutcome.COLLISION:
            self.collisions += 1
        elif finding.verdict is TrialOutcome.WRONGLY_ACCEPTED:
            self.wrongly_accepted += 1
        else:
            self.wrong_reactions += 1

    def _latency(self, latency_ns: int, share: float) -> None:
        self.latency_sum_ns += latency_ns
        if self.latency_min_ns is None or latency_ns < self.latency_min_ns:
            self.latency_min_ns = latency_ns
        self.latency_max_ns = max(self.latency_max_ns, latency_ns)
        self.latency_max_share = max(self.latency_max_share, share)


def merge(parts: Iterable[ClassResult]) -> ClassResult:
    """Merge partial results of one class; their order does not matter.

    Raises:
        ConfigError: No parts, or parts of different classes.
    """
    rows = list(parts)
    if len({row.name for row in rows}) != 1:
        raise ConfigError("only results of one class can be merged")
    total = ClassResult(name=rows[0].name)
    for row in rows:
        for name in _SUMS:
            setattr(total, name, getattr(total, name) + getattr(row, name))
        total.codes.update(row.codes)
        total.latency_max_ns = max(total.latency_max_ns, row.latency_max_ns)
        total.latency_max_share = max(total.latency_max_share, row.latency_max_share)
        total.failures += row.failures
        total.shown += row.shown
    shortest = [row.latency_min_ns for row in rows if row.latency_min_ns is not None]
    total.latency_min_ns = min(shortest, default=None)
    # Sums of floats depend on the order; sorting makes them repeatable.
    total.expected = sum(sorted(row.expected for row in rows))  # in any order
    _keep_first(total)
    return total


def _keep_first(result: ClassResult) -> None:
    result.failures = sorted(result.failures, key=lambda row: row.trial)[:_KEPT_FAILURES]
    result.shown = sorted(result.shown, key=lambda row: row.trial)[:_KEPT_COLLISIONS]


_SUMS = (
    "injected",
    "detected",
    "tolerated",
    "collisions",
    "wrongly_accepted",
    "wrong_reactions",
    "latency_sum_ns",
    "exposed",
    "exposed_collisions",
)


@dataclass(slots=True, kw_only=True)  # not frozen: millions of instances
class Case:
    """A prepared trial: a point of a run and its faults."""

    link: TrialConnection
    scene: Scene
    injection: Injection


class _Lane:
    """The trials of one connection and one class."""

    def __init__(self, link: TrialConnection, seed: int, name: str) -> None:
        self.link, self.classes = link, _classes(name)
        self.miswires = name == _ADDRESSING
        self.odd = name == _PARAMETERS
        self._startup_share = max(row.startup_share for row in self.classes)
        self._odd = replace(link, name=f"{link.name}/odd", main_factory=FaultyMain)
        self._wrong: Channel | None = None
        self.walker, self.foreign = RunSource(link, seed), ForeignFrames(link, seed)
        text = f"{seed}/{link.name}/{name}"
        self._key = int.from_bytes(hashlib.sha256(text.encode()).digest()[:16], "little")
        self._rng = random.Random()  # noqa: S311 - repeatable is the point

    def case(self, number: int) -> Case:
        rng = self._rng
        # Seeded by its number, so that a trial can be repeated without the earlier ones.
        rng.seed(self._key ^ number)
        walk = _walk_of(number)
        if self.odd:
            return self._faulty_main(rng)
        if self.miswires and rng.random() < _MISWIRED_SHARE:
            return self._miswired(rng.getrandbits(63))
        # Some classes need a certain type of frame, which a random point may not have.
        for _ in range(_MAX_DRAWS):
            scene = self.walker.scene(walk, rng, startup_share=self._startup_share)
            injection = self._draw(rng, scene, walk)
            if injection is not None:
                return Case(link=self.link, scene=scene, injection=injection)
        raise ConfigError(f"{self.link.name}: no point of the run suits this class")

    def flip(self, number: int, way: Way, mask: int) -> Case:
        """Return a trial in which these bits of a data frame are flipped.

        If the result equals the last frame received, which is not an event (§10), another point is
        drawn.
        """
        self._rng.seed(self._key ^ number)
        seen: bytes | None = None
        shown: bytes | None = None
        while seen == shown:
            scene = self.walker.scene(_walk_of(number), self._rng, data_to=way)
            start = scene.channel.cycle
            flip = Flip(way=way, start=start, until=start + 1, mask=mask)
            seen, shown = flip.apply(scene.channel, scene.frame), scene.channel.shown(way)
        return Case(link=self.link, scene=scene, injection=Injection(faults=(flip,)))

    def _miswired(self, seed: int) -> Case:
        return self._from_power_up(miswired(self.link), seed)

    def _faulty_main(self, rng: random.Random) -> Case:
        if self._wrong is None:
            self._wrong = self._odd.channel(0)
        main = self._wrong.main
        assert isinstance(main, FaultyMain)  # noqa: S101 - made by the factory above
        main.change(rng)
        case = self._from_power_up(self._odd, rng.getrandbits(63))
        case.scene.channel.tables = (case.scene.channel.tables[Way.TO_SUB], None)
        return case

    def _from_power_up(self, link: TrialConnection, seed: int) -> Case:
        if self._wrong is None:
            self._wrong = link.channel(seed)
        self._wrong = link.again(self._wrong, seed)
        self._wrong.turn()  # the initial Reset of a main is not a detection
        scene = Scene(
            channel=self._wrong,
            way=Way.TO_SUB,
            watchdog_cycles=link.watchdog_cycles,
        )
        return Case(link=link, scene=scene, injection=Injection(faults=(), miswired=True))

    def _draw(self, rng: random.Random, scene: Scene, walk: int) -> Injection | None:
        drawn = []
        for row in self.classes:
            injection = row.make(rng, scene, self.foreign, walk)
            # One of the combined classes has no case here: another point is drawn.
            if injection is None:
                return None
            drawn.append(injection)
        if len(drawn) == 1:
            return drawn[0]
        return Injection(
            faults=tuple(fault for one in drawn for fault in one.faults),
            patient=any(one.patient for one in drawn),
            signed=any(one.signed for one in drawn),
            stays=any(one.stays for one in drawn),
            application=next((one.application for one in drawn if one.application), None),
        )


def _walk_of(number: int) -> int:
    return number // (_PER_WALK * _WALKS) * _WALKS + number % _WALKS


def _classes(name: str) -> list[FaultClass]:
    rows = []
    for part in name.split("+"):
        if part not in CATALOGUE or (part in _UNDRAWN and part != name):
            raise ConfigError(f"{part!r} is not a class of faults that can be drawn")
        rows.append(CATALOGUE[part])
    return rows


class Trials:
    """The trials of one class, one at a time.

    Args:
        config: Connections and seed.
        name: Class, or several joined by ``+`` that are injected together.

    Raises:
        ConfigError: Unknown class.
    """

    def __init__(self, config: CampaignConfig, name: str) -> None:
        self.name = name
        sets = error_sets(config.links) if name == EXHAUSTIVE else ()
        # The exhaustive sets name the connections that they need.
        links = dict.fromkeys(row.link for row in sets) if sets else config.links
        self._lanes = [_Lane(link, config.seed, name) for link in links]
        lane_of = {lane.link: lane for lane in self._lanes}
        self._sets = [(row, lane_of[row.link]) for row in sets]

    def case(self, trial: int) -> Case:
        """Return a trial ready to run; the previous one can no longer be used."""
        if self.name != EXHAUSTIVE:
            lanes = self._lanes
            return lanes[trial % len(lanes)].case(trial // len(lanes))
        for row, lane in self._sets:
            if trial < row.count:
                return lane.flip(trial, row.way, row.mask(trial))
            trial -= row.count
        raise ConfigError("there are not so many bit errors")

    def run(self, trial: int) -> tuple[Case, TrialFinding]:
        """Run one trial."""
        case = self.case(trial)
        return case, judge(case.scene, case.injection, case.link.watchdog_ns)

    def order(self, trials: range) -> Iterator[int]:
        """Return the trial numbers grouped by connection, which reuses the clean runs."""
        step = 1 if self.name == EXHAUSTIVE else len(self._lanes)
        for first in range(step):
            yield from range(trials.start + (first - trials.start) % step, trials.stop, step)


def trial_count(config: CampaignConfig, name: str, faults: int) -> int:
    """Return the number of trials of a class: ``faults``, or the number of all bit errors."""
    if name != EXHAUSTIVE:
        return faults
    return sum(row.count for row in error_sets(config.links))


def run_trials(
    config: CampaignConfig,
    name: str,
    trials: range,
    on_trial: Callable[[int], None] | None = None,
) -> ClassResult:
    """Run some trials of a class.

    Args:
        config: Connections and seed.
        name: Class of the catalogue, or several joined by ``+``.
        trials: Numbers of the trials; below `trial_count`.
        on_trial: Called before each trial with the number of completed ones.

    Raises:
        ConfigError: Unknown class, or a connection that never reaches state Data.
    """
    work = Trials(config, name)
    result = ClassResult(name=name)
    for trial in work.order(trials):
        if on_trial is not None:
            on_trial(result.injected)
        case, finding = work.run(trial)
        result.add(finding, case.link, case.injection.chance)
        if finding.verdict in FAILURES:
            result.failures.append(Failure(trial=trial, link=case.link.name, reason=finding.reason))
        elif finding.proof is not None:
            result.shown.append(Shown(trial=trial, link=case.link.name, proof=finding.proof))
    _keep_first(result)
    return result


def class_names(text: str) -> tuple[str, ...]:
    """Return the classes in ``loss,delay+torn_copy``; ``all`` selects those of the catalogue.

    Raises:
        ValueError: Unknown class, a duplicate, or classes that cannot be combined.
    """
    if text == "all":
        return tuple(CATALOGUE)
    names = tuple(name.strip() for name in text.split(","))
    seen: set[tuple[str, ...]] = set()
    for name in names:
        # Sorted: `a+b` and `b+a` are the same combination.
        parts = tuple(sorted(name.split("+")))
        for part in parts:
            if part not in CATALOGUE:
                raise ValueError(_unknown(part))
        if len(parts) > 1 and EXHAUSTIVE in parts:
            # Exhaustive patterns are numbered; a random second fault would break the count.
            raise ValueError(f"{EXHAUSTIVE} are counted through and go with nothing else")
        if len(set(parts)) < len(parts):
            raise ValueError(f"{name!r} names a class twice; it goes with others only")
        if parts in seen:
            raise ValueError(f"{name!r} is named twice; say it once")
        seen.add(parts)
    return names


def _unknown(name: str) -> str:
    close = [repr(c) for c in guesses(name, CATALOGUE, cutoff=0.4)]
    hint = f"Did you mean {one_of(close)}? " if close else ""
    return f"no class {name!r}. {hint}There are all, {', '.join(CATALOGUE)}."
