"""The plan file: golden bytes, both directions, hostile bytes."""

from __future__ import annotations

import hashlib
import random
import struct
import zlib
from dataclasses import replace

import pytest
from networks import example, write_big_network

from fsoe_net.cli.inputs import check_files
from fsoe_net.core import Core, CorePlan, EmulatedBus
from fsoe_net.diag import Span
from fsoe_net.errors import CoreMissing, PlanFormatError
from fsoe_net.model import Entry
from fsoe_net.plan import Plan, compile_plan, decode_plan, igh_image, plan_json, plan_text
from fsoe_net.plan.compile import stop_value

# Changes of these are changes of the file format or of the examples: both belong in the changelog.
GOLDEN = {
    "estop": "c5197d754ba7e93dc725c0afa882eccb4cb3dbc980834e6aa3eb3c86075ed244",
    "el6910": "94ad248413bcd8b7d0883357a657c4d0faa8c2dbbc0e3a082b865f72e9c2a654",
}


@pytest.mark.parametrize("name", GOLDEN)
def test_golden_bytes(name: str):
    data = compile_plan(example(name)).to_bytes()
    assert hashlib.sha256(data).hexdigest() == GOLDEN[name]
    assert compile_plan(example(name)).to_bytes() == data


@pytest.mark.parametrize("name", GOLDEN)
def test_decode_is_the_inverse(name: str):
    plan = compile_plan(example(name))
    assert decode_plan(plan.to_bytes()) == plan


@pytest.mark.parametrize(
    ("type_name", "bits", "default", "raw"),
    [
        ("bool", 1, 1.0, 1),
        ("bit4", 4, 16.0, 15),
        ("int8", 8, -1.0, 0xFF),
        ("int8", 8, -200.0, 0x80),
        ("uint16", 16, -3.0, 0),
        ("uint16", 16, 1e9, 0xFFFF),
        ("int64", 64, 1e30, (1 << 63) - 1),
        ("uint32", 32, 2.9, 2),
        ("float", 32, 1.0, 0x3F800000),
        ("float", 32, 1e300, 0x7F800000),
        ("double", 64, -2.0, 0xC000000000000000),
        ("int8", 8, float("nan"), 0),
        ("int8", 8, None, 0),
    ],
)
def test_the_stop_value_is_the_default_as_raw_bits(
    type_name: str, bits: int, default: float | None, raw: int
) -> None:
    entry = Entry(
        span=Span("x"), index=0x7000, subindex=1, bits=bits, type_name=type_name, default=default
    )
    assert stop_value(entry) == raw
    assert stop_value(replace(entry, restart_relevant=True)) == 0


def test_an_output_with_a_default_has_it_as_stop_value():
    symbols = {s.name: s for s in compile_plan(example("el6910")).symbols}
    assert symbols["drive_1.0x6060:00"].stop_value == 8
    assert {s.stop_value for s in symbols.values() if not s.output} == {0}


def test_header_is_as_documented():
    data = compile_plan(example("estop")).to_bytes()
    magic, major, minor, length, crc, cycle_ns, sections, reserved = struct.unpack_from(
        "<8sHHIIIII", data
    )
    assert (magic, major, minor, length) == (b"FSNPLAN\0", 1, 0, len(data))
    assert (cycle_ns, sections, reserved) == (1_000_000, 10, 0)
    assert crc == zlib.crc32(data[:16] + bytes(4) + data[20:])


def test_every_truncation_and_change_is_refused():
    data = compile_plan(example("estop")).to_bytes()
    for cut in range(len(data)):
        with pytest.raises(PlanFormatError):
            decode_plan(data[:cut])
    for at in range(0, len(data), 7):
        changed = bytearray(data)
        changed[at] ^= 0x55
        with pytest.raises(PlanFormatError):
            decode_plan(bytes(changed))


def test_random_plans_never_crash_and_python_accepts_what_the_core_accepts():
    good = compile_plan(example("el6910")).to_bytes()
    rng = random.Random(7)
    accepted = 0
    for _ in range(3000):
        data = bytearray(good)
        for _ in range(rng.randrange(1, 4)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        struct.pack_into("<I", data, 16, zlib.crc32(bytes(data[:16]) + bytes(4) + bytes(data[20:])))
        try:
            core_plan = CorePlan.load(bytes(data))
        except CoreMissing as exc:
            pytest.skip(str(exc))
        except PlanFormatError:
            continue
        accepted += 1
        Core(core_plan, EmulatedBus(core_plan)).cycle(1)
        plan = decode_plan(bytes(data))
        assert plan_text(plan)
        assert plan_json(plan)
    assert accepted > 100  # names and addresses may be anything


def _size(plan: Plan) -> int:
    return igh_image(plan).size_bytes


def test_image_follows_the_order_of_the_driver():
    domain = igh_image(compile_plan(example("estop")))
    assert [(f.offset_bytes, f.size_bytes) for f in domain.fmmus] == [
        (0, 8),
        (8, 8),
        (16, 9),
        (25, 8),
    ]
    assert (domain.size_bytes, domain.working_counter) == (33, 6)


def test_large_networks(tmp_path):
    path = write_big_network(tmp_path, 500, 424)
    checked = check_files([str(path)])
    assert [d for d in checked.diagnostics if d.level.value == "error"] == []
    assert checked.resolution is not None
    plan = compile_plan(checked.resolution)
    assert (len(plan.subdevices), len(plan.copies)) == (500, 424)
    assert decode_plan(plan.to_bytes()) == plan
    try:
        CorePlan.load(plan.to_bytes())
    except CoreMissing as exc:
        pytest.skip(str(exc))
