"""The fingerprint: golden values, what changes it and where, what does not, Python and C."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from core.rig import load
from hypothesis import given, settings
from hypothesis import strategies as st
from networks import PLAIN, example, resolved, write_big_network
from weekly import examples

from fsoe_net.diag.diagnostic import Span
from fsoe_net.errors import PlanFormatError
from fsoe_net.model.safety import ElementKind, SafeBit, SafetyElement, SafetyFunction
from fsoe_net.plan.codec import decode_plan, encode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import (
    SECTIONS,
    Fingerprint,
    canonical_section,
    fingerprint_from_json,
    fingerprint_of,
    fingerprint_of_sections,
    safety_sha256,
    safety_text,
)
from fsoe_net.plan.model import Plan, PlanSdo

# A change of these means that every accepted fingerprint is void: raise FORM and say so.
GOLDEN = {
    "estop": "7ea038e0ba8386e10bfe0baf9340f93a9e2bde5ef0e015909f8acabb4b3f3c6d",
    "el6910": "e633f9fafd2b7d02084296923836d64882aabfe02843d9d8d4bbc3b547e6c118",
}
GOLDEN_SAFETY = "9ca4ffba7635db86cb8fcadbc9c65790ee6dde7d3ca268c0c9a9550428c951be"
FUNCTIONS = """\
safety_functions:
  - name: estop
    trigger: button
    required_reaction_ms: 230
    required: {pl: d}
    elements:
      - {kind: input, sub: el1904, time_ms: 4, pfh_per_hour: 1.11e-9, source: manual}
      - {kind: actuator, name: K1, time_ms: 20}
  - name: door
    elements: [{kind: input, sub: el1904}]
"""


@pytest.mark.shows("R4")
@pytest.mark.parametrize("name", GOLDEN)
def test_fingerprint_has_the_known_value(name: str) -> None:
    found = fingerprint_of(compile_plan(example(name)))
    assert found.whole == GOLDEN[name]
    assert found.short.replace(" ", "").lower() == GOLDEN[name][:16]


@pytest.mark.parametrize("name", GOLDEN)
def test_python_and_the_core_agree_without_asking_each_other(name: str) -> None:
    plan = compile_plan(example(name))
    for one in (plan, replace(plan, safety_sha256="5a" * 32), replace(plan, cycle_ns=0)):
        assert load(one.to_bytes()).fingerprint() == fingerprint_of(one)
        assert fingerprint_of(decode_plan(one.to_bytes())) == fingerprint_of(one)


@pytest.mark.shows("R4")
def test_it_can_be_recomputed_from_the_documented_text() -> None:
    plan = compile_plan(example("estop"))
    sums = {
        name: hashlib.sha256(canonical_section(plan, name).encode()).hexdigest()
        for name in SECTIONS
    }
    lines = ["fsoe-net fingerprint 2"] + [f"{name} {sums[name]}" for name in SECTIONS]
    whole = hashlib.sha256("".join(f"{line}\n" for line in lines).encode()).hexdigest()
    assert (whole, sums) == (GOLDEN["estop"], dict(fingerprint_of(plan).sections))
    assert canonical_section(plan, "copies").splitlines() == [
        "fsoe-net fingerprint 2 copies",
        "copy from=1.3@0 to=0.2@0 bits=48 kind=1 connection=0 net=safety_net",
        "copy from=0.3@0 to=1.2@0 bits=48 kind=1 connection=0 net=safety_net",
    ]


def test_text_that_is_hashed_in_parts_has_the_hash_of_the_whole_text(tmp_path: Path) -> None:
    plan = compile_plan(resolved(write_big_network(tmp_path, 424, 400)))
    text = canonical_section(plan, "process_data")
    assert text.count("\n") > 8192
    whole = hashlib.sha256(text.encode()).hexdigest()
    assert fingerprint_of(plan).sections["process_data"] == whole


# -- what changes it, and where -------------------------------------------------------------------

Change = Callable[[Plan], Plan]


def one(table: str, number: int = 0, **changes: object) -> Change:
    """Change fields of one record."""

    def change(plan: Plan) -> Plan:
        rows = list(getattr(plan, table))
        row = rows[number]
        rows[number] = (
            row._replace(**changes) if isinstance(row, tuple) else replace(row, **changes)
        )
        return replace(plan, **{table: tuple(rows)})

    return change


def with_sdos(plan: Plan) -> Plan:
    """Give the last SubDevice two start-up SDOs."""
    last = plan.subdevices[-1]._replace(first_sdo=0, sdo_count=2)
    sdos = (
        PlanSdo(index=0x8000, subindex=1, size_bytes=2, value=-1),
        PlanSdo(index=0x8000, subindex=2, size_bytes=4, value=7),
    )
    assert plan.sdos == ()
    return replace(plan, subdevices=(*plan.subdevices[:-1], last), sdos=sdos)


def swapped_sdos(plan: Plan) -> Plan:
    return replace(plan, sdos=plan.sdos[::-1])


def exchanged_names(plan: Plan) -> Plan:
    """Give two values of one sync manager each other's names, as two exchanged interfaces do."""
    first, second, *others = plan.symbols
    assert first.name != second.name
    names = replace(first, name=second.name), replace(second, name=first.name)
    return replace(plan, symbols=(*names, *others))


