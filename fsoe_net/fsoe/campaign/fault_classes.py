"""The fault catalogue: what a network can do to frames, and what a faulty relay can.

Each class draws one case for a given point of a run. ``docs/reference/fault-catalogue.md`` says
what FSoE does about it, and why an accident passes the CRC as often as it does.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations
from math import comb

from fsoe_net.errors import ConfigError
from fsoe_net.fsoe.campaign.channel import BACK, Application, Fault, Way
from fsoe_net.fsoe.campaign.faults import (
    Alternate,
    Flip,
    Forge,
    Freeze,
    Late,
    Replay,
    Slip,
    Swap,
    Torn,
    compose,
)
from fsoe_net.fsoe.campaign.walk import STARTUP_SHARE, Link, Scene, Walker, other_link
from fsoe_net.fsoe.chain import reset_frame
from fsoe_net.fsoe.crc import block_crc, frame_crcs
from fsoe_net.fsoe.pdu import Command, assemble, frame_length, safe_data_length

__all__ = [
    "CATALOGUE",
    "FaultClass",
    "Injection",
    "Strangers",
    "bit_error",
    "bit_error_count",
    "code_distance",
]

_DATA = (int(Command.PROCESS_DATA), int(Command.FAIL_SAFE_DATA))
_CRC = 2.0**-16
_IGNORED = 1 / 16  # half of the start-up at most: a wrong first Session reply is ignored (§11.2)


@dataclass(slots=True, kw_only=True)  # not frozen: made a million times
class Injection:
    """One case.

    Attributes:
        faults: What happens on the way.
        chance: Probability that the CRCs of what is shown fit by accident, if it is a data frame
            with the right ConnID; ``None`` when nothing is known.
        patient: Whether the watchdogs of both ends are on trial, not only the quicker one.
        miswired: Whether the main speaks to a sub that is not its own, from power-up on.
        signed: Whether the CRCs of what is shown fit on purpose: the state tables alone judge it.
        stays: Whether the ends are watched to the end of the fault, whatever they notice before.
        former: Whether what is shown is right for another session id, ``chance`` apart.
        application: What the applications do from then on; ``None`` for the usual.
    """

    faults: tuple[Fault, ...]
    chance: float | None = None
    patient: bool = False
    miswired: bool = False
    signed: bool = False
    stays: bool = False
    former: bool = False
    application: Application | None = None


class Strangers:
    """Frames of other connections of the same sizes, for those classes in which they stray."""

    def __init__(self, link: Link, seed: int) -> None:
        self._walkers = [Walker(other_link(link, same_id=same), seed) for same in (False, True)]

    def frames(self, way: Way, number: int, *, same_id: bool) -> tuple[bytes, ...]:
        """Return all frames of one run; with ``same_id`` of a connection with copied settings."""
        return self._walkers[same_id].walk(number % 16).frames[way]


_Make = Callable[[random.Random, Scene, Strangers, int], Injection | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultClass:
    """One class of the catalogue.

    Attributes:
        name: As in ``--faults``.
        kind: Communication error of IEC 61784-3 it belongs to.
        text: What happens, for people.
        tolerable: Largest share of the cases that no end has to notice, for the reason that
            ``docs/reference/fault-catalogue.md`` gives.
        startup_share: Share of the points that lie in the start-up.
        make: Draws a case; ``None`` when this point has none. Its arguments: random source,
            point, other connections, number of the run.
    """

    name: str
    kind: str
    text: str
    make: _Make
    tolerable: float
    startup_share: float = STARTUP_SHARE


def _below(rng: random.Random, end: int) -> int:
    """As ``randrange``, which takes five times as long; these ranges are short."""
    return int(rng.random() * end)


def _between(rng: random.Random, start: int, end: int) -> int:
    return start + int(rng.random() * (end - start))


def _span(scene: Scene, cycles: int) -> tuple[Way, int, int]:
    start = scene.channel.cycle
    return scene.way, start, start + cycles


def _swap(scene: Scene, frame: bytes, cycles: int = 1, chance: float | None = None) -> Injection:
    way, start, until = _span(scene, cycles)
    return Injection(faults=(Swap(way=way, start=start, until=until, frame=frame),), chance=chance)


def _flip(scene: Scene, mask: int, chance: float | None, cycles: int = 1) -> Injection:
    way, start, until = _span(scene, cycles)
    return Injection(faults=(Flip(way=way, start=start, until=until, mask=mask),), chance=chance)


def _blocks(size_bytes: int) -> int:
    return 1 if size_bytes == 6 else (size_bytes - 3) // 4


def _bits_in_block(size_bytes: int) -> int:
    return 24 if size_bytes == 6 else 32


def _make_corruption(
    rng: random.Random, scene: Scene, _strangers: Strangers, _number: int
) -> Injection:
    size = len(scene.frame)
    cycles = 1 if _below(rng, 2) else 4
    if _below(rng, 8) == 0:  # anything anywhere: a few bits up to half of them
        mask = rng.getrandbits(8 * size)
        for _ in range(_below(rng, 8)):  # half of them, a quarter … a few
            mask &= rng.getrandbits(8 * size)
        return _flip(scene, mask or 1, None, cycles)
    bits = _bits_in_block(size)
    mask = rng.getrandbits(bits) or 1
    chance = (2.0 ** (bits - 16) - 1) / (2.0**bits - 1)
    return _flip(scene, mask << (8 + bits * _below(rng, _blocks(size))), chance, cycles)


def _older(rng: random.Random, scene: Scene, most: int) -> bytes | None:
    back = _between(rng, 1, most + 1)
    return scene.frames[scene.index - back] if scene.index >= back else None


def _make_repetition(
    rng: random.Random, scene: Scene, _strangers: Strangers, _number: int
) -> Injection | None:
    if scene.index == 0:
        return None
    if _below(rng, 4) == 0:
        frame: bytes | None = scene.frames[_below(rng, scene.index)]
    else:
        frame = _older(rng, scene, 48)
    return None if frame is None else _swap(scene, frame, _between(rng, 1, 4), _CRC)


def _make_sequence(
    rng: random.Random, scene: Scene, _strangers: Strangers, _number: int
) -> Injection | None:
    """Two frames swapped: one that comes later, then the one it took the place of."""
    ahead = scene.index + _between(rng, 1, 9)
    if ahead < len(scene.frames):
        return _swap(scene, scene.frames[ahead], _between(rng, 1, 4), _CRC)
    back = _older(rng, scene, 8)
    return None if back is None else _swap(scene, back, 2, _CRC)


def _gap(rng: random.Random, scene: Scene) -> int:
    """Cycles of a gap: one in eight shorter than the watchdog, the others up to twice as long."""
    watchdog = scene.watchdog_cycles
    if _below(rng, 8) == 0:
        return _between(rng, 1, max(2, watchdog))
    return _between(rng, watchdog, 2 * watchdog + 2)


def _ways(rng: random.Random, scene: Scene) -> tuple[Way, ...]:
    """One direction, or both: only then the sub cannot learn of it from the main."""
    return (scene.way,) if rng.random() < 0.5 else tuple(Way)


def _make_loss(rng: random.Random, scene: Scene, _strangers: Strangers, _number: int) -> Injection:
    _, start, until = _span(scene, _gap(rng, scene))
    ways = _ways(rng, scene)
    faults = compose(*(Freeze(way=way, start=start, until=until) for way in ways))
    return Injection(faults=faults, patient=True)


def _make_delay(rng: random.Random, scene: Scene, _strangers: Strangers, _number: int) -> Injection:
    late = _gap(rng, scene)
    _, start, until = _span(scene, 3 * late + 8)
    ways = _ways(rng, scene)
    faults = compose(*(Late(way=way, start=start, until=until, cycles=late) for way in ways))
    return Injection(faults=faults, patient=True)


def _make_insertion(
    rng: random.Random, scene: Scene, strangers: Strangers, number: int
) -> Injection:
    frames = strangers.frames(scene.way, number, same_id=_below(rng, 4) != 0)
    return _swap(scene, rng.choice(frames), _between(rng, 1, 4), _CRC)


def _make_masquerade(
    rng: random.Random, scene: Scene, _strangers: Strangers, _number: int
) -> Injection:
    frame, kind = scene.frame, _below(rng, 16)
    size = len(frame)
    if kind < 10:  # it even knows command and ConnID
        middle = rng.randbytes(size - 3)
        command = rng.choice(_DATA) if scene.in_data else frame[0]
        made = bytes((command,)) + middle + frame[-2:]
        return _swap(scene, made, _between(rng, 1, 4), _CRC ** _blocks(size))
    if kind < 12:
        return _swap(scene, bytes((rng.choice(list(Command)),)) + rng.randbytes(size - 1))
    if kind < 14:
        return _swap(scene, bytes((0 if kind == 12 else 0xFF,)) * size)
    own = scene.channel.newest(BACK[scene.way]) or b""
    return _swap(scene, own[:size].ljust(size, b"\0"), _between(rng, 1, 4))


def _make_addressing(
    rng: random.Random, scene: Scene, strangers: Strangers, number: int
) -> Injection:
    """The frame of another connection at the same point of its own run, and for some time."""
    frames = strangers.frames(scene.way, number, same_id=False)
    return _swap(scene, frames[min(scene.index, len(frames) - 1)], _between(rng, 1, 64))


def _make_stale(
    rng: random.Random, scene: Scene, _strangers: Strangers, _number: int
) -> Injection | None:
    frame = _older(rng, scene, 8)
    return None if frame is None else _swap(scene, frame, _between(rng, 1, 3), _CRC)


def _make_torn(rng: random.Random, scene: Scene, _strangers: Strangers, _number: int) -> Injection:
    way, start, until = _span(scene, _between(rng, 1, 3))
    head = _between(rng, 2, len(scene.frame) - 2)  # command and ConnID are mostly equal
    return Injection(faults=(Torn(way=way, start=start, until=until, head_bytes=head),))


def _make_crossed(rng: random.Random, scene: Scene, strangers: Strangers, number: int) -> Injection:
    cycles = _between(rng, 1, 12)
    parts = []
    for way in Way if _below(rng, 2) else (scene.way,):
        frames = strangers.frames(way, number, same_id=False)
        frame = frames[min(scene.index, len(frames) - 1)]
        start = scene.channel.cycle
        parts.append(Swap(way=way, start=start, until=start + cycles, frame=frame))
    return Injection(faults=compose(*parts))


def _make_slip(rng: random.Random, scene: Scene, strangers: Strangers, number: int) -> Injection:
    way, start, until = _span(scene, _between(rng, 1, 4))
    shift = _between(rng, 1, len(scene.frame)) * rng.choice((-1, 1))
    beside = (
        rng.choice(strangers.frames(way, number, same_id=False))
        if _below(rng, 2)
        else rng.choice((b"\0", b"\xff", scene.frame))
    )
    slip = Slip(way=way, start=start, until=until, shift=shift, beside=beside)
    return Injection(faults=(slip,))


def _make_late(rng: random.Random, scene: Scene, _strangers: Strangers, _number: int) -> Injection:
    way, start, until = _span(scene, _between(rng, 2, 6))
    return Injection(faults=(Late(way=way, start=start, until=until, cycles=1),))


def _make_double(
    rng: random.Random, scene: Scene, strangers: Strangers, number: int
) -> Injection | None:
    if _below(rng, 2):
        frame: bytes | None = _older(rng, scene, 8)
    else:
        frame = rng.choice(strangers.frames(scene.way, number, same_id=bool(_below(rng, 2))))
    if frame is None:
        return None
    way, start, until = _span(scene, _between(rng, 2, 12))
    fault = Alternate(way=way, start=start, until=until, frame=frame)
    return Injection(faults=(fault,), chance=_CRC)


def _make_forged(
    rng: random.Random, scene: Scene, _strangers: Strangers, _number: int
) -> Injection:
    """One field wrong, every CRC right: what only the tables of §5 and §6 refuse."""
    way, start, until = _span(scene, 1)
    plain = Forge(way=way, start=start, until=until)
    forge = _forge(rng, scene, plain)
    if _below(rng, 2):
        return Injection(faults=(forge,), signed=True)
    faults = forge, _watched(scene, scene.startup_cycles + 8)  # until it is in Data again
    return Injection(faults=faults, signed=True, stays=True)


def _watched(scene: Scene, cycles: int) -> Fault:
    """Return a fault that does nothing: so long the ends are watched."""
    end = scene.channel.cycle + cycles
    return Flip(way=scene.way, start=end, until=end, mask=0)


def _forge(rng: random.Random, scene: Scene, plain: Forge) -> Forge:
    due, kind = scene.frame[0], _below(rng, 10)
    if kind < 2:
        right = int.from_bytes(scene.frame[-2:], "little")
        other = rng.choice((0, right ^ 1, right ^ 0x100, rng.getrandbits(16)))
        return replace(plain, connection_id=other if other != right else right ^ 1)
    if kind < 5:
        others = [row for row in Command if row != due and not {due, int(row)} <= set(_DATA)]
        return replace(plain, command=int(rng.choice(others)))
    if kind == 5:
        known = set(Command)
        return replace(plain, command=rng.choice([row for row in range(256) if row not in known]))
    if kind == 6:
        return replace(plain, ahead=rng.choice((-1, 1, 2, 0x7FFF)))
    if kind == 7:
        return replace(plain, spoiled=rng.getrandbits(16) or 1)
    if kind == 8 or scene.in_data:
        command = rng.choice((int(Command.RESET), int(Command.SESSION)))
        wrong = rng.choice((0, 0, 1, 0x8000))
        return replace(plain, command=command, connection_id=0, from_start=True, spoiled=wrong)
    return replace(plain, turned=1 << _below(rng, 8 * min(2, _data_bytes(scene.frame))))


def _data_bytes(frame: bytes) -> int:
    return safe_data_length(len(frame))


def _make_former(
    rng: random.Random, scene: Scene, _strangers: Strangers, _number: int
) -> Injection | None:
    """The frames of a former start-up again, or six starts of a session in a row."""
    way, start, until = _span(scene, 48)
    back = BACK[way]
    quiet = Freeze(way=back, start=start, until=until)
    if _below(rng, 2):
        frames = _starts(way, _data_bytes(scene.frame), rng)
        replay = Replay(way=way, start=start, until=until, frames=frames)
        return Injection(faults=(replay, quiet), signed=True, stays=True)
    frames = scene.frames[: min(scene.index, 24)]
    if not any(frame[0] == Command.CONNECTION for frame in frames):
        return None
    replay = Replay(way=way, start=start, until=until, frames=frames)
    return Injection(faults=(replay, quiet), chance=_CRC, stays=True, former=True)


def _starts(way: Way, size: int, rng: random.Random) -> tuple[bytes, ...]:
    """Return frames that each make their receiver draw a new session id."""
    if way is Way.TO_MAIN:
        return tuple(reset_frame(code, size) for code in rng.sample(range(1, 12), 6))
    frames = []
    for value in rng.sample(range(1, 256), 6):
        data = bytes((value,)) + bytes(size - 1)
        crcs = frame_crcs(0, 0, 1, Command.SESSION, data)
        frames.append(assemble(Command.SESSION, data, crcs, 0))
    return tuple(frames)


def _make_edge(
    rng: random.Random, scene: Scene, _strangers: Strangers, _number: int
) -> Injection | None:
    """The frame comes one cycle before the receiver's watchdog expires, then, or one after."""
    if not scene.in_data:
        return None
    way, start, _ = _span(scene, 1)
    channel = scene.channel
    due = channel.answered_ns[way] // channel.cycle_ns + scene.watchdog_cycles
    until = due + _below(rng, 3) - 1
    if until <= start:
        return None
    return Injection(faults=(Freeze(way=way, start=start, until=until),), patient=True)


