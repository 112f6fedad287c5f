"""Names, times and types that many parts share: each place, each unit, each word."""

from __future__ import annotations

from dataclasses import replace

import pytest
from described import bus, entry
from networks import example

from fsoe_net.fsoe.pdu import SAFE_SIZES, frame_length, safe_data_of
from fsoe_net.model.bus import Device, Direction, Pdo, SyncManager
from fsoe_net.model.description import ClockFacts, StartFacts, TypeFacts
from fsoe_net.model.layout import SmLayout
from fsoe_net.model.scenario import Action
from fsoe_net.model.signals import connection_signals, signals_of, split_name, write_bits
from fsoe_net.model.times import TIME_UNITS_NS, time_ns, time_text
from fsoe_net.model.type_words import DRIVER_WORD, TYPE_BITS


def _layout(*entries) -> SmLayout:
    pdos = (Pdo(index=0x1A00, entries=entries),)
    sm = SyncManager(index=3, direction=Direction.INPUT, pdos=pdos)
    device = Device(path="", vendor_id=2, product_code=1, sync_managers=(sm,))
    (made,) = device.layout.managers
    return made


@pytest.mark.parametrize("safe_bytes", [1, 2, 4, 6, 14, max(SAFE_SIZES)])
@pytest.mark.parametrize("offset", [0, 3])
def test_each_bit_of_a_frame_has_the_place_of_its_safe_data(safe_bytes: int, offset: int):
    size = frame_length(safe_bytes)
    bits = [entry(0x6000 + n, 1, 1) for n in range(8 * (offset + size + 2))]
    found = signals_of("io", _layout(*bits), offset, size)
    expected = {}
    for n in range(8 * size):
        data = safe_data_of((1 << n).to_bytes(size, "little"))
        if any(data):
            index = 0x6000 + 8 * offset + n
            expected[f"io.0x{index:04x}:01"] = int.from_bytes(data, "little").bit_length() - 1
    assert {name: signal.bit for name, signal in found.items()} == expected
    assert len(expected) == 8 * safe_bytes


def test_entries_that_are_not_signal_are_left_out():
    frame = _layout(
        entry(0x6000, 1, 8, "command"),
        entry(0x6001, 1, 3, "three"),
        entry(0, 0, 2),
        entry(0x6001, 2, 0, "empty"),
        entry(0x6640, 0, 3),
        entry(0x6001, 1, 8, "again"),
        entry(0x6000, 2, 16, "CRC 0"),
        entry(0x6001, 3, 17, "into the CRC"),
    )
    found = signals_of("io", frame, 0, 11)
    assert [(s.name, s.bit, s.bits, s.label, s.address) for s in found.values()] == [
        ("io.0x6001:01", 0, 3, "three", "0x6001:01"),
        ("io.0x6640:00", 5, 3, "STO", "0x6640:00"),
    ]


@pytest.mark.parametrize(
    ("index", "label"),
    [
        (0x6630, "restart acknowledge"),
        (0x6632, "error acknowledge"),
        (0x6640, "STO"),
        (0x6650, "SS1"),
        (0x6660, "SBC"),
        (0x6668, "SOS"),
        (0x6670, "SS2"),
        (0x6690, "SLS"),
        (0x66D0, "SDI positive"),
        (0x66D1, "SDI negative"),
        (0x6671, ""),
    ],
)
def test_a_bit_without_a_name_has_that_of_the_drive_profile(index: int, label: str):
    ends = entry(0x6600, 3, 16), entry(0x6600, 2, 16)
    frame = _layout(entry(0x6600, 1, 8), entry(index, 0, 1), entry(index, 1, 7, "own"), *ends)
    assert [s.label for s in signals_of("drive", frame, 0, 6).values()] == [label, "own"]


def test_signals_of_an_example():
    (connection,) = example("estop").connections
    rows = sorted(
        (s.name, s.index, s.subindex, s.bit, s.bits, s.label)
        for signals in connection_signals(connection)
        for s in signals.values()
    )
    assert rows == [
        ("ek1914.0x6001:01", 0x6001, 1, 0, 1, "e-stop channel A"),
        ("ek1914.0x6001:02", 0x6001, 2, 1, 1, "e-stop channel B"),
        ("ek1914.0x7001:01", 0x7001, 1, 0, 1, "safe output 1"),
        ("ek1914.0x7001:02", 0x7001, 2, 1, 1, "safe output 2"),
    ]


