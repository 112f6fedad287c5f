import struct

import pytest
from core.plan_builder import Builder, Transfer, estop, fix_crc, section
from core.rig import load, need_core

from fsoe_net.core.core import CorePlan
from fsoe_net.errors import PlanFormatError


def test_names_sizes_and_numbers() -> None:
    plan = load(estop().build())
    assert plan.subdevice_names == ("main", "sub")
    assert plan.connection_names == ("main-sub-0",)
    assert plan.outputs == {"main.out": 0, "sub.out": 2}
    assert plan.inputs == {"main.in": 1}
    assert plan.cycle_ns == 1_000_000
    assert plan.sm_sizes == [9, 8, 8, 8]
    assert [plan.sync_manager(s, i) for s in ("main", "sub") for i in (2, 3)] == [0, 1, 2, 3]


@pytest.mark.parametrize("place", [("main", 4), ("nobody", 2)])
def test_unknown_sync_manager_is_a_key_error(place: tuple[str, int]) -> None:
    plan = load(estop().build())
    with pytest.raises(KeyError):
        plan.sync_manager(*place)


def poke(raw: bytes, kind: int, offset: int, layout: str, value: int) -> bytes:
    changed = bytearray(raw)
    struct.pack_into(layout, changed, section(raw, kind) + offset, value)
    return fix_crc(bytes(changed))


@pytest.mark.shows("R2")
@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ((8, 32 + 4, "<I", 4), r"copy 1: a copy starts on a byte \(FSN_E_COPY_ALIGN\)"),
        ((8, 0, "<I", 2), r"copy 0: .*reads a registered input .*FSN_E_COPY_DIRECTION"),
        ((8, 4, "<I", 24), r"copy 0: .*ends after its sync manager"),
        ((8, 4, "<I", 8), r"copy 0: .*whole FSoE block"),
        ((2, 24 + 8, "<I", 72), r"sync manager 1: the entries do not add up"),
        ((6, 44, "<I", 0xFFFF), r"symbol 1: the name lies outside"),
        ((6, 28 + 4, "<I", 0x7FF00000), r"symbol 0: factor and offset are finite"),
        ((6, 28 + 4, "<I", 0x80000000), r"symbol 0: .*the factor is not 0"),
        ((7, 16 + 8, "<H", 8), r"FSoE block 1: an FSoE frame has"),
        ((9, 8, "<I", 1), r"connection 0: main and sub are the same"),
        ((1, 48 + 42, "<H", 2), r"SubDevice 1: a flag of the SubDevice is unknown"),
        ((1, 48 + 44, "<I", 0xFFFF), r"SubDevice 1: what the driver reads lies outside"),
        ((9, 36, "<I", 0xFFFF), r"connection 0: the application parameters are not pairs"),
        ((9, 36, "<I", 1), r"connection 0: the application parameters are not pairs"),
    ],
)
def test_refusal_names_record_and_rule(change: tuple[int, int, str, int], expected: str) -> None:
    need_core()
    with pytest.raises(PlanFormatError, match=expected):
        CorePlan.load(poke(estop().build(), *change))


@pytest.mark.shows("R2")
def test_refusals_of_the_whole_file() -> None:
    need_core()
    good = estop().build()
    for data, word in [
        (b"", "shorter"),
        (b"\0" * 400, "not a plan"),
        (good[:-1], "length"),
        (good + b"\0", "length"),
        (good[:-1] + b"\1", "CRC"),
        (good[:8] + b"\2" + good[9:], "version"),
    ]:
        with pytest.raises(PlanFormatError, match=word):
            CorePlan.load(data)


@pytest.mark.shows("R2")
def test_overlapping_destinations_name_the_second_copy() -> None:
    need_core()
    builder = Builder(
        sizes=[(8, 8), (8, 8)],
        standard=[Transfer(0, 0, 1, 0, 4), Transfer(0, 0, 1, 3, 4)],
    )
    with pytest.raises(PlanFormatError, match=r"copy 1: two copies write the same byte"):
        CorePlan.load(builder.build())


def test_two_symbols_of_one_name_are_refused() -> None:
    need_core()
    builder = estop()
    builder.symbols = [("x", 0, 48, 8), ("x", 0, 56, 8)]
    with pytest.raises(PlanFormatError, match="same name"):
        CorePlan.load(builder.build())


def test_plan_without_anything_is_a_plan() -> None:
    plan = load(Builder(sizes=[]).build())
    assert plan.subdevice_names == ()
