"""FSoE frames weighed: all known devices, ordinary process data, and what is in between."""

from __future__ import annotations

from collections.abc import Iterator
from operator import attrgetter

import pytest
from changed import compare, figures
from model.fsoe_table import pdo, rows

from fsoe_net.model.bus import Direction, Pdo, SyncManager
from fsoe_net.model.detect import FsoeGuess, detect_fsoe, near_misses
from fsoe_net.model.layout import place_entries

SM3 = SyncManager(index=3, direction=Direction.INPUT)
TABLE = rows()


def guess_pdo(one: Pdo, direction: Direction) -> tuple[FsoeGuess, ...]:
    manager = SyncManager(index=2 if direction is Direction.OUTPUT else 3, direction=direction)
    return detect_fsoe(place_entries((one,)), manager)


def guesses(text: str, name: str = ""):
    return guess_pdo(pdo(text, name=name), Direction.INPUT)


@pytest.mark.parametrize("row", TABLE, ids=lambda r: f"{r.device} {r.direction.value}")
def test_every_known_frame_is_found_with_its_length(row):
    (found,) = guess_pdo(row.pdo, row.direction)
    assert (found.block.byte_offset, found.block.frame_bytes) == (0, row.frame_bytes)
    assert found.block.direction is row.direction
    assert found.block.sm_index == (2 if row.direction is Direction.OUTPUT else 3)
    neighbour = any(e.address == "0x6768:03" for e in row.pdo.entries)
    assert found.sure is not neighbour
    assert found.reasons
    assert bool(found.doubts) is neighbour or "padding" in " ".join(found.doubts)


def test_table_is_whole():
    assert len(TABLE) == 46
    assert {row.frame_bytes for row in TABLE} == {6, 7, 11, 15, 31}


STANDARD = {
    "analogue input": "6000:01/1 6000:02/1 -/6 -/8 6000:11/16 6000:12/16",
    "record with status, two words on one object": "6000:01/8 6000:02/8 6000:11/16 6000:12/16",
    "counter": "6000:01/8 6000:02/16 6000:03/16",
    "drive": "6041:00/16 6064:00/32 6061:00/8 -/8 603F:00/16 6077:00/16",
    "six bytes": "6061:00/8 -/8 603F:00/16 6077:00/16",
    "32 digital inputs": "6000:01-20/1",
    "words": "6000:01/16 6000:02/16 6000:03/16",
}


@pytest.mark.parametrize("name", STANDARD)
def test_ordinary_process_data_are_not_taken(name):
    assert guesses(STANDARD[name]) == ()


def test_names_that_speak_of_something_else_make_it_doubtful():
    text = "6000:01/8=Status -/8 6000:02/16=Counter_value 6000:03/16=Latch_value"
    (found,) = guesses(text, name="Inputs")
    assert not found.sure
    assert any("Counter value" in d for d in found.doubts)
    (unnamed,) = guesses("6000:01/8 -/8 6000:02/16 6000:03/16")
    assert unnamed.sure
    assert unnamed.score > found.score


def test_swapped_names_do_not_matter():
    text = "6000:01/8=FSoE_CMD 6001:01/8 6000:03/16=FSoE_ConnID 6000:02/16=FSoE_CRC_0"
    (found,) = guesses(text)
    assert found.sure
    assert found.score == 100
    assert not found.doubts


def test_an_unusual_object_needs_names():
    (plain,) = guesses("2F10:01/8 2F11:01/8 2F10:02/16 2F10:03/16")
    assert not plain.sure
    (named,) = guesses("2F10:01/8=FSoE_CMD 2F11:01/8 2F10:02/16=CRC 2F10:03/16=ConnID")
    assert named.sure
    assert any("0x2f10" in d for d in named.doubts)


def test_places_without_a_common_object_are_likely_at_best_and_need_both_names():
    text = "6000:01/8=Command 6001:01/16 6002:01/16=CRC_0 6003:01/16=Connection_ID"
    (found,) = guesses(text)
    assert (found.block.frame_bytes, found.sure, found.block.likely) == (7, False, True)
    assert any("0x6002:01" in d for d in found.doubts)
    assert guesses("6000:01/8=Command 6001:01/16 6002:01/16 6003:01/16=Connection_ID") == ()


def test_a_crc_on_a_neighbour_is_likely_whatever_the_names():
    text = (
        "6760:01/8=FSoE_CMD 6640:00/16 6768:03/16=CRC_0 6641:00/16 6760:04/16=CRC_1 "
        "6760:02/16=FSoE_ConnID"
    )
    (found,) = guesses(text)
    assert (found.block.frame_bytes, found.score, found.block.likely) == (11, 70, True)
    assert found.doubts == ("not on the object of the command 0x6760: 0x6768:03",)


def test_frame_after_ordinary_data_and_two_in_a_row():
    text = (
        "6041:00/16 6064:00/32 6760:01/8 6640:00/16 6760:03/16 6760:02/16 "
        "6770:01/8 6641:00/8 6770:03/16 6770:02/16 6100:01/16"
    )
    found = guesses(text)
    assert [(g.block.byte_offset, g.block.frame_bytes) for g in found] == [(6, 7), (13, 6)]


def test_broken_mapping_is_named_with_the_place_that_fails():
    five = "7050:01/8=FSoE_CMD 7051:01-05/1 7050:03/16=FSoE_CRC_0 7050:02/16=FSoE_ConnID"
    placed = place_entries((pdo(five),))
    assert detect_fsoe(placed, SM3) == ()
    (miss,) = near_misses(placed, SM3)
    assert "13 bits after the command instead of 16 or 24" in miss.why