def _make_enable(
    rng: random.Random, scene: Scene, _strangers: Strangers, _number: int
) -> Injection | None:
    """The applications enable nothing any more, or leave the enable alone over a Reset."""
    if not scene.in_data:
        return None
    way, start, until = _span(scene, 1)
    application = scene.channel.application
    if _below(rng, 2):
        gone = replace(application, withdrawn_from=start)
        return Injection(faults=(_watched(scene, _between(rng, 5, 13)),), application=gone)
    faults = (
        Flip(way=way, start=start, until=until, mask=1 << 8),
        _watched(scene, scene.startup_cycles + 8),
    )
    alone = replace(application, hands_off_from=start)
    return Injection(faults=faults, stays=True, application=alone)


def _enumerated(
    _rng: random.Random, _scene: Scene, _strangers: Strangers, _number: int
) -> Injection | None:
    raise ConfigError("cases of this class are not drawn for a point of a run")


CATALOGUE: dict[str, FaultClass] = {
    row.name: row
    for row in (
        FaultClass(
            name="bit_errors",
            kind="corruption",
            text="every pattern of fewer bits than the code's distance",
            make=_enumerated,
            tolerable=0,
        ),
        FaultClass(
            name="corruption",
            kind="corruption",
            text="other data and CRC in a block, or any bits anywhere",
            make=_make_corruption,
            tolerable=_IGNORED,
        ),
        FaultClass(
            name="repetition",
            kind="unintended repetition",
            text="an older frame again",
            make=_make_repetition,
            tolerable=_IGNORED,
        ),
        FaultClass(
            name="incorrect_sequence",
            kind="incorrect sequence",
            text="a later frame first",
            make=_make_sequence,
            tolerable=_IGNORED,
        ),
        FaultClass(
            name="loss",
            kind="loss",
            text="nothing arrives for a while",
            make=_make_loss,
            tolerable=_IGNORED + 1 / 8,
        ),
        FaultClass(
            name="delay",
            kind="unacceptable delay",
            text="frames arrive too late",
            make=_make_delay,
            tolerable=_IGNORED + 1 / 8,
        ),
        FaultClass(
            name="insertion",
            kind="insertion",
            text="a frame of another connection, ConnID mostly equal",
            make=_make_insertion,
            tolerable=_IGNORED,
        ),
        FaultClass(
            name="masquerade",
            kind="masquerade",
            text="bytes of no FSoE end, or the own frame back",
            make=_make_masquerade,
            tolerable=_IGNORED,
        ),
        FaultClass(
            name="addressing",
            kind="addressing",
            text="connected to another connection",
            make=_make_addressing,
            tolerable=_IGNORED,
        ),
        FaultClass(
            name="stale_copy",
            kind="unintended repetition",
            text="the relay copies an old image",
            make=_make_stale,
            tolerable=_IGNORED + 1 / 8,
        ),
        FaultClass(
            name="torn_copy",
            kind="corruption",
            text="the relay copies half of a new frame",
            make=_make_torn,
            tolerable=2 * _IGNORED,
        ),
        FaultClass(
            name="crossed_copy",
            kind="addressing",
            text="the relay swaps two connections",
            make=_make_crossed,
            tolerable=_IGNORED,
        ),
        FaultClass(
            name="offset_slip",
            kind="corruption",
            text="the relay copies from a wrong byte on",
            make=_make_slip,
            tolerable=_IGNORED,
        ),
        FaultClass(
            name="late_cycle",
            kind="unacceptable delay",
            text="the relay copies one cycle late",
            make=_make_late,
            tolerable=1,
        ),
        FaultClass(
            name="double_writer",
            kind="insertion",
            text="two copies write one image in turn",
            make=_make_double,
            tolerable=_IGNORED,
        ),
        FaultClass(
            name="forged",
            kind="masquerade",
            text="one field wrong, every CRC right",
            make=_make_forged,
            tolerable=1 / 4,
            startup_share=0.75,
        ),
        FaultClass(
            name="former_session",
            kind="unintended repetition",
            text="a former session again, many starts of one",
            make=_make_former,
            tolerable=_IGNORED,
        ),
        FaultClass(
            name="parameters",
            kind="addressing",
            text="a main that tells what the sub must refuse",
            make=_enumerated,
            tolerable=0,
        ),
        FaultClass(
            name="watchdog_edge",
            kind="unacceptable delay",
            text="a frame just before, at and after the watchdog",
            make=_make_edge,
            tolerable=1 / 3,
            startup_share=0.0,
        ),
        FaultClass(
            name="enable",
            kind="loss",
            text="the applications withdraw the enable or leave it alone",
            make=_make_enable,
            tolerable=1 / 2,
            startup_share=0.0,
        ),
    )
}