def swapped_entries(plan: Plan) -> Plan:
    rows = list(plan.entries)
    rows[1], rows[2] = rows[2], rows[1]
    assert rows != list(plan.entries)
    return replace(plan, entries=tuple(rows))


@pytest.mark.shows("R5")
@pytest.mark.parametrize(
    ("section", "change"),
    [
        ("devices", one("subdevices", vendor_id=3)),
        ("devices", one("subdevices", product_code=3)),
        ("devices", one("subdevices", revision_low=3)),
        ("devices", one("subdevices", revision_high=3)),
        ("devices", one("subdevices", alias=3)),
        ("devices", one("subdevices", position=3)),
        ("devices", one("subdevices", assign_activate=0x300)),
        ("devices", one("subdevices", in_copy=False)),
        ("devices", one("subdevices", name="el1904_left")),
        ("devices", one("subdevices", driver='{"auto_fault_reset":true}')),
        ("devices", one("sdos", value=77)),
        ("devices", one("sdos", subindex=77)),
        ("devices", swapped_sdos),
        ("process_data", one("entries", kind=4)),
        ("process_data", one("entries", index=0x7FFF)),
        ("process_data", one("entries", registered=False)),
        ("process_data", swapped_entries),
        ("process_data", one("sync_managers", watchdog=0)),
        ("process_data", one("pdos", index=0x1677)),
        ("process_data", one("blocks", safe_bytes=9)),
        ("process_data", one("blocks", copied=False)),
        ("process_data", one("symbols", restart_relevant=False)),
        ("process_data", one("symbols", stop_value=3)),
        ("process_data", one("symbols", name="another")),
        ("process_data", exchanged_names),
        ("copies", one("copies", source_bit=8)),
        ("copies", one("copies", destination_bit=8)),
        ("copies", one("copies", bits=56)),
        ("copies", one("copies", net="other")),
        ("connections", one("connections", connection_id=99)),
        ("connections", one("connections", address=99)),
        ("connections", one("connections", address=None)),
        ("connections", one("connections", watchdog_ms=99)),
        ("connections", one("connections", safe_to_sub=2)),
        ("connections", one("connections", app_parameters="0100")),
        ("connections", one("connections", name="another")),
        ("connections", one("connections", net="another")),
        ("cycle", lambda plan: replace(plan, cycle_ns=2_000_000)),
        ("cycle", lambda plan: replace(plan, cycle_ns=0)),
        ("safety_functions", lambda plan: replace(plan, safety_sha256="00" * 32)),
    ],
)
def test_a_change_changes_its_section_and_the_whole(section: str, change: Change) -> None:
    plan = with_sdos(compile_plan(example("el6910")))
    before, after = fingerprint_of(plan), fingerprint_of(change(plan))
    assert before.changed(after) == (section,)
    assert before.whole != after.whole


