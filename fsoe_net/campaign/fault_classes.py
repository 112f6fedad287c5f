"""The fault catalogue: network errors of frames, and errors of a faulty relay.

Each class draws one case for a given point of a run. ``docs/reference/fault-catalogue.md`` explains
how FSoE reacts, and why a CRC collision is as likely as stated.
"""

from __future__ import annotations

import random
from dataclasses import dataclass

from fsoe_net.campaign.beyond_crc import make_edge, make_enable, make_forged, make_former
from fsoe_net.campaign.bit_errors import block_bits, block_count
from fsoe_net.campaign.channel import BACK, Way
from fsoe_net.campaign.clean_run import STARTUP_SHARE, Scene
from fsoe_net.campaign.faults import (
    Alternate,
    Freeze,
    Late,
    Slip,
    Swap,
    Torn,
    compose,
)
from fsoe_net.campaign.injection import (
    CRC_CHANCE,
    DATA_COMMANDS,
    ForeignFrames,
    Injection,
    Make,
    again_chance,
    below,
    between,
    flip,
    span,
    swap,
)
from fsoe_net.errors import ConfigError
from fsoe_net.fsoe.pdu import Command

_IGNORED = 1 / 16  # half of the start-up at most: a wrong first Session reply is ignored (§11.2)


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultClass:
    """One class of the catalogue.

    Attributes:
        name: Name in ``--faults``.
        kind: The communication error of IEC 61784-3 that it belongs to.
        text: Description for people.
        tolerable: Largest share of cases that no end is required to detect, justified in
            ``docs/reference/fault-catalogue.md``.
        startup_share: Share of the points that are in the start-up.
        make: Draws a case, or ``None`` if there is no case at this point. Its arguments: random
            source, point, other connections, number of the run.
    """

    name: str
    kind: str
    text: str
    make: Make
    tolerable: float
    startup_share: float = STARTUP_SHARE


