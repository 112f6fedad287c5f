"""Number spellings: what every reader takes for the same number, and what is refused by name."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.numbers import Reader, driver_endpoint_number, read_float, read_int
from fsoe_net.formats.shared.yaml_tree import ScalarNode


def read(text: str, reader: Reader, high: int = 0xFFFF) -> tuple[int | None, list[str]]:
    out = Collector()
    node = ScalarNode("f", 0, text, True)
    value = read_int(node, out, what="index", low=0, high=high, reader=reader)
    return value, [d.code for d in out.diagnostics]


# Measured with the driver's own function (see the reference of number traps in the docs).
@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0x6000", 0x6000),
        ("24576", 0x6000),
        ("0X6000", 0),
        ("060000", 60000),
        ("0x16000", 0x6000),
        ("6000h", 6000),
        ("-5", 0xFFFB),
        ("0x", 0),
        ("0x 6000", 0),
        ("0x6000:01", 0x6000),
        ("0x70g0", 0x70),
        ("", None),
    ],
)
def test_values_that_the_driver_reads(text: str, value: int | None):
    assert driver_endpoint_number(text) == value


@pytest.mark.parametrize("reader", list(Reader))
@pytest.mark.parametrize(
    ("text", "value"), [("0x6000", 0x6000), ("24576", 24576), ("0", 0), ("07", 7)]
)
def test_plain_spellings_are_the_same_everywhere(text: str, value: int, reader: Reader):
    assert read(text, reader) == (value, [])


@pytest.mark.parametrize(
    ("text", "reader", "code"),
    [
        ("0X6000", Reader.ENDPOINT, "FSN112"),
        ("6000h", Reader.ENDPOINT, "FSN112"),
        ("0x6000:01", Reader.ENDPOINT, "FSN112"),
        ("0x", Reader.ENDPOINT, "FSN112"),
        ("#x6000", Reader.OWN, "FSN112"),
        ("1_000", Reader.SLAVE, "FSN112"),
        ("1.0", Reader.SLAVE, "FSN112"),
        ("0b11", Reader.SLAVE, "FSN112"),
        ("abc", Reader.SLAVE, "FSN111"),
        ("010", Reader.SLAVE, "FSN114"),
        ("010", Reader.ENDPOINT, "FSN114"),
        ("08", Reader.SLAVE, "FSN114"),
        ("0x10000", Reader.ENDPOINT, "FSN113"),
        ("-1", Reader.SLAVE, "FSN113"),
    ],
)
def test_traps_are_named(text: str, reader: Reader, code: str):
    assert read(text, reader)[1] == [code]


def test_upper_case_prefix_is_fine_in_slave_yaml():
    assert read("0X6000", Reader.SLAVE) == (0x6000, [])


@pytest.mark.parametrize(
    ("text", "what", "hint"),
    [
        ("one", "slot", "write a whole number, 0 … 65535"),
        ("one", "index", "write it as 0x6000"),
        ("100 ms", "watchdog_ms", "write 100"),
        ("1 s", "watchdog_ms", "write 1000"),
        ("5us", "watchdog_ms", "write a whole number of ms"),
        ("2 m", "watchdog_ms", "write the number alone"),
        ("6 bytes", "size", "write 6"),
        ("48 bits", "size", "write the number alone"),
        ("6h", "size", "write 0x6"),
        ("1,500", "size", "write 1500 if the comma separates thousands"),
        ("6,5", "size", "write a whole number, 0 … 65535"),
        ("0x607g", "index", "hexadecimal digits are 0 … 9 and a … f"),  # not 0x0607
        ("0x6000:01", "index", "write 0x6000"),
    ],
)
def test_the_hint_is_what_was_meant_or_what_is_allowed(text: str, what: str, hint: str):
    out = Collector()
    node = ScalarNode("f", 0, text, True)
    assert read_int(node, out, what=what, low=0, high=0xFFFF, reader=Reader.OWN) is None
    assert [d.hint for d in out.diagnostics] == [hint]


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("1ms", "write the number alone; the unit is in the name cycle_us"),
        ("fast", "write a number, such as 1000 or 1.5"),
        ("nan", "write .nan"),
        ("inf", "write .inf"),
        ("-inf", "write -.inf"),  # not the other end of the scale
        ("+.nan", "write .nan"),
        ("1,5", "write 1.5; a comma is not part of a number"),
        ("-0,25", "write -0.25; a comma is not part of a number"),
        ("1,000", "write 1.000 or 1000; a comma is not part of a number"),
    ],
)
def test_the_hint_of_a_floating_point_number_keeps_its_value(text: str, hint: str):
    out = Collector()
    assert read_float(ScalarNode("f", 0, text, True), out, what="cycle_us") is None
    assert [d.hint for d in out.diagnostics] == [hint]


def test_a_number_beyond_a_double_is_out_of_range():
    out = Collector()
    assert read_float(ScalarNode("f", 0, "1e400", True), out, what="factor") is None
    assert [d.code for d in out.diagnostics] == ["FSN113"]


def test_a_value_that_its_schema_has_named_is_not_named_again():
    out = Collector()
    node = ScalarNode("f", 0, "abc", True)
    out.mistyped.add(node.span)
    assert read_float(node, out, what="factor") is None
    assert read_int(node, out, what="slot", low=0, high=9, reader=Reader.OWN) is None
    assert out.diagnostics == []


def test_very_many_wrong_values_are_read_without_looking_at_each_finding():
    """A file of a hundred thousand of them would take an hour otherwise."""

    class Unread(list[Diagnostic]):
        def __iter__(self) -> Iterator[Diagnostic]:
            raise AssertionError("the findings before are looked at")

    out = Collector()
    out.diagnostics = Unread()
    for text in ("abc", "5.5", "1,5"):
        node = ScalarNode("f", 0, text, True)
        read_int(node, out, what="slot", low=0, high=9, reader=Reader.OWN)
    assert len(out.diagnostics) == 3