@pytest.mark.parametrize(
    "change",
    [
        lambda plan: replace(plan, symbols=plan.symbols[::-1]),
        lambda plan: replace(plan, blocks=plan.blocks[::-1]),
    ],
)
def test_labels_and_order_that_do_not_matter_change_nothing(change: Change) -> None:
    plan = compile_plan(example("el6910"))
    assert change(plan) != plan
    assert fingerprint_of(change(plan)) == fingerprint_of(plan)


def test_numbers_of_connections_change_nothing() -> None:
    plan = compile_plan(example("el6910"))
    last = len(plan.connections) - 1
    assert last > 0
    turned = replace(
        plan,
        connections=plan.connections[::-1],
        copies=tuple(
            c._replace(connection=last - c.connection) if c.connection <= last else c
            for c in plan.copies
        ),
    )
    assert fingerprint_of(turned) == fingerprint_of(plan)
    assert load(turned.to_bytes()).fingerprint() == fingerprint_of(plan)


# -- the files of a network -----------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(PLAIN / "el6910", tmp_path / "el6910"))


def of_files(folder: Path) -> Fingerprint:
    return fingerprint_of(compile_plan(resolved(folder / "network.yaml")))


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text("utf-8")
    assert text.count(old) >= 1, old
    file.write_text(text.replace(old, new), "utf-8")


def test_path_comments_and_file_names_change_nothing(folder: Path) -> None:
    network = folder / "network.yaml"
    network.write_text("# a comment\n" + network.read_text("utf-8") + "\n# another\n", "utf-8")
    (folder / "devices" / "el1904.yaml").rename(folder / "other.yaml")
    edit(network, "devices/el1904.yaml", "other.yaml")
    assert of_files(folder).whole == GOLDEN["el6910"]


def test_order_of_keys_and_of_nets_changes_nothing(folder: Path) -> None:
    import yaml

    file = folder / "network.yaml"
    document = yaml.safe_load(file.read_text("utf-8"))
    nets = document["nets"]
    for net in nets:
        for key in ("transfers", "connections"):
            if key in net:
                net[key].reverse()
    nets.reverse()
    turned = dict(reversed(document.items()))
    file.write_text(yaml.safe_dump(turned, sort_keys=False), "utf-8")
    assert of_files(folder).whole == GOLDEN["el6910"]


def test_order_of_subdevices_changes_it(folder: Path) -> None:
    import yaml

    file = folder / "network.yaml"
    document = yaml.safe_load(file.read_text("utf-8"))
    document["subdevices"].reverse()
    file.write_text(yaml.safe_dump(document, sort_keys=False), "utf-8")
    assert of_files(folder).whole != GOLDEN["el6910"]


# -- safety functions -----------------------------------------------------------------------------


def add_functions(folder: Path, text: str = FUNCTIONS) -> Fingerprint:
    shutil.copy(PLAIN / "el6910" / "network.yaml", folder / "network.yaml")
    with (folder / "network.yaml").open("a", encoding="utf-8") as file:
        file.write(text)
    return of_files(folder)


def test_safety_functions_are_a_section_of_their_own(folder: Path) -> None:
    plain, stated = of_files(folder), add_functions(folder)
    assert plain.changed(stated) == ("safety_functions",)
    assert stated.sections["safety_functions"] == GOLDEN_SAFETY
    network = resolved(folder / "network.yaml").network
    assert hashlib.sha256(safety_text(network.safety_functions).encode()).hexdigest() == (
        GOLDEN_SAFETY
    )