@pytest.mark.parametrize(
    ("bit", "bits", "value", "result"),
    [
        (0, 1, 1, "fe ff ff -> ff ff ff"),
        (7, 2, 1, "7f fe ff -> ff fe ff"),
        (9, 5, 0x3F, "ff c1 ff -> ff ff ff"),
        (16, 8, 0x1A5, "ff ff 00 -> ff ff a5"),
    ],
)
def test_bits_are_put_low_bit_first(bit: int, bits: int, value: int, result: str):
    data = bytearray(b"\xff\xff\xff")
    write_bits(data, bit, bits, 0)
    before = data.hex(" ")
    write_bits(data, bit, bits, value)
    assert f"{before} -> {data.hex(' ')}" == result


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("ek1914.0x6001:01", ("ek1914", 0x6001, 1)),
        ("a.b.7fff:0xff", ("a.b", 0x7FFF, 255)),
        ("io.0x6f:a", ("io", 0x6F, 10)),
        (".0x6001:01", None),
        ("io.0x16001:01", None),
        ("io.0x6001:", None),
        ("io.0x6001:100", None),
        ("io.6001", None),
    ],
)
def test_names_are_taken_apart(text: str, parts: tuple[str, int, int] | None):
    assert split_name(text) == parts


UNITS = {"ns": 1, "us": 10**3, "ms": 10**6, "s": 10**9, "min": 60 * 10**9, "h": 3600 * 10**9}


@pytest.mark.parametrize("unit", UNITS)
def test_times_are_read_and_written(unit: str):
    assert TIME_UNITS_NS == UNITS
    assert time_ns(f"7{unit}") == time_ns(f"7 {unit}") == 7 * UNITS[unit]
    assert time_ns(f"1.5{unit}") == round(1.5 * UNITS[unit])
    assert time_text(7 * UNITS[unit]) == f"7{unit}"
    assert time_ns(f"7  {unit}") is None


def test_times_without_a_unit_and_others():
    assert time_text(0) == "0s"
    assert time_text(61 * 10**9) == "61s"
    assert time_ns("30") is None
    assert time_ns("30", bare_ns=10**9) == 30 * 10**9
    for text in ("", "ms", "-1s", "1.s", "1e3s", "1234567890123s", "1d", "x1s"):
        assert time_ns(text, bare_ns=1) is None


@pytest.mark.parametrize(
    ("sync", "period_ns"),
    [
        (ClockFacts(), 1_000_000),
        (ClockFacts(cycle_ns=7, factor=3), 7),
        (ClockFacts(factor=3), 3_000_000),
        (ClockFacts(factor=0), 1_000_000),
        (ClockFacts(factor=-1), 1_000_000),
        (ClockFacts(factor=-4), 250_000),
    ],
)
def test_period_of_sync0(sync: ClockFacts, period_ns: int):
    assert sync.period_ns(1000) == period_ns


# By size; what begins with u, and what IEC 61131-3 calls a string of bits, has no sign.
WORDS = {
    8: "sint usint byte integer8 unsigned8",
    16: "int uint word integer16 unsigned16",
    32: "dint udint dword integer32 unsigned32",
    64: "lint ulint",
}


def test_words_for_types():
    expected = {"boolean": "bool", "real": "float", "lreal": "double"}
    for bits, words in WORDS.items():
        for word in words.split():
            sign = "u" if word.startswith("u") or word in ("byte", "word", "dword") else ""
            expected[word] = f"{sign}int{bits}"
    assert expected == DRIVER_WORD
    sizes = {f"{sign}int{bits}": bits for sign in ("", "u") for bits in WORDS}
    reals = {"float": 32, "real32": 32, "double": 64, "real64": 64}
    assert sizes | reals | {"bool": 1} == TYPE_BITS


def test_steps_of_an_emulated_segment_only():
    assert {action.value for action in Action if not action.needs_segment} == {
        "set",
        "press",
        "release",
        "break",
        "heal",
        "power_cycle",
        "local_reset",
        "drive_fault",
        "output",
        "fsoe_address",
        "plug",
        "pull",
    }


def test_start_commands_of_a_file_do_not_change_the_subdevice():
    (one, *_) = bus(1).subdevices
    assert replace(one, start=StartFacts(revision=7)) == one
    assert replace(one, facts=TypeFacts()) == one
    assert replace(one, revision=7) != one
