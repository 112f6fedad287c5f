"""The C monitor and the Python one, given the same frames, must say the same."""

import copy
import random

import pytest
from core.both_monitors import TO_MAIN, TO_SUB, Both
from fsoe.pair import Bench, make_main, make_sub
from hypothesis import given, settings
from hypothesis import strategies as st
from weekly import examples

from fsoe_net.core.module import compiled
from fsoe_net.core.monitor import Monitor
from fsoe_net.errors import PduSizeError
from fsoe_net.fsoe.chain import Chain
from fsoe_net.fsoe.crc import frame_crcs, solve_sequence
from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict
from fsoe_net.fsoe.pdu import SAFE_SIZES, decode_pdu, frame_length
from fsoe_net.self_test.monitor import PythonMonitor

sizes = st.sampled_from([1, 2, 4, 6, 14, 126])
words = st.integers(0, 0xFFFF)


def frame_fits(data: bytes, old: int, sequence: int) -> bool:
    """Whether all CRCs of a frame are right for this old CRC and sequence number."""
    _, lib = compiled()
    return bool(lib.fsn_fsoe_check(data, len(data), old, sequence))


def frame_sequence(data: bytes, old: int) -> int:
    """Return the one sequence number for which CRC_0 of a frame is right."""
    _, lib = compiled()
    return int(lib.fsn_fsoe_solve_sequence(data, len(data), old))


