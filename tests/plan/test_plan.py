"""The plan file: golden bytes, both directions, hostile bytes."""

from __future__ import annotations

import hashlib
import random
import struct
import zlib

import pytest
from networks import example, write_big_network

from fsoe_net.cli.inputs import check_files
from fsoe_net.core import Core, CorePlan, EmulatedBus
from fsoe_net.errors import CoreMissing, PlanFormatError
from fsoe_net.plan import Plan, compile_plan, decode_plan, igh_image, plan_json, plan_text

# Changes of these are changes of the file format or of the examples: both belong in the changelog.
GOLDEN = {
    "estop": "fb62ed25a060c763d10683b6fa2dc700af26fd0af9f1ea0d5dac6a4145c6d47e",
    "el6910": "87869923029bec72723ac60885589208d51a36073670383d48bf6bba42faad9f",
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