def _make_corruption(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection:
    size = len(scene.frame)
    cycles = 1 if below(rng, 2) else 4
    # One in eight: patterns that are not tied to the blocks of a frame.
    if below(rng, 8) == 0:  # anywhere: from a few bits up to half of them
        mask = rng.getrandbits(8 * size)
        for _ in range(below(rng, 8)):  # half of them, a quarter … a few
            mask &= rng.getrandbits(8 * size)
        return flip(scene, mask or 1, None, cycles)
    bits = block_bits(size)
    mask = rng.getrandbits(bits) or 1
    # Share of all non-zero patterns of a block that have a valid CRC.
    chance = (2.0 ** (bits - 16) - 1) / (2.0**bits - 1)
    return flip(scene, mask << (8 + bits * below(rng, block_count(size))), chance, cycles)


def _older(rng: random.Random, scene: Scene, most: int) -> bytes | None:
    back = between(rng, 1, most + 1)
    return scene.frames[scene.index - back] if scene.index >= back else None


def _make_repetition(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection | None:
    if scene.index == 0:
        return None
    if below(rng, 4) == 0:
        frame: bytes | None = scene.frames[below(rng, scene.index)]
    else:
        frame = _older(rng, scene, 48)
    return None if frame is None else swap(scene, frame, between(rng, 1, 4), again_chance(scene))


def _make_sequence(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection | None:
    """Two frames swapped: first a later frame, then the one that it replaced."""
    ahead = scene.index + between(rng, 1, 9)
    if ahead < len(scene.frames):
        return swap(scene, scene.frames[ahead], between(rng, 1, 4), again_chance(scene))
    back = _older(rng, scene, 8)
    return None if back is None else swap(scene, back, 2, again_chance(scene))


def _gap(rng: random.Random, scene: Scene) -> int:
    """Cycles of a gap: one in eight shorter than the watchdog, the others up to twice as long."""
    watchdog = scene.watchdog_cycles
    if below(rng, 8) == 0:
        return between(rng, 1, max(2, watchdog))
    return between(rng, watchdog, 2 * watchdog + 2)


def _ways(rng: random.Random, scene: Scene) -> tuple[Way, ...]:
    """One direction or both; with both, the main cannot inform the sub."""
    return (scene.way,) if rng.random() < 0.5 else tuple(Way)


def _make_loss(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection:
    _, start, until = span(scene, _gap(rng, scene))
    ways = _ways(rng, scene)
    faults = compose(*(Freeze(way=way, start=start, until=until) for way in ways))
    return Injection(faults=faults, patient=True)


def _make_delay(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection:
    late = _gap(rng, scene)
    _, start, until = span(scene, 3 * late + 8)
    ways = _ways(rng, scene)
    faults = compose(*(Late(way=way, start=start, until=until, cycles=late) for way in ways))
    return Injection(faults=faults, patient=True)


def _make_insertion(
    rng: random.Random, scene: Scene, foreign: ForeignFrames, number: int
) -> Injection:
    frames = foreign.frames(scene.way, number, same_id=below(rng, 4) != 0)
    return swap(scene, rng.choice(frames), between(rng, 1, 4), CRC_CHANCE)


def _make_masquerade(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection:
    frame, kind = scene.frame, below(rng, 16)
    size = len(frame)
    if kind < 10:  # with the right command and ConnID
        middle = rng.randbytes(size - 3)
        # All fields except the CRC are right, so only the CRC can reject the frame.
        command = rng.choice(DATA_COMMANDS) if scene.in_data else frame[0]
        made = bytes((command,)) + middle + frame[-2:]
        return swap(scene, made, between(rng, 1, 4), CRC_CHANCE ** block_count(size))
    if kind < 12:
        return swap(scene, bytes((rng.choice(list(Command)),)) + rng.randbytes(size - 1))
    if kind < 14:
        return swap(scene, bytes((0 if kind == 12 else 0xFF,)) * size)
    # The receiver's own frame, as a wrong copy would return it.
    own = scene.channel.newest(BACK[scene.way]) or b""
    return swap(scene, own[:size].ljust(size, b"\0"), between(rng, 1, 4))


def _make_addressing(
    rng: random.Random, scene: Scene, foreign: ForeignFrames, number: int
) -> Injection:
    """The frame of another connection at the same point of its own run, for some time."""
    frames = foreign.frames(scene.way, number, same_id=False)
    return swap(scene, frames[min(scene.index, len(frames) - 1)], between(rng, 1, 64))


def _make_stale(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection | None:
    frame = _older(rng, scene, 8)
    return None if frame is None else swap(scene, frame, between(rng, 1, 3), again_chance(scene))


def _make_torn(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection | None:
    way, start, until = span(scene, between(rng, 1, 3))
    head = between(rng, 2, len(scene.frame) - 2)  # command and ConnID are mostly equal
    torn = Torn(way=way, start=start, until=until, head_bytes=head)
    if torn.apply(scene.channel, scene.frame) == scene.channel.shown(way):
        return None  # the new bytes are equal to the old ones, so there is no fault
    return Injection(faults=(torn,))


def _make_crossed(
    rng: random.Random, scene: Scene, foreign: ForeignFrames, number: int
) -> Injection:
    cycles = between(rng, 1, 12)
    parts = []
    for way in Way if below(rng, 2) else (scene.way,):
        frames = foreign.frames(way, number, same_id=False)
        frame = frames[min(scene.index, len(frames) - 1)]
        start = scene.channel.cycle
        parts.append(Swap(way=way, start=start, until=start + cycles, frame=frame))
    return Injection(faults=compose(*parts))


def _make_slip(rng: random.Random, scene: Scene, foreign: ForeignFrames, number: int) -> Injection:
    way, start, until = span(scene, between(rng, 1, 4))
    shift = between(rng, 1, len(scene.frame)) * rng.choice((-1, 1))
    if below(rng, 2):
        filler = rng.choice(foreign.frames(way, number, same_id=False))
    else:
        filler = rng.choice((b"\0", b"\xff", scene.frame))
    slip = Slip(way=way, start=start, until=until, shift=shift, filler=filler)
    return Injection(faults=(slip,))


def _make_late(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection:
    way, start, until = span(scene, between(rng, 2, 6))
    return Injection(faults=(Late(way=way, start=start, until=until, cycles=1),))


def _make_double(
    rng: random.Random, scene: Scene, foreign: ForeignFrames, number: int
) -> Injection | None:
    if below(rng, 2):
        frame, chance = _older(rng, scene, 8), again_chance(scene)
    else:
        frame = rng.choice(foreign.frames(scene.way, number, same_id=bool(below(rng, 2))))
        chance = CRC_CHANCE
    if frame is None:
        return None
    way, start, until = span(scene, between(rng, 2, 12))
    fault = Alternate(way=way, start=start, until=until, frame=frame)
    return Injection(faults=(fault,), chance=chance)


def _enumerated(
    _rng: random.Random, _scene: Scene, _foreign: ForeignFrames, _number: int
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
            tolerable=_IGNORED,
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
            make=make_forged,
            tolerable=1 / 4,
            startup_share=0.75,
        ),
        FaultClass(
            name="former_session",
            kind="unintended repetition",
            text="a former session again, many starts of one",
            make=make_former,
            tolerable=_IGNORED,
        ),
        FaultClass(
            name="parameters",
            kind="addressing",
            text="a main that sends what the sub must refuse",
            make=_enumerated,
            tolerable=0,
        ),
        FaultClass(
            name="watchdog_edge",
            kind="unacceptable delay",
            text="a frame up to 1 % before, at and after the watchdog",
            make=make_edge,
            tolerable=1 / 3,
            startup_share=0.0,
        ),
        FaultClass(
            name="enable",
            kind="loss",
            text="the applications withdraw the enable or leave it alone",
            make=make_enable,
            tolerable=1 / 2,
            startup_share=0.0,
        ),
    )
}
