"""Cases that no CRC detects: a wrong field, an old session, watchdog and enable at their limits."""

from __future__ import annotations

import random
from dataclasses import replace

from fsoe_net.campaign.channel import BACK, Fault, Way
from fsoe_net.campaign.clean_run import Scene
from fsoe_net.campaign.faults import Early, Flip, Forge, Freeze, Replay
from fsoe_net.campaign.injection import (
    CRC_CHANCE,
    DATA_COMMANDS,
    ForeignFrames,
    Injection,
    below,
    between,
    span,
)
from fsoe_net.fsoe.chain import reset_frame
from fsoe_net.fsoe.crc import frame_crcs
from fsoe_net.fsoe.pdu import Command, assemble, safe_data_length


def make_forged(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection:
    """One wrong field with valid CRCs: only the state tables of §5 and §6 reject it."""
    way, start, until = span(scene, 1)
    plain = Forge(way=way, start=start, until=until)
    forge = _forge(rng, scene, plain)
    if below(rng, 2):
        return Injection(faults=(forge,), signed=True)
    faults = forge, _watched(scene, scene.startup_cycles + 8)  # until it is in Data again
    return Injection(faults=faults, signed=True, stays=True)


def _watched(scene: Scene, cycles: int) -> Fault:
    """Return a fault without effect, so that the ends are observed for that time."""
    end = scene.channel.cycle + cycles
    return Flip(way=scene.way, start=end, until=end, mask=0)


def _forge(rng: random.Random, scene: Scene, plain: Forge) -> Forge:
    # All fields are equally likely, except that a wrong ConnID is the most frequent relay error.
    due, kind = scene.frame[0], below(rng, 12)
    if kind < 3:
        return replace(plain, connection_id=_other_id(rng, scene, alone=kind > 0))
    if kind < 6:
        # In Data, both data commands are allowed: swapping them belongs to another class.
        others = [
            row for row in Command if row != due and not {due, int(row)} <= set(DATA_COMMANDS)
        ]
        return replace(plain, command=int(rng.choice(others)))
    if kind == 6:
        known = set(Command)
        return replace(plain, command=rng.choice([row for row in range(256) if row not in known]))
    # The frame after the next one: everything is valid except its sequence number.
    if kind == 7:  # the frame that follows the one due, with its data or with others
        return replace(plain, ahead=1, turned=rng.choice((0, 1 << below(rng, _turnable(scene)))))
    if kind == 8:
        return replace(plain, ahead=rng.choice((-1, 2, 0x7FFF)))
    if kind == 9:
        return replace(plain, spoiled=rng.getrandbits(16) or 1)
    # A valid Reset or Session with a wrong CRC must not restart an end.
    if kind == 10 or scene.in_data:
        command = rng.choice((int(Command.RESET), int(Command.SESSION)))
        wrong = rng.choice((0, 0, 1, 0x8000))
        return replace(plain, command=command, connection_id=0, from_start=True, spoiled=wrong)
    return replace(plain, turned=1 << below(rng, _turnable(scene)))


def _other_id(rng: random.Random, scene: Scene, *, alone: bool) -> int:
    """Return a wrong ConnID: 0, any, or with one byte ``alone`` that differs."""
    right = int.from_bytes(scene.frame[-2:], "little")
    turned = between(rng, 1, 0x100) if below(rng, 2) else 1 << below(rng, 8)
    byte = right ^ turned << 8 * below(rng, 2)
    other = byte if alone else rng.choice((0, rng.getrandbits(16)))
    return other if other != right else byte


def _turnable(scene: Scene) -> int:
    """Return how many bits of safe data are checked in every state."""
    return 8 * min(2, _data_bytes(scene.frame))


def _data_bytes(frame: bytes) -> int:
    return safe_data_length(len(frame))


def make_former(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection | None:
    """The frames of an earlier start-up, repeated, or six session starts in a row."""
    way, start, until = span(scene, 48)
    back = BACK[way]
    quiet = Freeze(way=back, start=start, until=until)
    if below(rng, 2):
        frames = _starts(way, _data_bytes(scene.frame), rng)
        replay = Replay(way=way, start=start, until=until, frames=frames)
        return Injection(faults=(replay, quiet), signed=True, stays=True)
    frames = scene.frames[: min(scene.index, 24)]
    if not any(frame[0] == Command.CONNECTION for frame in frames):
        return None
    replay = Replay(way=way, start=start, until=until, frames=frames)
    return Injection(faults=(replay, quiet), chance=CRC_CHANCE, stays=True, former=True)


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


def make_edge(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection | None:
    """A frame arrives up to 1 % before the receiver's watchdog expires, then, or up to 1 % after.

    The bus cycle is moved to that time, plus the grace of an end whose watchdog may be late.
    """
    if not scene.in_data:
        return None
    way, start, _ = span(scene, 1)
    channel = scene.channel
    table = channel.tables[way]
    assert table is not None  # noqa: S101 - a link makes both
    margin_ns = between(rng, 1, table.watchdog_ns // 100_000 + 1) * 1000 + table.grace_ns
    at_ns = channel.answered_ns[way] + table.watchdog_ns + (below(rng, 3) - 1) * margin_ns
    until = -(-at_ns // channel.cycle_ns)
    if until <= start:
        return None
    faults = (
        Freeze(way=way, start=start, until=until),
        Early(way=way, start=until, until=until, early_ns=until * channel.cycle_ns - at_ns),
    )
    return Injection(faults=faults, patient=True)


def make_enable(
    rng: random.Random, scene: Scene, _foreign: ForeignFrames, _number: int
) -> Injection | None:
    """The applications withdraw the enable, or keep it during a Reset."""
    if not scene.in_data:
        return None
    way, start, until = span(scene, 1)
    application = scene.channel.application
    if below(rng, 2):
        gone = replace(application, withdrawn_from=start)
        return Injection(faults=(_watched(scene, between(rng, 5, 13)),), application=gone)
    faults = (
        Flip(way=way, start=start, until=until, mask=1 << 8),
        _watched(scene, scene.startup_cycles + 8),
    )
    alone = replace(application, hands_off_from=start)
    return Injection(faults=faults, stays=True, application=alone)
