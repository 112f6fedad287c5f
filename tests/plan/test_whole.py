"""Plans as a whole: every text and record of a network with everything in it, every refusal."""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import pytest
from changed import compare, figures
from core.plan_builder import estop, fix_crc, section
from networks import EXAMPLES, PLAIN, example, resolved

from fsoe_net.diag.diagnostic import FindingList
from fsoe_net.errors import InputError, PlanFormatError
from fsoe_net.formats.own.network import load_network
from fsoe_net.model.acceptance import Acceptance, SignedBy
from fsoe_net.model.network import SourceFile
from fsoe_net.model.resolve import resolve
from fsoe_net.model.safety import ElementKind, SafetyElement, SafetyFunction
from fsoe_net.plan.accepted import accepted_plan
from fsoe_net.plan.codec import decode_plan, encode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import (
    SECTIONS,
    canonical_section,
    cycle_sha256,
    fingerprint_from_json,
    fingerprint_of,
    safety_sha256,
)
from fsoe_net.plan.image import MAX_DATAGRAM_BYTES, igh_image, igh_text
from fsoe_net.plan.model import Plan
from fsoe_net.plan.show import copy_end, plan_json, plan_text

# -- what is said of a plan -----------------------------------------------------------------------

# The coupler gets an alias, a revision, start-up values and a clock; its connection loses facts.
RICH = [
    (
        "network.yaml",
        "{name: ek1914, position: 0,",
        "{name: ek1914, alias: 7, position: 0, revision: 0x120000,",
    ),
    ("network.yaml", "cycle_us: 1000", "cycle_us: 1500"),
    ("network.yaml", "address: 14, connection_id: 1, watchdog_ms: 100", "connection_id: 1"),
    (
        "devices/ek1914.yaml",
        "rpdo:",
        "assign_activate: 0x10301\nsdo:\n"
        "  - {index: 0x8000, sub_index: 2, type: int16, value: -2}\n"
        "  - {index: 0x8001, sub_index: 0, type: uint8, value: 255}\nrpdo:",
    ),
]


@pytest.fixture
def rich(tmp_path: Path) -> Plan:
    for path in (PLAIN / "estop").rglob("*.yaml"):
        copy = tmp_path / path.relative_to(PLAIN / "estop")
        copy.parent.mkdir(exist_ok=True)
        text = path.read_text("utf-8")
        for file, old, new in RICH:
            if str(path).endswith(file):
                assert old in text, (file, old)
                text = text.replace(old, new, 1)
        copy.write_text(text, "utf-8")
    return compile_plan(resolved(tmp_path / "network.yaml"))


def compare_plan(name: str, plan: Plan) -> None:
    """Compare the figures of a plan's texts, and its records; of a large one the copies alone."""
    lines = [*map(figures, plan_text(plan).splitlines()), *igh_text(plan).splitlines()]
    document = plan_json(plan)
    rows = [
        (k, v) for k, many in document.items() for v in (many if type(many) is list else [many])
    ]
    large = len(plan.symbols) > 50
    lines += [f"{key} {json.dumps(row)}" for key, row in rows if key == "copies" or not large]
    if not large:
        for part in SECTIONS:
            lines += canonical_section(plan, part).splitlines()
    compare(__file__, name, ((str(n), line) for n, line in enumerate(lines)))


@pytest.mark.parametrize("name", ["estop", "el6910"])
def test_texts_and_records_of_an_example(name: str) -> None:
    compare_plan(name, compile_plan(example(name)))


def test_texts_and_records_of_a_plan_with_everything_in_it(rich: Plan) -> None:
    compare_plan("rich", rich)
    assert decode_plan(encode_plan(rich)) == rich
    assert {s.registered for s in rich.entries} == {True, False}
    assert rich.sdos[0].value == -2
    bare = replace(rich, connections=(), copies=(), cycle_ns=0)
    compare_plan("bare", bare)
    assert cycle_sha256(0) == fingerprint_of(bare).sections["cycle"]
    assert cycle_sha256(1_500_000) == fingerprint_of(rich).sections["cycle"]