@pytest.mark.shows("R5")
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("time_ms: 4", "time_ms: 4.5"),
        ("time_ms: 20", "time_ms: 21"),
        ("required_reaction_ms: 230", "required_reaction_ms: 231"),
        ("pl: d", "pl: e"),
        ("pl: d", "sil: 2"),
        ("1.11e-9", "1.12e-9"),
        ("name: K1", "name: K2"),
        ("trigger: button", "trigger: key"),
        ("trigger: button", "trigger: button\n    reset: key"),
        ("trigger: button", "trigger: button\n    modes: automatic"),
        ("name: door", "name: gate"),
        ("source: manual", "source: guess"),
        ("time_ms: 20", "time_ms: 20, zero_because: none"),
        ("time_ms: 20", "time_ms: 20, claim: {pl: d}"),
        ("time_ms: 20", "time_ms: 20, claim: {sil: 2}"),
        ("time_ms: 20", "time_ms: 20, category: 3"),
        ("time_ms: 20", "time_ms: 20, mission_years: 20"),
        ("sub: el1904}", "sub: el1904, bits: [{bit: 0, name: K1}]}"),
    ],
)
def test_statements_about_a_function_change_it(folder: Path, old: str, new: str) -> None:
    before = add_functions(folder)
    assert old in FUNCTIONS
    after = add_functions(folder, FUNCTIONS.replace(old, new))
    assert before.changed(after) == ("safety_functions",)


@pytest.mark.parametrize(
    ("old", "new"), [("time_ms: 4", "time_ms: 4.0"), ("1.11e-9", "0.111e-8"), ("pl: d", "pl: D")]
)
def test_how_a_number_is_written_changes_nothing(folder: Path, old: str, new: str) -> None:
    assert add_functions(folder) == add_functions(folder, FUNCTIONS.replace(old, new))


BITS = "sub: el1904, bits: [{bit: 0, name: K1}, {bit: 1, name: K2}]}"


@pytest.mark.shows("R5")
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("bit: 0, name: K1}, {bit: 1, name: K2", "bit: 0, name: K2}, {bit: 1, name: K1"),
        ("bit: 0", "bit: 2"),
        ("name: K1", "name: K3"),
        ("bit: 0", "slot: 0, bit: 0"),
        (", {bit: 1, name: K2}", ""),
    ],
    ids=["exchanged", "bit", "name", "slot", "removed"],
)
def test_a_safe_bit_changes_it(folder: Path, old: str, new: str) -> None:
    text = FUNCTIONS.replace("sub: el1904}", BITS)
    before = add_functions(folder, text)
    assert old in text
    after = add_functions(folder, text.replace(old, new))
    assert before.changed(after) == ("safety_functions",)


def test_order_of_safe_bits_in_the_file_changes_nothing(folder: Path) -> None:
    text = FUNCTIONS.replace("sub: el1904}", BITS)
    turned = FUNCTIONS.replace(
        "sub: el1904}", "sub: el1904, bits: [{bit: 1, name: K2}, {name: K1, bit: 0x0}]}"
    )
    assert add_functions(folder, text) == add_functions(folder, turned)


def test_safe_bits_follow_their_element_in_lines_of_their_own() -> None:
    bits = (SafeBit(bit=8, name="K 1"), SafeBit(bit=0, name="K2", slot=1))
    one = SafetyElement(kind=ElementKind.OUTPUT, name="a", bits=bits)
    plain = SafetyFunction(name="f", elements=(replace(one, bits=()),))
    stated = replace(plain, elements=(one,))
    assert safety_text((stated,)) == safety_text((plain,)) + (
        "safe_bit slot=- bit=8 name=K%201\nsafe_bit slot=1 bit=0 name=K2\n"
    )


