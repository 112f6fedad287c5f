"""The plan file: golden bytes, both directions, hostile bytes."""

from __future__ import annotations

import hashlib
import random
import struct
import tracemalloc
import zlib
from dataclasses import replace
from pathlib import Path

import pytest
from networks import PLAIN, example, write_big_network
from weekly import examples

from fsoe_net.core.core import Core, CorePlan, EmulatedBus
from fsoe_net.errors import CoreMissing, PlanFormatError
from fsoe_net.formats.own.network import load_network
from fsoe_net.model.bus import EntryView
from fsoe_net.model.resolve import resolve
from fsoe_net.plan.codec import decode_plan, encode_plan
from fsoe_net.plan.compile import compile_plan, stop_value
from fsoe_net.plan.image import igh_image
from fsoe_net.plan.model import NONE, Plan, PlanBus, PlanGroup, PlanSdo
from fsoe_net.plan.show import plan_json, plan_text
from fsoe_net.project.check import check_files

# Changes of these are changes of the file format or of the examples: both belong in the changelog.
GOLDEN = {
    "estop": "5746e47d95c1cb84844d2928e84bcd43a7499d4f9f89371b5159d3db84f1aa6d",
    "el6910": "9ac7a4b368d9968a7cb552d8ed9dae04a7cd99a529d7e4a65e7b5855290df3e3",
}


@pytest.mark.parametrize("name", GOLDEN)
def test_plan_has_the_known_bytes(name: str):
    data = compile_plan(example(name)).to_bytes()
    assert hashlib.sha256(data).hexdigest() == GOLDEN[name]
    assert compile_plan(example(name)).to_bytes() == data


@pytest.mark.parametrize("name", GOLDEN)
def test_decode_is_the_inverse(name: str):
    plan = compile_plan(example(name))
    assert decode_plan(plan.to_bytes()) == plan


@pytest.mark.parametrize(
    ("value", "back"),
    [(-1, -1), (-(1 << 63), -(1 << 63)), ((1 << 63) - 1, (1 << 63) - 1), ((1 << 64) - 1, -1)],
)
def test_the_value_of_an_sdo_has_64_bits_with_or_without_a_sign(value: int, back: int):
    plan = compile_plan(example("estop"))
    first, *others = plan.subdevices
    last = others[-1]._replace(first_sdo=0, sdo_count=1)
    sdo = PlanSdo(index=0x8000, subindex=1, size_bytes=8, value=value)
    plan = replace(plan, subdevices=(first, *others[:-1], last), sdos=(sdo,))
    data = plan.to_bytes()
    assert (back & 0xFFFFFFFFFFFFFFFF).to_bytes(8, "little") in data
    assert decode_plan(data) == replace(plan, sdos=(replace(sdo, value=back),))
    CorePlan.load(data)


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
    view = EntryView(bit=0, bits=bits, type_name=type_name, default=default)
    assert stop_value(view) == raw


def test_restart_relevant_outputs_stop_at_zero(tmp_path):
    plain, marked = (
        symbols_of(tmp_path, f"type: uint8, default: 3, restart_relevant: {word}")
        for word in ("false", "true")
    )
    assert [s.stop_value for s in plain] == [3]
    assert [s.stop_value for s in marked] == [0]


def symbols_of(folder: Path, channel: str, *, group: str = "rpdo"):
    """The symbols of a SubDevice with one channel at 0x7000:01."""
    index = {"rpdo": "0x1600", "tpdo": "0x1a00"}[group]
    (folder / "device.yaml").write_text(
        f"vendor_id: 2\nproduct_id: 3\n{group}:\n  - index: {index}\n    channels:\n"
        f"      - {{index: 0x7000, sub_index: 1, {channel}}}\n",
        "utf-8",
    )
    network = folder / "network.yaml"
    network.write_text(
        "version: 1\nname: io\nsubdevices:\n  - {name: io, position: 0, config: device.yaml}\n",
        "utf-8",
    )
    return compile_plan(resolve(load_network([network]).network)).symbols