def test_a_datagram_is_cut_where_the_next_sync_manager_no_longer_fits() -> None:
    plan = compile_plan(example("estop"))

    def sizes(*given: int) -> list[tuple[int, int, int]]:
        managers = list(plan.sync_managers)
        for place, n in zip(igh_image(plan).fmmus, given, strict=True):
            managers[place.sm] = managers[place.sm]._replace(bits=8 * n)
        image = igh_image(replace(plan, sync_managers=tuple(managers)))
        assert image.size_bytes == sum(given)
        assert image.working_counter == sum(d.working_counter for d in image.datagrams)
        return [(d.offset_bytes, d.size_bytes, d.working_counter) for d in image.datagrams]

    whole = MAX_DATAGRAM_BYTES
    assert whole == 1486
    assert sizes(8, 8, 9, 8) == [(0, 33, 6)]
    assert sizes(8, whole - 8, 9, 8) == [(0, whole, 3), (whole, 17, 3)]
    assert sizes(8, whole - 7, 9, 8) == [(0, 8, 1), (8, whole - 7, 1), (whole + 1, 17, 3)]
    # One that is longer by itself gets a datagram of its own, the first too.
    assert sizes(whole + 1, 8, 9, 8) == [(0, whole + 1, 1), (whole + 1, 25, 4)]
    nothing = replace(
        plan, sync_managers=tuple(s._replace(registered=False) for s in plan.sync_managers)
    )
    assert [(d.offset_bytes, d.size_bytes, d.working_counter) for d in igh_image(nothing).datagrams]
    assert igh_text(nothing) == ("Domain0: LogBaseAddr 0x00000000, Size   0, WorkingCounter 0/0")


def test_places_without_an_entry_and_sizes_in_bytes() -> None:
    plan = compile_plan(example("estop"))
    number = plan.copies[0].destination_sm
    name = plan.subdevices[plan.sync_managers[number].subdevice].name
    index = plan.sync_managers[number].index
    assert copy_end(plan, number, 0).startswith(f"{name} SM{index} byte 0 (0x")
    assert copy_end(plan, number, 1) == f"{name} SM{index} byte 0"
    assert copy_end(plan, number, 8 * 63) == f"{name} SM{index} byte 63"
    sizes = [plan.sync_managers[0]._replace(bits=n).size_bytes for n in (0, 1, 7, 8, 9, 16)]
    assert sizes == [0, 1, 1, 1, 2, 2]


def test_names_of_symbols_are_one_of_a_kind(tmp_path: Path) -> None:
    channels = "".join(
        f"      - {{index: 0x7000, sub_index: 1, type: uint8{more}}}\n"
        for more in ("", ", command_interface: a", ", command_interface: a", "", "")
    )
    (tmp_path / "device.yaml").write_text(
        f"vendor_id: 2\nproduct_id: 3\nrpdo:\n  - index: 0x1600\n    channels:\n{channels}", "utf-8"
    )
    (tmp_path / "network.yaml").write_text(
        "version: 1\nname: io\nsubdevices:\n  - {name: io, position: 0, config: device.yaml}\n",
        "utf-8",
    )
    network = load_network([tmp_path / "network.yaml"]).network
    assert network is not None
    symbols = compile_plan(resolve(network)).symbols
    assert [s.name for s in symbols] == [
        "io.0x7000:01",
        "io.a",
        "io.0x7000:01-2",
        "io.0x7000:01-3",
        "io.0x7000:01-4",
    ]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        (
            "02_wrong_index",
            ":14:9: ek1914 0x6001:03 -> el1918 0x7080:01 does not resolve to bytes; "
            "`fsoe-net check` shows the reason",
        ),
        (
            "05_one_way",
            ":14:9: this transfer has no partner; `fsoe-net check` explains it",
        ),
    ],
)
def test_a_network_with_errors_is_not_compiled(name: str, words: str) -> None:
    path = EXAMPLES / "broken" / f"{name}.yaml"
    network = load_network([path]).network
    assert network is not None
    with pytest.raises(InputError) as refused:
        compile_plan(resolve(network))
    assert str(refused.value).removeprefix(str(path)) == words


# -- refusals of a plan file ----------------------------------------------------------------------


def put(raw: bytes, at: int, layout: str, value: int) -> bytes:
    changed = bytearray(raw)
    struct.pack_into(layout, changed, at, value)
    return fix_crc(bytes(changed))


def refusal(raw: bytes) -> str:
    with pytest.raises(PlanFormatError) as refused:
        decode_plan(raw)
    return str(refused.value)


def longer(raw: bytes, more: bytes) -> bytes:
    return put(raw + more, 12, "<I", len(raw) + len(more))