NO_ID = "no connection ID of 16 bits follows the last CRC"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("6000:01/16=CMD 6000:02/16=CRC 6000:03/16=ConnID", "no command of 8 bits was found"),
        (
            "-/1 6000:01/8 6001:01/8 6000:02/16=CRC 6000:03/16=Conn",
            "its command 0x6000:01 starts at bit 1, inside a byte",
        ),
        (
            "6000:01/8 6001:01/8 6000:02/8=CRC 6000:03/16=Conn",
            "CRC 0 (0x6000:02) has 8 bits instead of 16",
        ),
        (
            "6000:01/8 6001:01/16 6000:02/16=CRC 6001:02/8 6000:04/16=CRC 6000:03/16=Conn",
            "CRC 1 (0x6000:04) starts 48 bits after the command instead of 56",
        ),
        ("6000:01/8 6001:01/8 6000:02/16=CRC 6000:03/8=Conn", NO_ID),
        ("6000:01/8 6001:01/8 6000:01/16=CRC -/16=Conn", NO_ID),
        ("6000:03/16=Conn 6000:01/8 6001:01/8 6000:02/16=CRC", NO_ID),
        (
            "1000:01/8 6001:01/8 6000:02/16=CRC 6004:03/16=Conn",
            "its command, CRCs and connection ID do not belong together",
        ),
    ],
)
def test_near_misses_give_the_reason(text, why):
    (miss,) = near_misses(place_entries((pdo(text),)), SM3)
    assert miss.why == why


def _changes(text: str) -> Iterator[tuple[str, str]]:
    """Yield an entry list with each word gone, twice, elsewhere, of other bits or another name."""
    words = text.split()
    yield "as it is", text
    for n, word in enumerate(words):
        place, _, rest = word.partition("/")
        bits, _, name = rest.partition("=")
        others = ["", f"{word} {word}", f"-/8 {word}", f"-/1 {word}"]
        others += [f"{place}/{other}" for other in (1, 7, 8, 9, 16, 17) if name]
        others += [f"{place}/{bits}={other}" for other in ("FSoE", "conn", "Crc", "other", "cmd")]
        if place != "-":
            index, subs = int(place[:4], 16), place[4:]
            for by in (-17, -16, -15, -14, 1, 14, 15, 16):
                others.append(f"{index + by:04x}{subs}/{rest}")
            for far in (0x1FFF, 0x2000, 0x5FFF, 0x6000, 0x7FFF, 0x8000, 0xE5FF, 0xE600, 0xE7FF):
                others.append(f"{far:04x}{subs}/{rest}")
        for other in others:
            changed = " ".join([*words[:n], other, *words[n + 1 :]])
            yield f"{n} {other}", changed


WEIGHED = {
    "six": "6000:01/8=FSoE_CMD 6001:01/8=Stop 6000:03/16=FSoE_CRC_0 6000:02/16=FSoE_ConnID",
    "seven, no names": "6000:01/8 6001:01/16 6000:03/16 6000:02/16",
    "eleven": "6000:01/8 6001:01/16 6000:03/16=CRC_0 6001:02/16 6000:04/16 6000:02/16=Conn",
    "no common object": "6000:01/8=Command 6001:01/16 6002:01/16=CRC_0 6003:01/16=Connection_ID",
    "two and data": "6041:00/16 6760:01/8 6640:00/16 6760:03/16 6760:02/16 "
    "6770:01/8=CMD 6641:00/8 6771:03/16=CRC 6772:02/16=Conn 6100:01/16",
}


GUESS = attrgetter(
    *["block.byte_offset", "block.frame_bytes", "block.likely", "score", "reasons", "doubts"]
)


@pytest.mark.weekly
@pytest.mark.parametrize("name", WEIGHED)
def test_each_change_of_what_is_weighed(name):
    results = []
    for change, text in _changes(WEIGHED[name]):
        made = pdo(text, name="Safety inputs" if "=" in text else "")
        rows = [
            (GUESS(g), g.block.command.address, g.sure) for g in guess_pdo(made, Direction.INPUT)
        ]
        missed = [figures(miss.why) for miss in near_misses(place_entries((made,)), SM3)]
        results.append((change, f"{rows} {missed}"))
    compare(__file__, f"weighed {name}", results)


def test_more_entries_than_a_device_has():
    placed = place_entries((pdo("6000:01/8 6001:01/8 6000:03/16 6000:02/16 6100:01/1x19996"),))
    assert len(placed) == 20_000
    assert len(detect_fsoe(placed, SM3)) == 1
    more = place_entries((pdo("6000:01/8 6001:01/8 6000:03/16 6000:02/16 6100:01/1x19997"),))
    assert detect_fsoe(more, SM3) == ()


def test_frames_and_plain_data_raise_no_finding():
    frame = pdo("6000:01/8=CMD 6001:01/8 6000:03/16=CRC 6000:02/16=ConnID")
    plain = pdo("6000:01/8=Status 6000:02/16=Value", index=0x1A01)
    assert near_misses(place_entries((frame, plain)), SM3) == ()


def test_names_in_a_guess_are_cut():
    (named,) = guesses(f"7000:01/8={'FSoE_' + 'n' * 60} 7001:01/8 7000:03/16 7000:02/16")
    assert f"names mention FSoE, such as {'FSoE ' + 'n' * 35!r}" in named.reasons
    (other,) = guesses("7000:01/8=a 7001:01/8=b 7000:03/16=c 7000:02/16=d")
    assert "no name mentions FSoE, CRC or connection: a, c, d" in other.doubts