@pytest.mark.parametrize(
    ("group", "channel", "expected"),
    [
        ("tpdo", "type: int16, factor: 0.1, offset: -2", [("io.0x7000:01", 0, 16, 0.1, -2.0)]),
        # An item of data_mapping: the mask of the driver does not move a value down.
        (
            "tpdo",
            "type: uint16, data_mapping: ["
            "{addr_offset: 1, type: uint8, mask: 0x30, factor: 3, offset: 1, state_interface: a},"
            "{type: bool, mask: 4, state_interface: b}]",
            [("io.a", 12, 2, 48.0, 1.0), ("io.b", 2, 1, 1.0, 0.0)],
        ),
        (
            "rpdo",
            "type: uint16, data_mapping: ["
            "{addr_offset: 1, type: uint8, mask: 0x30, factor: 32, offset: 16, "
            "command_interface: a}]",
            [("io.a", 12, 2, 2.0, 1.0)],
        ),
        # Bits with a gap, and bits behind the entry, are no value; the channel is there as a whole.
        (
            "rpdo",
            "type: uint8, data_mapping: [{type: uint8, mask: 5, command_interface: a}]",
            [("io.0x7000:01", 0, 8, 1.0, 0.0)],
        ),
        (
            "rpdo",
            "type: uint8, data_mapping: [{addr_offset: 1, type: uint8, command_interface: a}]",
            [("io.0x7000:01", 0, 8, 1.0, 0.0)],
        ),
        ("tpdo", "type: int16, factor: 0", [("io.0x7000:01", 0, 16, 1.0, 0.0)]),
        ("tpdo", "type: int16, factor: .inf", [("io.0x7000:01", 0, 16, 1.0, 0.0)]),
    ],
)
def test_symbols_are_scaled_as_the_driver_does(tmp_path, group, channel, expected):
    found = symbols_of(tmp_path, channel, group=group)
    assert [(s.name, s.bit_offset, s.bits, s.factor, s.offset) for s in found] == expected


def test_an_output_with_a_default_has_it_as_stop_value():
    symbols = compile_plan(example("el6910")).symbols
    (mode,) = [s for s in symbols if s.name == "drive_1.0x6060:00"]
    assert mode.stop_value == 8
    assert {s.stop_value for s in symbols if not s.output} == {0}


def test_command_and_state_of_one_interface_name_keep_it():
    """The places are those of devices/circulo.yaml: 0x607a and 0x6064 follow 16 bits."""
    plan = compile_plan(example("el6910"))
    found = [s for s in plan.symbols if s.name == "drive_1.position"]
    places = {(s.output, plan.sync_managers[s.sm].index, s.bit_offset, s.bits) for s in found}
    assert places == {(True, 2, 16, 32), (False, 3, 16, 32)}


def test_names_of_one_direction_are_unique(tmp_path):
    """SubDevice `a` with `b.c`, and SubDevice `a.b` with `c`."""
    (tmp_path / "one.yaml").write_text(
        "vendor_id: 1\nproduct_id: 2\ntpdo:\n  - index: 0x1a00\n    channels:\n"
        "      - {index: 0x6000, sub_index: 1, type: uint8, state_interface: b.c}\n"
        "      - {index: 0x6000, sub_index: 2, type: uint8, state_interface: b.c}\n"
    )
    other = (tmp_path / "one.yaml").read_text().replace("state_interface: b.c", "name: c")
    (tmp_path / "two.yaml").write_text(other)
    network = tmp_path / "network.yaml"
    network.write_text(
        "version: 1\nname: n\ncycle_us: 1000\nsubdevices:\n"
        "  - {name: a, position: 0, config: one.yaml}\n"
        "  - {name: a.b, position: 1, config: two.yaml}\nnets: []\n"
    )
    symbols = compile_plan(resolve(load_network([network]).network)).symbols
    names = ["a.b.c", "a.0x6000:02", "a.b.c-2", "a.b.0x6000:02"]
    assert [s.name for s in symbols] == names