@given(st.sampled_from(sorted(SAFE_SIZES)), words, words, st.data())
def test_check_of_any_frame(size, old, sequence, data):
    frame = bytearray(data.draw(st.binary(min_size=(n := frame_length(size)), max_size=n)))
    pdu = decode_pdu(bytes(frame))
    crcs = frame_crcs(old, pdu.connection_id, sequence, pdu.command, pdu.safe_data)
    assert frame_fits(bytes(frame), old, sequence) is (crcs == pdu.crcs)
    for block, crc in enumerate(crcs):
        at = 2 if size == 1 else 3 + 4 * block
        frame[at : at + 2] = crc.to_bytes(2, "little")
    assert frame_fits(bytes(frame), old, sequence)
    assert frame_sequence(bytes(frame), old) == sequence
    assert solve_sequence(old, pdu.connection_id, pdu.command, pdu.safe_data, crcs[0]) == sequence
    at = data.draw(st.integers(0, 8 * len(frame) - 1))
    frame[at // 8] ^= 1 << at % 8
    assert not frame_fits(bytes(frame), old, sequence)


@pytest.mark.parametrize("length", [0, 1, 5, 8, 9, 10, 12, 256, 259])
def test_lengths_no_frame_has(length):
    assert not frame_fits(bytes(length), 0, 1)


@pytest.mark.parametrize(("begin", "resets"), [("", 0), ("36 11 22 33 07 00", 1)])
def test_a_reset_counts_unless_the_direction_starts_with_it(begin, resets):
    """A monitor that begins in Data, as after a takeover, counts the first Reset it observes."""
    monitor = Monitor(1, 1)
    for n, text in enumerate((begin, "2a 05 01 02 00 00", "2a 00 03 04 00 00")):
        if text:
            monitor.frame(TO_MAIN, bytes.fromhex(text), n)
    assert monitor.counts(TO_MAIN).resets == resets


def frames_of(out, inn, cycles, seed=0, **changes):
    """Frames of a pair in the order sent, with its direction; one local reset on the way."""
    rng = random.Random(seed)
    bench = Bench(main=make_main(out, inn, **changes), sub=make_sub(out, inn))
    rows = []
    for cycle in range(cycles):
        if cycle == cycles // 2:
            bench.sub.request_reset()
        for end, turn, way in (
            (bench.main, bench.main_turn, TO_SUB),
            (bench.sub, bench.sub_turn, TO_MAIN),
        ):
            end.enable = end.state.value == "Data" and rng.random() < 0.9
            end.set_safe_data(rng.randbytes(end._sends))
            sent = turn()
            if sent is not None:
                rows.append((way, sent))
    return rows


@pytest.mark.shows("R18")
@given(sizes, sizes, st.integers(0, 99))
@settings(max_examples=30)
def test_whole_life_is_right(out, inn, seed):
    both = Both(out, inn)
    for way, frame in frames_of(out, inn, 60, seed):
        assert both.frame(way, frame) is CrcVerdict.RIGHT
    assert both.python.gaps == 0


@pytest.mark.shows("R18")
@pytest.mark.parametrize("size", [2, 6])
@pytest.mark.parametrize("rounds", [2, 4])
def test_a_collision_while_the_number_is_searched_for_and_known(size, rounds):
    """The next frame of a direction has one number more than expected, and its own reason."""
    main, sub = Chain(tx_sequence=5, rx_sequence=5), Chain(tx_sequence=5, rx_sequence=5)

    def sent(chain, other, data):
        frame = chain.send(0x36, data, 10)
        assert other.receive(decode_pdu(frame))
        return frame

    rows = []
    for n in range(rounds):
        rows.append((TO_SUB, sent(main, sub, bytes((n, 2)) * (size // 2))))
        rows.append((TO_MAIN, sent(sub, main, bytes((n, 4)) * (size // 2))))
    found = (n.to_bytes(2, "little") + bytes(size - 2) for n in range(0x10000))
    due = main.last, 10, main.tx_sequence, 0x36
    data = next(data for data in found if frame_crcs(*due, data)[0] == main.own)
    other = bytes((data[0] ^ 1, *data[1:]))
    for last, verdict in ((data, CrcVerdict.RIGHT), (other, CrcVerdict.RIGHT)):
        both = Both(size, size)
        seen = [both.frame(*row) for row in rows]
        assert seen == [CrcVerdict.UNCHECKED] * 3 + [CrcVerdict.RIGHT] * (2 * rounds - 3)
        assert both.frame(TO_SUB, sent(copy.copy(main), copy.copy(sub), last)) is verdict
    skips = copy.copy(main)
    skips.tx_sequence += 1
    both = Both(size, size)
    for row in rows:
        both.frame(*row)
    wrong = CrcVerdict.WRONG if rounds > 2 else CrcVerdict.UNCHECKED
    assert both.frame(TO_SUB, skips.send(0x36, other, 10)) is wrong


@pytest.mark.shows("R18")
@given(sizes, sizes, st.integers(0, 99), st.integers(0, 100))
@settings(max_examples=examples(60))
def test_joins_at_any_time(out, inn, seed, skip):
    """From the fourth frame on everything is checked: two numbers in each direction."""
    rows = frames_of(out, inn, 60, seed)[skip % 50 :]
    both = Both(out, inn)
    verdicts = [both.frame(way, frame) for way, frame in rows]
    assert CrcVerdict.WRONG not in verdicts
    assert set(verdicts[5:]) == {CrcVerdict.RIGHT}
    assert both.python.gaps == 0


@pytest.mark.shows("R18")
@given(sizes, sizes, st.integers(0, 99), st.data())
@settings(max_examples=examples(200))
@pytest.mark.uncounted
def test_both_agree_on_anything(out, inn, seed, data):
    rows = frames_of(out, inn, 40, seed)
    both = Both(out, inn)
    for _ in range(data.draw(st.integers(1, 120))):
        way, frame = rows[data.draw(st.integers(0, len(rows) - 1))]
        kind = data.draw(st.sampled_from(["good", "good", "flip", "random", "run"]))
        if kind == "flip":
            at = data.draw(st.integers(0, 8 * len(frame) - 1))
            frame = bytearray(frame)
            frame[at // 8] ^= 1 << at % 8
            frame = bytes(frame)
        elif kind == "random":
            frame = data.draw(st.binary(min_size=len(frame), max_size=len(frame)))
        elif kind == "run":
            start = data.draw(st.integers(0, len(rows) - 1))
            for row in rows[start : start + data.draw(st.integers(1, 12))]:
                both.frame(*row)
            continue
        both.frame(way, frame)


@pytest.mark.shows("R18")
@pytest.mark.parametrize(("out", "inn"), [(1, 1), (2, 2), (6, 14)])
@pytest.mark.parametrize("lost", [1, 2, 3, 4, 5])
def test_finds_the_chain_again_after_a_gap(out, inn, lost):
    rows = frames_of(out, inn, 28, seed=3)
    at = len(rows) - 16
    both = Both(out, inn)
    for way, frame in rows[:at]:
        both.frame(way, frame)
    rest = [both.frame(way, frame) for way, frame in rows[at + lost :]]
    assert rest[0] is (CrcVerdict.UNCHECKED if lost % 2 else CrcVerdict.WRONG)
    assert set(rest[5:]) == {CrcVerdict.RIGHT}
    assert both.python.gaps == 1


def test_wrong_frame_then_reset_is_not_a_gap():
    rows = frames_of(2, 2, 40)
    both = Both(2, 2)
    for way, frame in rows[:20]:
        both.frame(way, frame)
    way, frame = rows[20]
    assert both.frame(way, frame[:3] + bytes((frame[3] ^ 1,)) + frame[4:]) is CrcVerdict.WRONG
    again = [both.frame(way, frame) for way, frame in frames_of(2, 2, 20)]
    assert set(again) == {CrcVerdict.RIGHT}
    assert both.python.gaps == 0
    assert both.python.counts(way).wrong == 1


def test_stale_session_reply_does_not_lose_the_chain():
    """§5 row 11: a reply to a session given up before is ignored by the main and by us."""
    both = Both(2, 2)
    stale = bytes.fromhex("4e9999 f576 0000")
    for way, frame in frames_of(2, 2, 20)[:12]:
        assert both.frame(way, frame) is CrcVerdict.RIGHT
        if frame[0] == 0x4E and way == TO_SUB:
            assert both.frame(TO_MAIN, stale) is CrcVerdict.WRONG
    assert both.python.counts(TO_MAIN).wrong == 1


def test_counts_resets_and_their_codes():
    both = Both(2, 2)
    reset = bytes.fromhex
    both.frame(TO_SUB, reset("2a0500 25ae 0000"))
    both.frame(TO_MAIN, reset("2a0000 c42d 0000"))
    both.frame(TO_SUB, reset("2a0400 a634 0000"))
    counts = both.python.counts(TO_SUB)
    assert (counts.resets, counts.reset_code, counts.right) == (0, 4, 2)
    assert both.python.state is ConnectionState.RESET
    assert both.frame(TO_SUB, reset("2a0400 a635 0000")) is CrcVerdict.WRONG


def test_length_of_the_other_direction_is_refused():
    for monitor in (PythonMonitor(2, 4), Monitor(2, 4)):
        with pytest.raises(PduSizeError, match="11 bytes; frames here have 7"):
            monitor.frame(TO_SUB, bytes(10) + b"\1", 0)


def test_zeros_before_the_first_frame_are_not_frame():
    both = Both(1, 1)
    assert both.frame(TO_SUB, bytes(6)) is CrcVerdict.SAME
    assert both.python.counts(TO_SUB).frames == 0
