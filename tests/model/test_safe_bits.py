"""Which FSoE frame carries a safe bit, and at which of its bytes."""

from __future__ import annotations

from pathlib import Path

import pytest
from networks import EXAMPLES, resolved

from fsoe_net.fsoe.pdu import SAFE_SIZES, Pdu
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.safe_bits import (
    ElementFrame,
    bit_names,
    bit_words,
    element_frames,
    frame_of,
    frame_place,
)
from fsoe_net.model.safety import ElementKind, SafeBit, SafetyElement, SafetyFunction

BASE = Path(__file__).parents[1] / "diagnostics" / "base"


@pytest.fixture(scope="module")
def timed() -> Resolution:
    return resolved(BASE / "timed.yaml")


@pytest.mark.parametrize("size", sorted(SAFE_SIZES))
def test_byte_and_bit_are_those_of_an_encoded_frame(size: int) -> None:
    crcs = (0,) * ((size + 1) // 2)
    for bit in range(8 * size):
        data = (1 << bit).to_bytes(size, "little")
        frame = Pdu(command=0, safe_data=data, crcs=crcs, connection_id=0).encode()
        (byte,) = (n for n, value in enumerate(frame) if value)
        assert frame_place(bit) == (byte, frame[byte].bit_length() - 1)


def function(*elements: tuple[ElementKind, str]) -> SafetyFunction:
    rows = tuple(SafetyElement(kind=kind, sub=sub, name=sub) for kind, sub in elements)
    return SafetyFunction(name="f", elements=rows)


def ways(f: SafetyFunction, timed: Resolution) -> list[tuple[str, str, int | None]]:
    """Return from where to where the frames of the first element go, and their slots."""
    frames = element_frames(f.elements[0], f, timed.connections)
    moved = ((frame.transfer.transfer, frame.slot) for frame in frames)
    return [(t.source.module, t.destination.module, slot) for t, slot in moved]


IN, LOGIC, OUT = ElementKind.INPUT, ElementKind.LOGIC, ElementKind.OUTPUT


@pytest.mark.parametrize(
    ("elements", "expected"),
    [
        ([(IN, "io"), (LOGIC, "logic")], [("io", "logic", 0)]),
        ([(OUT, "io"), (LOGIC, "logic")], [("logic", "io", 0)]),
        ([(IN, "io2")], [("io2", "logic", 0)]),  # no logic is named
        ([(IN, "logic"), (LOGIC, "io2")], [("logic", "io2", 1)]),  # the logic is a SubInstance
        ([(OUT, "logic"), (LOGIC, "io")], [("io", "logic", 0)]),
        ([(OUT, "logic")], [("io", "logic", 0), ("io2", "logic", 1)]),
        ([(IN, "logic"), (LOGIC, "logic")], []),  # it stays inside
        ([(IN, "io"), (LOGIC, "io2")], []),  # not connected
        ([(IN, ""), (LOGIC, "logic")], []),
        ([(ElementKind.SENSOR, "io"), (LOGIC, "logic")], []),
    ],
)
def test_frames_of_an_element(
    timed: Resolution,
    elements: list[tuple[ElementKind, str]],
    expected: list[tuple[str, str, int | None]],
) -> None:
    assert ways(function(*elements), timed) == expected


def frames_of(timed: Resolution, kind: ElementKind, sub: str) -> tuple[ElementFrame, ...]:
    f = function((kind, sub))
    return element_frames(f.elements[0], f, timed.connections)


def test_a_slot_selects_one_of_several_frames(timed: Resolution) -> None:
    frames = frames_of(timed, OUT, "logic")
    assert frame_of(SafeBit(bit=0, name="a", slot=1), frames) is frames[1]
    assert frame_of(SafeBit(bit=0, name="a", slot=2), frames) is None
    assert frame_of(SafeBit(bit=0, name="a"), frames) is None
    assert frame_of(SafeBit(bit=0, name="a"), frames[:1]) is frames[0]


def test_pdo_entry_of_a_bit(timed: Resolution) -> None:
    (frame,) = frames_of(timed, OUT, "io")
    entries = [frame.entry_of(bit) for bit in range(3)]
    # devices/ek1914.yaml: two bits of 0x7001, then padding
    assert [None if e is None else e.address for e in entries] == ["0x7001:01", "0x7001:02", None]
    assert frame.safe_bits == 8


def test_words_name_frame_and_slot() -> None:
    bits = (SafeBit(bit=0, name="K1"), SafeBit(bit=9, name="K2", slot=3))
    for kind, way in ((OUT, "to"), (IN, "from")):
        element = SafetyElement(kind=kind, sub="io", name="io", bits=bits)
        assert bit_words(element) == [
            f"K1 is bit 0 of the frame {way} io",
            f"K2 is bit 9 of the frame of slot 3 {way} io",
        ]


def test_a_bit_of_a_safety_function_names_the_entry_of_its_subdevice() -> None:
    cell = resolved(EXAMPLES / "robot-cell" / "network.yaml")
    assert bit_names(cell) == {
        "el1904.0x6001:01": "ES1 channel A",
        "el1904.0x6001:02": "ES1 channel B",
        "axis_1.0x6640:00": "STO",
        "axis_1.0x6650:01": "SS1",
        "axis_2.0x6640:00": "STO",
        "axis_2.0x6650:01": "SS1",
    }