def test_order_of_functions_does_not_matter_that_of_elements_does() -> None:
    span = Span("x")
    first = SafetyElement(span=span, kind=ElementKind.INPUT, name="a b%ü\n")
    second = SafetyElement(span=span, kind=ElementKind.OUTPUT, name="c")
    f = SafetyFunction(span=span, name="f", elements=(first, second))
    g = SafetyFunction(span=span, name="g", elements=())
    assert safety_text((f, g)) == safety_text((g, f))
    assert "name=a%20b%25%C3%BC%0A " in safety_text((f,))
    assert safety_text((replace(f, elements=(second, first)),)) != safety_text((f,))
    assert safety_sha256(()) == ""


# -- the plan file --------------------------------------------------------------------------------


def test_only_safety_functions_need_format_1_1() -> None:
    plan = compile_plan(example("estop"))
    stated = replace(plan, safety_sha256=bytes(range(32)).hex())
    old, new = encode_plan(plan), encode_plan(stated)
    assert (old[8:12], new[8:12]) == (b"\1\0\0\0", b"\1\0\1\0")
    assert new[-32:] == bytes(range(32))
    assert decode_plan(new) == stated
    assert (plan.format, stated.format) == ("1.0", "1.1")


def test_every_truncation_and_change_of_format_1_1_is_refused() -> None:
    data = encode_plan(replace(compile_plan(example("estop")), safety_sha256="5a" * 32))
    for cut in range(len(data)):
        with pytest.raises(PlanFormatError):
            decode_plan(data[:cut])
    for at in range(len(data)):
        with pytest.raises(PlanFormatError):
            decode_plan(data[:at] + bytes([data[at] ^ 0x10]) + data[at + 1 :])


def test_json_is_read_back_and_a_changed_one_refused() -> None:
    found = fingerprint_of(compile_plan(example("estop")))
    document = found.to_json()
    assert fingerprint_from_json(document) == found
    sections = dict(found.sections)
    other = fingerprint_of_sections(sections | {"cycle": "00" * 32})
    for change, words in [
        ({"form": "fsoe-net fingerprint 1"}, "of the form .*accept again"),
        ({"whole": other.whole}, "does not fit"),
        ({"sections": sections | {"copies": "12"}}, "'copies' has no SHA-256"),
        ({"sections": []}, "no fingerprint"),
    ]:
        with pytest.raises(PlanFormatError, match=words):
            fingerprint_from_json(document | change)


# -- Python and C on networks nobody thought of ---------------------------------------------------


@st.composite
def plans(draw: st.DrawFn) -> Plan:
    """A compiled example with drawn values wherever the loader lets a value through."""
    plan = with_sdos(compile_plan(example(draw(st.sampled_from(sorted(GOLDEN))))))
    u16, u32 = st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF)
    real = st.floats(allow_nan=False, allow_infinity=False)
    text = st.text(st.characters(exclude_categories=["C", "Z"]), max_size=9)
    stated = st.none() | u16
    subdevices = tuple(
        s._replace(
            name=draw(text),
            alias=draw(u16),
            position=draw(u16),
            vendor_id=draw(u32),
            product_code=draw(u32),
            revision_low=0,
            revision_high=draw(u32),
            assign_activate=draw(u16),
            driver=draw(text),
        )
        for s in plan.subdevices
    )
    sdos = tuple(
        replace(s, index=draw(u16), value=draw(st.integers(-(1 << 63), (1 << 63) - 1)))
        for s in plan.sdos
    )
    symbols = tuple(
        replace(s, factor=draw(real.filter(bool)), offset=draw(real), name=f"{n}{draw(text)}")
        for n, s in enumerate(plan.symbols[:4])
    )
    connections = tuple(
        c._replace(
            connection_id=draw(stated),
            address=draw(stated),
            watchdog_ms=draw(stated),
            app_parameters=draw(st.binary(max_size=9)).hex(),
        )
        for c in plan.connections
    )
    return replace(
        plan,
        cycle_ns=draw(u32),
        subdevices=subdevices,
        sdos=sdos,
        symbols=tuple(draw(st.permutations(symbols))),
        connections=connections,
        copies=tuple(c._replace(net=draw(text)) for c in plan.copies),
        safety_sha256=draw(st.sampled_from(["", "5a" * 32])),
    )