@cache
def code_distance(data_bytes: int) -> int:
    """Return the fewest bits of a block, data and CRC, that can turn without being noticed.

    The CRC is linear: an error of the data goes unnoticed with exactly one error of the CRC, its
    own CRC. All errors of the data are tried.

    Args:
        data_bytes: Safe data bytes in the block, 1 or 2.
    """
    return min(
        data.bit_count() + block_crc(0, 0, 0, 0, 0, data.to_bytes(data_bytes, "little")).bit_count()
        for data in range(1, 1 << 8 * data_bytes)
    )


@cache
def _patterns(bits: int, most: int) -> tuple[int, ...]:
    """Return all numbers of ``bits`` bits with 1 … ``most`` of them set."""
    return tuple(
        sum(1 << bit for bit in chosen)
        for weight in range(1, most + 1)
        for chosen in combinations(range(bits), weight)
    )


_FEW_BLOCKS = 2


def _way_count(size: int) -> tuple[int, int]:
    """Return how many patterns lie within blocks and how many anywhere in a frame."""
    bits, blocks = _bits_in_block(size), _blocks(size)
    most = code_distance(1 if size == 6 else 2) - 1
    one = sum(comb(bits, weight) for weight in range(1, most + 1))
    return one * (blocks if blocks <= _FEW_BLOCKS else 1), 8 * size + comb(8 * size, 2)


def bit_error_count(link: Link) -> int:
    """Return how many bit errors there are: see `bit_error`."""
    return sum(sum(_way_count(frame_length(size))) for size in link.sizes)


def bit_error(link: Link, number: int) -> tuple[Way, int]:
    """Return direction and mask of bit error ``number``, see `Flip`.

    First all patterns of fewer bits than `code_distance` within a block: in each of one or two
    blocks, in turn in those of a longer frame, as the code is the same in all. Then all patterns
    of one and two bits anywhere in the frame.
    """
    way = Way.TO_SUB
    size = frame_length(link.sizes[way])
    if number >= sum(_way_count(size)):
        number -= sum(_way_count(size))
        way = Way.TO_MAIN
        size = frame_length(link.sizes[way])
    within, _ = _way_count(size)
    if number >= within:
        return way, _patterns(8 * size, 2)[number - within]
    bits, blocks = _bits_in_block(size), _blocks(size)
    patterns = _patterns(bits, code_distance(1 if size == 6 else 2) - 1)
    block = number // len(patterns) if blocks <= _FEW_BLOCKS else number % blocks
    return way, patterns[number % len(patterns)] << (8 + bits * block)