GOOD = estop().build()
SAFE = encode_plan(replace(decode_plan(GOOD), safety_sha256="5a" * 32))
TABLE = 32
WRONG = [
    (b"", "0 bytes are too short for a plan; is the file cut off?"),
    (GOOD[:191], "191 bytes are too short for a plan; is the file cut off?"),
    (GOOD[:192], f"the plan states {len(GOOD)} bytes, the file has 192"),
    (GOOD + b"\0", f"the plan states {len(GOOD)} bytes, the file has {len(GOOD) + 1}"),
    (b"F" * 192, "not a .fsnplan file; `fsoe-net plan NETWORK -o OUT` makes one"),
    (put(GOOD, 8, "<H", 2), "plan format 2 is not known here (1 is); compile it again"),
    (GOOD[:-2] + b"x\0", "CRC-32 does not fit: the file was changed; compile it again"),
    (put(GOOD, 10, "<H", 1), "section table is damaged, or of a newer format than 1.3"),
    (put(GOOD, 24, "<I", 11), "section table is damaged, or of a newer format than 1.3"),
    (put(GOOD, 28, "<I", 1), "section table is damaged, or of a newer format than 1.3"),
    (put(GOOD, TABLE, "<I", 2), "section 1 is not where it must be"),
    (put(GOOD, TABLE + 16 + 4, "<I", 1), "section 2 is not where it must be"),
    (put(GOOD, TABLE + 9 * 16 + 8, "<I", 1 << 20), "section 10 is not where it must be"),
    (put(GOOD, TABLE + 2 * 16 + 12, "<I", 15), "section 3 is not where it must be"),
    (longer(GOOD, b"\0"), "the last section does not end the file"),
    (put(GOOD, section(GOOD, 10), "B", 65), "the strings do not start and end with a zero byte"),
    (put(GOOD, len(GOOD) - 1, "B", 65), "the strings do not start and end with a zero byte"),
    (put(GOOD, section(GOOD, 10) + 1, "B", 0x1F), "a name has a control character"),
    (put(GOOD, section(GOOD, 10) + 1, "B", 0x01), "a name has a control character"),
    (put(GOOD, section(GOOD, 10) + 1, "B", 0x7F), "a name has a control character"),
    (
        longer(put(SAFE, TABLE + 10 * 16 + 8, "<I", 2), bytes(32)),
        "a plan has one hash of safety functions",
    ),
    (put(put(SAFE[:207], 12, "<I", 207), 24, "<I", 11), "the section table is cut off"),
]


@pytest.mark.shows("R2", "R4")
@pytest.mark.parametrize(("raw", "words"), WRONG, ids=[str(n) for n in range(len(WRONG))])
def test_each_rejected_plan_file_has_a_reason(raw: bytes, words: str) -> None:
    assert refusal(raw) == words


def test_values_at_the_limit_are_read() -> None:
    plan = decode_plan(GOOD)
    assert encode_plan(plan) == put(encode_plan(plan), 8, "<H", 1)
    assert decode_plan(put(GOOD, section(GOOD, 10) + 1, "B", 0x20)) != plan
    empty = Plan(
        cycle_ns=0,
        subdevices=(),
        sync_managers=(),
        pdos=(),
        entries=(),
        sdos=(),
        symbols=(),
        blocks=(),
        copies=(),
        connections=(),
    )
    assert decode_plan(encode_plan(empty)) == empty


SMS, SUBS, PDOS, ENTRIES, COPIES, NONE = 4, 2, 4, 33, 2, 0xFFFFFFFF
# Section, offset in it, layout, the first number that is wrong, what is said.
REFERENCES = [
    (1, 24, "<I", SMS - 1, f"SubDevice 0: sync manager {SMS + 1} does not exist"),
    (1, 48 + 28, "<I", 3, f"SubDevice 1: sync manager {SMS + 1} does not exist"),
    (1, 32, "<I", 1, "SubDevice 0: SDO 1 does not exist"),
    (1, 48 + 36, "<I", 1, "SubDevice 1: SDO 1 does not exist"),
    (2, 0, "<I", SUBS, f"sync manager 0: SubDevice {SUBS} does not exist"),
    (2, 12, "<I", PDOS, f"sync manager 0: PDO {PDOS + 1} does not exist"),
    (2, 24 + 16, "<I", PDOS, f"sync manager 1: PDO {PDOS + 1} does not exist"),
    (3, 4, "<I", ENTRIES - 8, f"PDO 0: entry {ENTRIES + 1} does not exist"),
    (3, 16 + 8, "<I", ENTRIES - 8, f"PDO 1: entry {ENTRIES + 1} does not exist"),
    (6, 4, "<I", SMS, f"symbol 0: sync manager {SMS} does not exist"),
    (6, 44 + 4, "<I", SMS, f"symbol 1: sync manager {SMS} does not exist"),
    (7, 0, "<I", SMS, f"block 0: sync manager {SMS} does not exist"),
    (8, 0, "<I", SMS, f"copy 0: sync manager {SMS} does not exist"),
    (8, 32 + 8, "<I", SMS, f"copy 1: sync manager {SMS} does not exist"),
    (8, 28, "<I", 1, "copy 0: connection 1 does not exist"),
    (9, 8, "<I", SUBS, f"connection 0: SubDevice {SUBS} does not exist"),
    (9, 12, "<I", SUBS, f"connection 0: SubDevice {SUBS} does not exist"),
    (9, 16, "<I", COPIES, f"connection 0: copy {COPIES} does not exist"),
    (9, 20, "<I", COPIES, f"connection 0: copy {COPIES} does not exist"),
    (9, 20, "<I", NONE, f"connection 0: copy {NONE} does not exist"),
]