@pytest.mark.shows("R4", "R5")
@settings(max_examples=examples(60), deadline=None)
@given(plans())
@pytest.mark.uncounted
def test_python_and_the_core_agree_on_drawn_plans(plan: Plan) -> None:
    data = encode_plan(plan)
    found = load(data).fingerprint()
    assert decode_plan(data) == plan
    assert found == fingerprint_of(decode_plan(data))
    assert found == fingerprint_of(plan)


@pytest.mark.shows("R4", "R5")
@settings(max_examples=25, deadline=None)
@given(
    slots=st.lists(st.integers(0, 9), unique=True, min_size=1, max_size=6),
    order=st.randoms(use_true_random=False),
    cycle_us=st.integers(100, 10_000),
)
@pytest.mark.uncounted
def test_python_and_the_core_agree_on_drawn_networks(
    tmp_path_factory: pytest.TempPathFactory, slots: list[int], order, cycle_us: int
) -> None:
    path = _write_network(tmp_path_factory.mktemp("drawn"), slots, order, cycle_us)
    plan = compile_plan(resolved(path))
    assert len(plan.connections) == len(slots)
    assert load(plan.to_bytes()).fingerprint() == fingerprint_of(plan)
    order.shuffle(slots)
    again = _write_network(tmp_path_factory.mktemp("again"), sorted(slots), order, cycle_us)
    assert fingerprint_of(compile_plan(resolved(again))) == fingerprint_of(plan)


def _write_network(folder: Path, slots: list[int], order, cycle_us: int) -> Path:
    """One logic and a terminal for each slot; transfers in any order."""
    logic = ["vendor_id: 2", "product_id: 0x1afe3052"]
    for group, pdo, first in (("rpdo", 0x1600, 0x7000), ("tpdo", 0x1A00, 0x6000)):
        logic.append(f"{group}:")
        for n in range(10):
            at = first + 16 * n
            channels = "".join(
                f"      - {{index: {i}, sub_index: {s}, type: {t}}}\n"
                for i, s, t in (
                    (at, 1, "uint8"),
                    (at + 1, 1, "uint8"),
                    (at, 3, "uint16"),
                    (at, 2, "uint16"),
                )
            )
            logic.append(f"  - index: {pdo + n}\n    channels:\n{channels.rstrip()}")
    (folder / "logic.yaml").write_text("\n".join(logic) + "\n", "utf-8")
    shutil.copy(PLAIN / "el6910" / "devices" / "el1904.yaml", folder / "terminal.yaml")
    names = {slot: f"t{slot}" for slot in sorted(slots)}
    lines = [f"version: 1\ncycle_us: {cycle_us}\nsubdevices:"]
    lines.append("  - {name: logic, position: 0, config: logic.yaml}")
    lines += [
        f"  - {{name: {name}, position: {n}, config: terminal.yaml}}"
        for n, name in enumerate(names.values(), start=1)
    ]
    transfers = [
        end
        for slot, name in names.items()
        for end in (
            f"      - {{size: 6, in: {{ec_module: {name}, index: 0x6000, subindex: 1}},"
            f" out: {{ec_module: logic, index: {0x7000 + 16 * slot}, subindex: 1}}}}",
            f"      - {{size: 6, in: {{ec_module: logic, index: {0x6000 + 16 * slot},"
            f" subindex: 1}}, out: {{ec_module: {name}, index: 0x7000, subindex: 1}}}}",
        )
    ]
    order.shuffle(transfers)
    lines += ["nets:\n  - name: net\n    safety_master: logic\n    transfers:", *transfers]
    path = folder / "network.yaml"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path
