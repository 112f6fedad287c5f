"""Pairs by lengths: settled only where one way is left."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsoe_net.model.bus import Direction, Entry
from fsoe_net.model.layout import FsoeBlock
from fsoe_net.model.pairing import PairEnd, pair_by_lengths


def pair(subdevice: int, slot: int, to: int, back: int) -> PairEnd:
    def block(length: int, way: Direction) -> FsoeBlock:
        command = Entry(index=0x7000, subindex=1, bits=8)
        return FsoeBlock(
            byte_offset=0, frame_bytes=length, command=command, direction=way, sm_index=2
        )

    return PairEnd(
        subdevice=subdevice,
        slot=slot,
        written=block(to, Direction.OUTPUT),
        read=block(back, Direction.INPUT),
    )


def keys(pairs) -> list[tuple]:
    return [(main.key, sub.key) for main, sub in pairs]


def test_a_slot_takes_the_frames_the_other_way_round():
    main, sub = pair(0, 0, 7, 6), pair(1, 0, 6, 7)
    assert main.fits(sub)
    assert not main.fits(pair(1, 0, 7, 6))
    assert keys(pair_by_lengths([main], [sub]).settled) == [((0, 0), (1, 0))]


def test_two_that_differ_in_length_are_settled():
    mains = [pair(0, 0, 6, 6), pair(0, 1, 11, 31)]
    subs = [pair(1, 0, 31, 11), pair(2, 0, 6, 6)]
    found = pair_by_lengths(mains, subs)
    assert keys(found.settled) == [((0, 1), (1, 0)), ((0, 0), (2, 0))]
    assert found.open == ()


@pytest.mark.parametrize(("slots", "subs"), [(2, 1), (1, 2), (2, 2), (3, 3)])
def test_equal_lengths_stay_open_and_name_every_candidate(slots: int, subs: int):
    found = pair_by_lengths(
        [pair(0, n, 6, 6) for n in range(slots)], [pair(n + 1, 0, 6, 6) for n in range(subs)]
    )
    assert found.settled == ()
    assert [len(o.candidates) for o in found.open] == [slots] * subs
    assert [len(o.rivals) for o in found.open] == [subs - 1] * subs
    given = [o.proposed.slot for o in found.open if o.proposed]
    assert given == list(range(min(slots, subs)))


def test_a_doubtful_frame_of_the_same_lengths_keeps_a_pair_open():
    mains, subs = [pair(0, 0, 6, 7)], [pair(1, 0, 7, 6)]
    assert pair_by_lengths(mains, subs).settled
    for doubtful in (pair(2, 0, 7, 6), pair(2, 0, 6, 7)):
        found = pair_by_lengths(mains, subs, [doubtful])
        assert found.settled == ()
        assert found.open[0].candidates == (mains[0],)
    assert pair_by_lengths(mains, subs, [pair(2, 0, 6, 6)]).settled


def test_pair_without_equal_lengths_stays_open():
    found = pair_by_lengths([pair(0, 0, 6, 6)], [pair(1, 0, 7, 6)])
    assert found.open[0].candidates == ()
    assert found.open[0].proposed is None


LENGTHS = st.sampled_from([(6, 6), (6, 7), (7, 6), (11, 31), (31, 11)])


@given(st.lists(LENGTHS, max_size=5), st.lists(LENGTHS, max_size=5))
def test_settled_is_what_every_possible_assignment_has(mains, subs):
    slots = [pair(0, n, *lengths) for n, lengths in enumerate(mains)]
    ends = [pair(n + 1, 0, *lengths) for n, lengths in enumerate(subs)]
    found = pair_by_lengths(slots, ends)
    for main, sub in found.settled:
        others = [s for s in slots if s is not main and s.fits(sub)]
        rivals = [e for e in ends if e is not sub and main.fits(e)]
        assert not others
        assert not rivals
        assert main.fits(sub)
    proposed = [o.proposed.key for o in found.open if o.proposed]
    assert len(set(proposed)) == len(proposed)
    assert not {m.key for m, _ in found.settled} & set(proposed)
    seen = itertools.chain((s.key for _, s in found.settled), (o.sub.key for o in found.open))
    assert sorted(seen) == [e.key for e in ends]
