"""One case of a fault class, and helpers to draw one."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

from fsoe_net.campaign.channel import Application, Fault, Way
from fsoe_net.campaign.clean_run import RunSource, Scene, TrialConnection, other_link
from fsoe_net.campaign.faults import Flip, Swap
from fsoe_net.fsoe.pdu import Command

DATA_COMMANDS = (int(Command.PROCESS_DATA), int(Command.FAIL_SAFE_DATA))
CRC_CHANCE = 2.0**-16  # that a 16-bit CRC matches by accident


@dataclass(slots=True, kw_only=True)  # not frozen: millions of instances
class Injection:
    """One case.

    Attributes:
        faults: Faults on the way.
        chance: Probability that the CRCs of the delivered frame match by accident, if it is a data
            frame with the right ConnID; ``None`` when unknown.
        patient: Whether the watchdogs of both ends are tested, not only the faster one.
        miswired: Whether the main communicates with a wrong sub, from power-up on.
        signed: Whether the CRCs of the delivered frame match on purpose, so that only the state
            tables apply.
        stays: Whether the ends are watched until the fault ends, even after a detection.
        former: Whether the delivered frame is valid for another session id, apart from ``chance``.
        application: Behaviour of the applications from then on; ``None`` for the default.
    """

    faults: tuple[Fault, ...]
    chance: float | None = None
    patient: bool = False
    miswired: bool = False
    signed: bool = False
    stays: bool = False
    former: bool = False
    application: Application | None = None


class ForeignFrames:
    """Frames of other connections of the same sizes, for the classes with misrouted frames."""

    def __init__(self, link: TrialConnection, seed: int) -> None:
        self._walkers = [RunSource(other_link(link, same_id=same), seed) for same in (False, True)]

    def frames(self, way: Way, number: int, *, same_id: bool) -> tuple[bytes, ...]:
        """Return all frames of one run; with ``same_id``, of a connection with copied settings."""
        return self._walkers[same_id].walk(number % 16).frames[way]


Make = Callable[[random.Random, Scene, ForeignFrames, int], Injection | None]


def below(rng: random.Random, end: int) -> int:
    """Same as ``randrange``, which is five times slower for these short ranges."""
    return int(rng.random() * end)


def between(rng: random.Random, start: int, end: int) -> int:
    """Return a number from ``start`` on, below ``end``."""
    return start + int(rng.random() * (end - start))


def span(scene: Scene, cycles: int) -> tuple[Way, int, int]:
    """Return direction, first cycle and end cycle (exclusive) of a fault at this point."""
    start = scene.channel.cycle
    return scene.way, start, start + cycles


def swap(scene: Scene, frame: bytes, cycles: int = 1, chance: float | None = None) -> Injection:
    """Return a case in which another frame is delivered."""
    way, start, until = span(scene, cycles)
    return Injection(faults=(Swap(way=way, start=start, until=until, frame=frame),), chance=chance)


def again_chance(scene: Scene) -> float | None:
    """Return the probability that an earlier or later frame of the same run is valid by accident.

    With constant data, only the expected frame would be valid, and that is not a fault.
    """
    return None if scene.constant else CRC_CHANCE


def flip(scene: Scene, mask: int, chance: float | None, cycles: int = 1) -> Injection:
    """Return a case in which bits of the frame are flipped."""
    way, start, until = span(scene, cycles)
    return Injection(faults=(Flip(way=way, start=start, until=until, mask=mask),), chance=chance)