def test_header_is_as_documented():
    data = compile_plan(example("estop")).to_bytes()
    magic, major, minor, length, crc, cycle_ns, sections, reserved = struct.unpack_from(
        "<8sHHIIIII", data
    )
    assert (magic, major, minor, length) == (b"FSNPLAN\0", 1, 0, len(data))
    assert (cycle_ns, sections, reserved) == (1_000_000, 10, 0)
    assert crc == zlib.crc32(data[:16] + bytes(4) + data[20:])


@pytest.mark.shows("R2")
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


def test_tables_that_contradict_the_format_are_refused():
    plan = compile_plan(example("estop"))
    bus = PlanBus(name="a", cycle_ns=1_000_000, first_subdevice=0, subdevice_count=2)
    group = PlanGroup(name="g", place="", first_subdevice=1, subdevice_count=1)
    for change, words in [
        ({"buses": (bus,)}, "a plan with buses has two of them at least"),
        ({"buses": (bus, bus), "groups": (group,)}, "a plan with groups has one bus"),
    ]:
        with pytest.raises(PlanFormatError, match=words):
            decode_plan(encode_plan(replace(plan, **change)))


def test_a_large_plan_is_not_in_memory_twice():
    plan = compile_plan(example("estop"))
    plan = replace(plan, sync_managers=plan.sync_managers * 50_000)
    tracemalloc.start()
    try:
        data = encode_plan(plan)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(data) > 1_000_000
    assert most < 1.5 * len(data)


def test_a_name_outside_the_strings_is_refused():
    data = bytearray(compile_plan(example("estop")).to_bytes())
    _, name_at = struct.unpack_from("<II", data, 32)  # what a SubDevice begins with
    (strings_bytes,) = struct.unpack_from("<I", data, 32 + 9 * 16 + 8)
    struct.pack_into("<I", data, name_at, strings_bytes)
    struct.pack_into("<I", data, 16, zlib.crc32(bytes(data[:16]) + bytes(4) + bytes(data[20:])))
    with pytest.raises(PlanFormatError, match=f"string {strings_bytes} lies outside the strings"):
        decode_plan(bytes(data))


@pytest.mark.shows("R2")
@pytest.mark.uncounted
def test_random_plans_never_crash_and_python_accepts_what_the_core_accepts():
    good = compile_plan(example("el6910")).to_bytes()
    rng = random.Random(7)
    accepted = 0
    for _ in range(examples(3000)):
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
    assert accepted > examples(300)  # names and addresses may be anything


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


def test_large_network_is_compiled_and_loaded(tmp_path):
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


def test_a_stated_revision_is_the_only_one_accepted(tmp_path):
    devices = PLAIN / "estop" / "devices"
    text = (PLAIN / "estop" / "network.yaml").read_text("utf-8")
    text = text.replace("devices/", f"{devices}/").replace(
        "{name: ek1914,", "{name: ek1914, revision: 7,"
    )
    (tmp_path / "network.yaml").write_text(text, "utf-8")
    checked = check_files([str(tmp_path / "network.yaml")])
    plan = compile_plan(checked.resolution)
    revisions = [(s.revision_low, s.revision_high) for s in plan.subdevices]
    assert revisions == [(7, 7), (0, 0xFFFFFFFF)]


@pytest.mark.parametrize("digits", ["0", "0g", "0A", "00 00", "00" * 4097])
def test_application_parameters_are_pairs_of_hex_digits(digits):
    plan = compile_plan(example("estop"))
    row = plan.connections[0]._replace(app_parameters=digits)
    data = replace(plan, connections=(row,)).to_bytes()
    with pytest.raises(PlanFormatError, match="application parameters that are not pairs of hex"):
        decode_plan(data)
    try:
        with pytest.raises(PlanFormatError, match="application parameters are not pairs of hex"):
            CorePlan.load(data)
    except CoreMissing as exc:
        pytest.skip(str(exc))


def test_a_copy_of_standard_data_is_shown_without_a_connection():
    plan = compile_plan(example("el6910"))
    copy = plan.copies[0]._replace(connection=NONE, kind=2)
    assert "standard data" in plan_text(replace(plan, copies=(copy, *plan.copies[1:])))
