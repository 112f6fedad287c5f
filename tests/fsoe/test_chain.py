"""The chain (§3): numbers, collisions, wrap."""

import copy

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fsoe_net.fsoe.chain import Chain, advance, before, is_whole
from fsoe_net.fsoe.crc import frame_crcs
from fsoe_net.fsoe.pdu import decode_pdu


def _colliding(chain: Chain, connection_id: int = 10) -> bytes:
    """Safe data whose CRC_0 would equal that of the frame this end sent last."""
    for word in range(0x10000):
        data = word.to_bytes(2, "little")
        if frame_crcs(chain.last, connection_id, chain.tx_sequence, 0x36, data)[0] == chain.own:
            return data
    raise AssertionError("CRC_0 is a bijection of the data, so there is one")


def _pair(sequence: int = 1) -> tuple[Chain, Chain]:
    left = Chain(tx_sequence=sequence, rx_sequence=sequence)
    right = Chain(tx_sequence=sequence, rx_sequence=sequence)
    for _ in range(2):
        assert right.receive(decode_pdu(left.send(0x36, b"\1\2", 10)))
        assert left.receive(decode_pdu(right.send(0x36, b"\3\4", 10)))
    return left, right


def test_sequence_number_skips_zero():
    numbers = (1, 2, 65534, 65535)
    assert [advance(n) for n in numbers] == [2, 3, 65535, 1]
    assert [before(advance(n)) for n in numbers] == list(numbers)


@pytest.mark.parametrize("size", [1, 2, 4, 126])
def test_blocks_that_fit_each_other(size):
    """Whatever the frame before was: the number is solved for, and old 0 will do."""
    frame = Chain(last=0x1234, tx_sequence=77).send(0x36, bytes(range(size)), 10)
    assert is_whole(decode_pdu(frame))
    for at in (1, len(frame) - 5):
        bad = frame[:at] + bytes((frame[at] ^ 0x40,)) + frame[at + 1 :]
        assert is_whole(decode_pdu(bad)) is (size <= 2)


def test_start_values_and_clear():
    chain = Chain()
    assert (chain.last, chain.own, chain.peer) == (0, None, None)
    assert (chain.tx_sequence, chain.rx_sequence) == (1, 1)
    left, _ = _pair()
    left.clear()
    assert left == Chain()


def test_collision_advances_one_side_once_more():
    left, right = _pair()
    before = left.tx_sequence
    data = _colliding(left)
    own = left.own
    frame = left.send(0x36, data, 10)
    assert decode_pdu(frame).crcs[0] != own
    assert left.tx_sequence == before + 2
    assert right.receive(decode_pdu(frame))
    assert right.rx_sequence == before + 2
    assert right.tx_sequence == before  # the two directions count apart
    assert left.receive(decode_pdu(right.send(0x36, b"\5\6", 10)))


def test_the_frame_without_the_collision_rule_is_refused():
    left, right = _pair()
    data = _colliding(left)
    plain = copy.copy(left)
    plain.own = None
    assert not right.receive(decode_pdu(plain.send(0x36, data, 10)))


def test_a_wrong_frame_changes_nothing():
    left, right = _pair()
    frame = left.send(0x36, b"\1\2", 10)
    before = copy.copy(right)
    for at in range(len(frame)):
        bad = frame[:at] + bytes((frame[at] ^ 0x40,)) + frame[at + 1 :]
        assert not right.receive(decode_pdu(bad))
        assert right == before
    assert right.receive(decode_pdu(frame))


@pytest.mark.parametrize("collide", [False, True])
@pytest.mark.parametrize("start", [65530, 65531, 65532, 65533])
def test_sequence_number_wraps_with_and_without_collisions(start, collide):
    left, right = _pair(start)
    numbers = []
    for turn in range(8):
        numbers.append(left.tx_sequence)
        data = _colliding(left) if collide and turn in (0, 3) else bytes((turn, turn))
        assert right.receive(decode_pdu(left.send(0x36, data, 10)))
        assert left.receive(decode_pdu(right.send(0x36, b"\3\4", 10)))
        assert left.tx_sequence == right.rx_sequence
    assert 0 not in numbers
    assert min(numbers) <= 4


def test_collision_at_65535_uses_1():
    left, right = _pair(65533)
    assert left.tx_sequence == 65535
    assert right.receive(decode_pdu(left.send(0x36, _colliding(left), 10)))
    assert left.tx_sequence == right.rx_sequence == 2


@settings(deadline=None)
@given(
    st.integers(1, 65535),
    st.lists(st.tuples(st.binary(min_size=4, max_size=4), st.booleans()), max_size=30),
)
def test_two_ends_always_understand_each_other(start, turns):
    left = Chain(tx_sequence=start, rx_sequence=start)
    right = copy.copy(left)
    for data, swap in turns:
        command = 0x36 if swap else 0x08
        seen = left.last
        assert right.receive(decode_pdu(left.send(command, data, 7)))
        assert left.receive(decode_pdu(right.send(command, data[::-1], 7)))
        assert left.last == right.last == right.own == left.peer
        assert left.tx_sequence == right.rx_sequence != 0
        assert right.tx_sequence == left.rx_sequence != 0
        del seen


@settings(deadline=None)
@given(st.integers(1, 65535), st.integers(0, 65535), st.binary(min_size=2, max_size=2))
def test_one_step_more_is_always_enough(sequence, old, data):
    first = frame_crcs(old, 7, sequence, 0x36, data)[0]
    chain = Chain(last=old, own=first, tx_sequence=sequence)
    assert decode_pdu(chain.send(0x36, data, 7)).crcs[0] != first
