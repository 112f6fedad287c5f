"""Minimises a failing trial and repeats it from power-up, so that it can be read and replayed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from fsoe_net.campaign.channel import Fault, Way
from fsoe_net.campaign.clean_run import Scene
from fsoe_net.campaign.faults import Alternate, Flip, Swap, shortened
from fsoe_net.campaign.injection import Injection
from fsoe_net.campaign.judge import FAILURES, TrialFinding, judge
from fsoe_net.campaign.recorder import Recorder
from fsoe_net.campaign.trials import Case

_SEED = 1
_POINTS = 64  # new frames from power-up at which a fault is tried
_MAX_TURNS = 4000


@dataclass(frozen=True, slots=True, kw_only=True)
class Shrunk:
    """A minimised failing case.

    Attributes:
        faults: The remaining faults; cycles count from power-up.
        reason: The wrong acceptance.
        lines: Recording of the run, for `fsoe_net.campaign.recording.replay`.
    """

    faults: tuple[Fault, ...]
    reason: str
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Point:
    """A new frame of the clean run from power-up."""

    cycle: int
    way: Way
    frame: bytes
    past: tuple[bytes, ...]


class _Bench:
    """Repeats the run of one connection from power-up with given faults."""

    def __init__(self, case: Case) -> None:
        self._link, self._patient = case.link, case.injection.patient
        self._constant = case.scene.constant
        self.points = list(self._clean())

    def _recorder(self) -> Recorder:
        recorder = Recorder(self._link, _SEED)
        channel = recorder.channel
        channel.application = replace(channel.application, constant=self._constant)
        return recorder

    def _clean(self) -> Iterator[_Point]:
        channel = self._recorder().channel
        count = 0
        for _ in range(_MAX_TURNS):
            # A point is where an image changes; between two points, nothing happens.
            way, frame = channel.way, channel.image(channel.way, channel.cycle)
            if frame is not None and frame != channel.shown(way):
                past = tuple(sent for _, sent in channel.sent[way])
                yield _Point(cycle=channel.cycle, way=way, frame=frame, past=past)
                count += 1
            if count >= _POINTS:
                return
            channel.turn()

    def run(self, faults: tuple[Fault, ...]) -> tuple[TrialFinding, Recorder]:
        recorder = self._recorder()
        channel = recorder.channel
        start = min(fault.start for fault in faults)
        while channel.cycle < start:
            channel.turn()
        scene = Scene(
            channel=channel,
            way=faults[0].way,
            watchdog_cycles=self._link.watchdog_cycles,
        )
        injection = Injection(faults=faults, patient=self._patient)
        finding = judge(scene, injection, self._link.watchdog_ns)
        return finding, recorder

    def fails(self, faults: tuple[Fault, ...]) -> bool:
        if not faults:
            return False
        return self.run(faults)[0].verdict in FAILURES


def shrink(case: Case) -> Shrunk | None:
    """Return the smallest case found that still fails.

    Fewer faults, fewer bits, fewer cycles, an earlier point of the run: each reduction is kept if a
    frame is still wrongly accepted. ``None`` if the case does not fail from power-up, for example
    because it needs a long run first.

    Args:
        case: The failing trial, as `Trials.case` returns it, not yet run.
    """
    if case.injection.miswired:
        return _from_power_up(case)
    bench = _Bench(case)
    faults = _moved(bench, case)
    if faults is None:
        return None
    for reduce in (_fewer_faults, _shorter, _fewer_bits, _earlier, _fewer_bits):
        faults = reduce(bench, faults)
    finding, recorder = bench.run(faults)
    note = " and ".join(str(fault) for fault in faults)
    return Shrunk(faults=faults, reason=finding.reason, lines=tuple(recorder.lines(note)))


def _from_power_up(case: Case) -> Shrunk:
    """Repeat a miswired connection; it is miswired from power-up, so nothing can be removed."""
    recorder = Recorder(case.link, _SEED)
    recorder.channel.turn()
    case.scene.channel = recorder.channel
    finding = judge(case.scene, case.injection, case.link.watchdog_ns)
    return Shrunk(
        faults=(), reason=finding.reason, lines=tuple(recorder.lines("main of another sub"))
    )


def _moved(bench: _Bench, case: Case) -> tuple[Fault, ...] | None:
    """Return the faults at the first point of the run from power-up where they fail."""
    scene = case.scene
    for point in bench.points:
        if point.way is not scene.way:
            continue
        for faults in _candidates(case, point):
            if bench.fails(faults):
                return faults
    return None


def _candidates(case: Case, point: _Point) -> Iterator[tuple[Fault, ...]]:
    """Yield the faults of a trial, moved to another point of another run."""
    scene = case.scene
    by = point.cycle - scene.channel.cycle
    for translate in (_same_bits, _same_age, _same_frame):
        moved = [translate(fault, scene, point) for fault in case.injection.faults]
        yield tuple(
            replace(fault, start=fault.start + by, until=fault.until + by)  # type: ignore[type-var]
            for fault in moved
        )


def _same_bits(fault: Fault, scene: Scene, _point: _Point) -> Fault:
    if not isinstance(fault, Swap) or fault.way is not scene.way:
        return fault
    mask = int.from_bytes(fault.frame, "little") ^ int.from_bytes(scene.frame, "little")
    return Flip(way=fault.way, start=fault.start, until=fault.until, mask=mask)


def _same_age(fault: Fault, scene: Scene, point: _Point) -> Fault:
    if not isinstance(fault, Swap | Alternate) or fault.frame not in scene.frames[: scene.index]:
        return fault
    back = scene.index - scene.frames.index(fault.frame)
    return replace(fault, frame=point.past[max(0, len(point.past) - 1 - back)])


def _same_frame(fault: Fault, _scene: Scene, _point: _Point) -> Fault:
    return fault


_Faults = tuple[Fault, ...]


def _fewer_faults(bench: _Bench, faults: _Faults) -> _Faults:
    for fault in faults:
        rest = tuple(other for other in faults if other is not fault)
        if bench.fails(rest):
            faults = rest
    return faults


def _each(bench: _Bench, faults: _Faults, smaller: Callable[[Fault], Iterator[Fault]]) -> _Faults:
    """Replace each fault by the first smaller one that still fails."""
    for n, fault in enumerate(faults):
        for candidate in smaller(fault):
            changed = (*faults[:n], candidate, *faults[n + 1 :])
            if bench.fails(changed):
                faults = changed
                break
    return faults


def _shorter(bench: _Bench, faults: _Faults) -> _Faults:
    def smaller(fault: Fault) -> Iterator[Fault]:
        cycles = 1
        while cycles < fault.until - fault.start:
            yield shortened(fault, cycles)
            cycles *= 2

    return _each(bench, faults, smaller)


def _fewer_bits(bench: _Bench, faults: _Faults) -> _Faults:
    """Restore as many bits as possible: halves, quarters and so on, finally one at a time."""
    for n, fault in enumerate(faults):
        if not isinstance(fault, Flip):
            continue
        bits = [bit for bit in range(fault.mask.bit_length()) if fault.mask >> bit & 1]
        size = len(bits) // 2 or 1
        # Halving finds large removable parts fast; the last round proves that no single bit is
        # needed.
        while size:
            at = 0
            while at < len(bits):
                kept = bits[:at] + bits[at + size :]
                flip = replace(fault, mask=sum(1 << bit for bit in kept))
                # At least one bit must stay flipped: otherwise there is no fault.
                if kept and bench.fails((*faults[:n], flip, *faults[n + 1 :])):
                    bits, faults = kept, (*faults[:n], flip, *faults[n + 1 :])
                else:
                    at += size
            size //= 2
    return faults


def _earlier(bench: _Bench, faults: _Faults) -> _Faults:
    first = min(fault.start for fault in faults)
    # Search from the start of the run: the earliest point gives the shortest trace.
    for point in bench.points:
        by = point.cycle - first
        if by >= 0:
            break
        moved = tuple(
            replace(fault, start=fault.start + by, until=fault.until + by)  # type: ignore[type-var]
            for fault in faults
        )
        if bench.fails(moved):
            return moved
    return faults