@pytest.mark.parametrize(("number", "offset", "layout", "value", "words"), REFERENCES)
def test_a_number_out_of_range_is_named(
    number: int, offset: int, layout: str, value: int, words: str
) -> None:
    at = section(GOOD, number) + offset
    assert refusal(put(GOOD, at, layout, value)) == words
    if value != NONE:
        decode_plan(put(GOOD, at, layout, value - 1))


def test_a_copy_without_a_connection_and_a_name_outside() -> None:
    at = section(GOOD, 8) + 28
    assert decode_plan(put(GOOD, at, "<I", NONE)).copies[0].connection == NONE
    strings = len(GOOD) - section(GOOD, 10)
    at = section(GOOD, 1)
    assert refusal(put(GOOD, at, "<I", strings)) == f"string {strings} lies outside the strings"
    assert decode_plan(put(GOOD, at, "<I", strings - 1)).subdevices[0].name == ""


# -- fingerprints from elsewhere ------------------------------------------------------------------


def test_each_refusal_of_a_fingerprint_gives_the_reason() -> None:
    document = fingerprint_of(compile_plan(example("estop"))).to_json()
    sections = document["sections"]
    assert isinstance(sections, dict)
    none = "no fingerprint; `fsoe-net plan --format json` makes one"
    digits = "section 'copies' has no SHA-256 of 64 hexadecimal digits"
    whole = "the whole does not fit the sections: the fingerprint was changed"
    form = (
        "fingerprint of the form {!r}; this fsoe-net makes 'fsoe-net fingerprint 2', which "
        "holds more: make the fingerprint again, compare the report, and accept again"
    )
    for wrong, words in [
        ([], none),
        (document | {"sections": None}, none),
        (document | {"form": "x"}, form.format("x")),
        ({"sections": {}}, form.format(None)),
        (document | {"sections": sections | {"copies": "1" * 63}}, digits),
        (document | {"sections": sections | {"copies": "1" * 65}}, digits),
        (document | {"sections": sections | {"copies": "1" * 64}}, whole),
    ]:
        with pytest.raises(PlanFormatError) as refused:
            fingerprint_from_json(wrong)
        assert str(refused.value) == words
    upper = {name: value.upper() for name, value in sections.items()}
    again = document | {"sections": upper, "whole": str(document["whole"]).upper()}
    assert fingerprint_from_json(again) == fingerprint_from_json(document)


def test_the_plan_in_a_record_is_compiled_again() -> None:
    functions = (
        SafetyFunction(
            name="e-stop",
            elements=(
                SafetyElement(kind=ElementKind.LOGIC, name="el1918", sub="el1918", time_ms=2.0),
            ),
        ),
    )
    plan = replace(compile_plan(example("estop")), safety_sha256=safety_sha256(functions))
    found = fingerprint_of(plan)
    file = SourceFile(path="a", sha256="0" * 64)
    signed = SignedBy(name="A", date="2025-01-01")
    record = Acceptance(
        network="estop",
        made_with="1",
        whole=found.whole,
        sections=found.sections,
        plan=plan.to_bytes(),
        safety_functions=functions,
        inputs=(file,),
        reports=(file,),
        open_points=0,
        assumptions=0,
        test_record=file,
        steps=0,
        author=signed,
        verifier=signed,
    )
    out = FindingList()
    assert accepted_plan(record, out) == (plan, found)
    assert out.diagnostics == []
    changed = dict(found.sections) | {"copies": "0" * 64, "cycle": "0" * 64}
    for wrong in (
        replace(record, plan=b"no plan"),
        replace(record, safety_functions=()),
        replace(record, whole="0" * 64),
        replace(record, sections=changed),
        replace(record, sections={}),
    ):
        assert accepted_plan(wrong, out) is None
    assert [(d.code, d.message) for d in out.diagnostics] == [
        ("FSN162", f"the plan in this record: {words}")
        if words.startswith("7 bytes")
        else ("FSN162", words)
        for words in (
            "7 bytes are too short for a plan; is the file cut off?",
            "the safety functions in this record are not those of its plan",
            "the fingerprint in this record is not that of its plan: the whole",
            "the fingerprint in this record is not that of its plan: section copies, cycle",
            "the fingerprint in this record is not that of its plan: section "
            + ", ".join(SECTIONS),
        )
    ]
    assert {d.hint for d in out.diagnostics} == {
        "take the record from version control, or make it again"
    }


def test_the_crc_is_that_of_zlib() -> None:
    data = encode_plan(compile_plan(example("estop")))
    assert fix_crc(data) == data
    assert zlib.crc32(data[:16] + bytes(4) + data[20:]) == struct.unpack_from("<I", data, 16)[0]
