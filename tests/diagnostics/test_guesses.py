"""Guesses at misspelt words: one answer only where no other fits as well."""

from __future__ import annotations

import pytest

from fsoe_net.diag.guesses import Guesses, guesses, near_misses, one_of


@pytest.mark.parametrize(
    ("word", "known", "meant"),
    [
        ("logik", ["logics", "logic", "lo"], ("logic",)),
        ("LOGIC", ["logic"], ("logic",)),
        ("lgoic", ["logic"], ("logic",)),
        ("quite another", ["logic"], ()),
        # the same apart from what joins the parts
        ("drive-1", ["drive_1", "drive_2"], ("drive_1",)),
        ("subIndex", ["sub_index", "index"], ("sub_index",)),
        # names of one row are as near as each other
        ("drive-1", ["drive_2", "drive_3"], ("drive_2", "drive_3")),
        ("drive_3", ["drive_1", "drive_10", "io"], ("drive_1", "drive_10")),
        ("io3", ["io", "io2"], ("io", "io2")),
        # letters in another order
        ("drvie_12", ["drive_12", "drive_21"], ("drive_12", "drive_21")),
        ("uint61", ["uint16", "int16"], ("uint16",)),
        # its own numbers count more than its letters
        ("el1904_b", ["el1904_a", "el1908_b"], ("el1904_a",)),
        # a word that was not finished
        ("stat", ["start", "state"], ("state",)),
        ("drive_1", ["drive_10", "drive_2"], ("drive_10", "drive_2")),
        # too many are no guess
        ("FSN20", [f"FSN20{n}" for n in range(9)], ()),
        ("x" * 500, ["x" * 499], ()),
    ],
)
def test_each_word_that_fits_as_well_is_offered(
    word: str, known: list[str], meant: tuple[str, ...]
):
    assert guesses(word, known) == meant


@pytest.mark.parametrize(
    ("word", "known", "meant"),
    [
        # a part more or less: another thing
        ("value_hex", ["value"], ()),
        ("position_offset", ["position"], ()),
        ("position", ["position_offset"], ()),
        ("raw_position", ["position"], ()),
        # a misspelling, or a number
        ("positoin", ["position", "position_offset"], ("position",)),
        ("output_1", ["output"], ("output",)),
        ("value", ["Value"], ("Value",)),
        ("_", ["value"], ()),
    ],
)
def test_a_name_with_one_more_part_is_no_misspelling(
    word: str, known: list[str], meant: tuple[str, ...]
):
    assert near_misses(word, known) == meant


def test_words_are_joined_as_a_choice():
    assert [one_of(words) for words in ([], ["a"], ["a", "b"], ["a", "b", "c"])] == [
        "",
        "a",
        "a or b",
        "a, b or c",
    ]


def test_only_the_first_of_very_many_words_are_compared():
    """By then one mistake was made everywhere; letters in another order are still found."""
    known = Guesses([f"name_{n:06}" for n in range(100_000)], cutoff=0.9)
    assert known.of("nam_000001") == ("name_000001",)
    for n in range(3):
        known.of(f"other_{n}")
    assert known.of("nam_000002") == ()
    assert known.of("name-000002") == ("name_000002",)
