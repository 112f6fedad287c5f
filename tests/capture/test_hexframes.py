"""Frames typed or pasted as hex."""

import contextlib

import pytest
from fsoe.pair import Bench
from hypothesis import given
from hypothesis import strategies as st

from fsoe_net.capture.hexframes import follow_frames, parse_frames
from fsoe_net.errors import InputError
from fsoe_net.fsoe.observed import CrcVerdict

RESET = "2a0000c42d0000"
# What other implementations sent: 2/2 bytes, session ids 0x1122 and 0x3344, ConnID 0xABCD.
START_UP = """
M 2a0000c42d0000  S 2a0000c42d0000     M 4e2211fddd0000  S 4e4433f5760000
M 64cdabac4dcdab  S 64cdab018dcdab     M 6434121350cdab  S 643412dd7acdab
M 52020024d1cdab  S 520200cb9fcdab     M 526400d592cdab  S 5264004a68cdab
M 520000e008cdab  S 520000f5eacdab     M 08000099f9cdab  S 0800005ac6cdab
"""


def frames(text):
    return list(parse_frames((f"x:{n}", line) for n, line in enumerate(text.split("\n"), 1)))


def verdicts(text):
    return [seen.verdict for seen in follow_frames(frames(text))]


@pytest.mark.parametrize(
    "text",
    [
        RESET,
        "2A0000C42D0000",
        "0x2a0000c42d0000",
        "2a 00 00 c4 2d 00 00",
        "2a:00:00:c4:2d:00:00",
        "2a-00-00-c4-2d-00-00",
        "0x2a, 0x00, 0x00, 0xc4, 0x2d, 0x0, 0x0",
        "2a 0 0 c4 2d 0 0   # a Reset",
        "# nothing\n\n2a0000c42d0000",
    ],
)
def test_ways_to_write_a_frame(text):
    (frame,) = frames(text)
    assert (frame.data.hex(), frame.direction) == (RESET, None)


@pytest.mark.parametrize("mark", ["m", "M", "main", "main:", ">", "master"])
def test_main_is_marked(mark):
    assert [f.direction for f in frames(f"{mark} {RESET}")] == [0]
    assert [f.direction for f in frames(f"{mark} 2a 00 00 c4 2d 00 00 s 2a 00 00 c4 2d 00 00")] == [
        0,
        1,
    ]


def test_a_whole_start_up_is_right():
    assert verdicts(START_UP) == [CrcVerdict.RIGHT] * 16
    assert verdicts(START_UP.replace("M", "").replace("S", "")) == [CrcVerdict.RIGHT] * 16
    assert [s.sequence for s in follow_frames(frames(START_UP))][:6] == [0, 0, 1, 1, 2, 2]


def test_one_changed_bit_is_wrong_there():
    text = START_UP.replace("643412dd7acdab", "643412dd7bcdab")
    assert verdicts(text)[:8] == [CrcVerdict.RIGHT] * 7 + [CrcVerdict.WRONG]


def test_directions_of_different_lengths_need_no_mark():
    bench = Bench(2, 6).to_data()
    seen = list(follow_frames(frames("\n".join(frame.hex() for frame in bench.log))))
    assert {s.verdict for s in seen} == {CrcVerdict.RIGHT}
    assert {(len(s.frame.data), s.direction) for s in seen} == {(7, 0), (15, 1)}


def test_a_single_frame_names_what_it_can():
    (data,) = follow_frames(frames("3603001234 0100".replace(" ", "")))
    assert data.verdict is CrcVerdict.UNCHECKED
    assert data.note == "the CRC depends on the frame before, which is missing"
    long = Bench(6, 6).to_data().log[-1]
    (whole,) = follow_frames(frames(long.hex()))
    assert "blocks fit each other" in whole.note
    broken = long[:7] + bytes((long[7] ^ 1,)) + long[8:]
    (torn,) = follow_frames(frames(broken.hex()))
    assert "damaged" in torn.note


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("xyz", "x:1: 'xyz' is neither hex nor a file"),
        ("2a0", "x:1: '2a0' is neither hex"),
        (f"{RESET}\n2a00", "x:2: '2a00' has 2 bytes; FSoE frames have 6, 7, 11"),
        ("bus.pcap", "'bus.pcap' is neither hex nor a file"),
        (f"m {RESET} m 2a0086f80000", "has 6 bytes, other frames of the main have 7"),
        (f"{RESET} 2a0086f80000 2a0000c42d0000b9140000", "decode one connection at a time"),
    ],
)
def test_mistakes_are_located(text, message):
    with pytest.raises(InputError, match=message.replace("(", r"\(")):
        list(follow_frames(frames(text)))


@given(st.text(alphabet="0123456789abcdefMS<>x:-, #\n", max_size=200))
def test_any_text_is_decoded_or_rejected(text):
    with contextlib.suppress(InputError):
        list(follow_frames(frames(text)))


def test_a_byte_order_mark_is_not_a_part_of_the_first_frame():
    assert [frame.data.hex() for frame in frames(f"\ufeff{RESET}\n{RESET}")] == [RESET] * 2
    with pytest.raises(InputError, match="x:2"):
        frames(f"{RESET}\n\ufeff{RESET}")


@pytest.mark.parametrize("word", ["2a" * 100_000, "z" * 100_000])
def test_a_huge_word_is_shortened(word):
    with pytest.raises(InputError) as caught:
        frames(word)
    assert f"{word[:60]!r}..." in str(caught.value)
    assert len(str(caught.value)) < 200
