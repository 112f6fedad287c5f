"""What another file says, taken from the network itself, gives no finding; each change its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from changed import figures
from compare.robot import (
    COUPLER,
    LIBRARY,
    ROBOT,
    at,
    bus,
    changed,
    codes,
    crossed,
    fact,
    found,
    more_entries,
    out_pdo,
    pdos,
    product,
    slots,
    types,
    with_text,
)
from described import described_devices, entry
from hypothesis import given, settings
from hypothesis import strategies as st
from networks import EXAMPLES, example, resolved

from fsoe_net.compare.references import check_references
from fsoe_net.diag.catalogue import CATALOGUE
from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.model.bus import Direction, Pdo, SyncManager, Watchdog
from fsoe_net.model.description import (
    DescribedSubDevice,
    Description,
    PdoFacts,
    TypeFacts,
)
from fsoe_net.rules.library import check_library


@pytest.mark.parametrize("name", ["estop", "el6910"])
def test_the_network_itself_raises_nothing(name: str):
    assert codes(bus(example(name)), example(name)) == []


def test_a_device_type_of_its_own_raises_nothing():
    assert codes(types()) == []


def test_several_files_are_all_compared():
    both = check_references(
        ROBOT, [bus(cycle_us=7), types(pdos(2, Pdo(index=0x1601, entries=())))], library=LIBRARY
    )
    assert sorted(d.code for d in both) == ["FSN433", "FSN445"]


# -- identity, revision, place --------------------------------------------------------------------


def test_another_device_is_named_once_and_its_copies_are_not():
    one = found(changed(1, product(0x12345678)))
    assert [d.code for d in one] == ["FSN431"]
    assert {"el1904", "2", "0x12345678"} <= set(figures(one[0].message).split())


def test_unknown_identity_is_not_a_difference():
    assert codes(changed(1, product(0))) == []


def test_order_number_represents_an_identity():
    lcec = replace(bus(), format="lcec", connections=(), copies=())
    rows = [replace(product(0)(s), order="") for s in lcec.subdevices]
    rows[1] = replace(rows[1], order="EL2904")
    assert codes(replace(lcec, subdevices=tuple(rows))) == ["FSN431"]


def test_revision_counts_where_both_state_one(tmp_path: Path):
    text = (EXAMPLES / "el6910" / "network.yaml").read_text("utf-8")
    folder = tmp_path / "net"
    folder.mkdir()
    (folder / "devices").symlink_to(EXAMPLES / "el6910" / "devices")
    with_revision = text.replace(
        "{name: el1904, position: 2", "{name: el1904, revision: 5, position: 2"
    )
    assert with_revision != text
    (folder / "network.yaml").write_text(with_revision, "utf-8")
    network = resolved(folder / "network.yaml")
    assert codes(types(), network) == ["FSN432"]
    two = types()
    exact = replace(two.subdevices[0], revision=5)
    assert codes(replace(two, subdevices=(*two.subdevices, exact)), network) == []
    assert codes(types(lambda s: replace(s, revision=None)), network) == []


def test_exchanged_devices_are_one_finding():
    made = bus()
    rows = list(made.subdevices)
    rows[1], rows[2] = at(2, made.subdevices[2]), at(3, made.subdevices[1])
    # Copies go by number, so that they follow the exchange here.
    one = found(replace(made, subdevices=tuple(rows), copies=()))
    assert [d.code for d in one] == ["FSN442"]


def test_missing_device_is_one_finding_unless_the_text_is_cut():
    made = replace(bus(), copies=(), connections=())
    short = replace(made, subdevices=made.subdevices[:-1])
    one = found(short)
    assert [(d.code, figures(d.message)) for d in one] == [("FSN442", "drive_2")]
    assert codes(replace(short, truncated=True)) == []
    assert codes(replace(short, format="ethercat-pdos")) == []  # names only some


def test_device_of_a_group_that_comes_and_goes_is_not_missing():
    made = replace(bus(), copies=(), connections=())
    free = replace(made.subdevices[-1], position=None)
    assert codes(replace(made, subdevices=(*made.subdevices[:-1], free))) == []


def test_more_devices_are_a_note():
    made = bus()
    more = at(6, made.subdevices[2])
    notes = found(
        replace(made, subdevices=(COUPLER, *map(_next, made.subdevices), more), copies=())
    )
    assert [(d.code, d.level) for d in notes] == [("FSN442", Severity.INFO)]


def _next(sub: DescribedSubDevice) -> DescribedSubDevice:
    return sub


def test_file_of_another_machine_is_reported_in_one_line():
    made = bus()
    rows = tuple(product(7 + n)(s) for n, s in enumerate(made.subdevices))
    one = found(replace(made, subdevices=rows, cycle_us=77))
    assert [(d.code, d.level) for d in one] == [("FSN443", Severity.WARNING)]
    one = found(types(product(7)))
    assert [(d.code, d.level) for d in one] == [("FSN443", Severity.INFO)]


def test_text_that_names_no_device_is_paired_by_its_pdo_numbers():
    row = replace(product(0)(bus().subdevices[0]), position=None)
    row = replace(row, device=replace(row.device, vendor_id=0))
    text = Description(format="ethercat-pdos", path="pdos.txt", subdevices=(row,))
    assert codes(text) == []
    other = replace(out_pdo(), entries=(*out_pdo().entries, entry(0x7001, 9, 8)))
    assert other.index == 0x1600
    managers = row.device.sync_managers
    first = next(m.pdos or () for m in managers if m.index == 2)
    two = found(replace(text, subdevices=(pdos(2, other, *first[1:])(row),)))
    assert [d.code for d in two] == ["FSN434"]
    lone = replace(text, subdevices=(pdos(2, Pdo(index=0x1777, entries=()))(row),))
    assert codes(lone) == ["FSN443"]


# -- process data ---------------------------------------------------------------------------------


def test_unknown_pdo_is_an_error_by_a_type_and_a_warning_by_a_bus():
    other = replace(out_pdo(), index=0x1605)
    one = found(types(pdos(2, other)))
    assert [(d.code, d.level) for d in one] == [("FSN433", Severity.ERROR)]
    one = found(changed(1, pdos(2, other)))
    assert [(d.code, d.level) for d in one] == [("FSN433", Severity.WARNING)]


def test_order_of_pdos_counts():
    logic = bus().subdevices[0]
    there = next(m.pdos or () for m in logic.device.sync_managers if m.index == 2)
    one = found(changed(0, pdos(2, *reversed(there))))
    assert [d.code for d in one] == ["FSN433"]


def test_optional_pdos_may_be_assigned_where_the_device_lets_one():
    bare = pdos(2)

    def offered(sub: DescribedSubDevice) -> DescribedSubDevice:
        return replace(bare(sub), available=(out_pdo(),))

    assert codes(types(offered, facts=TypeFacts(assignable=True))) == []
    assert codes(types(offered, facts=TypeFacts(assignable=False))) == ["FSN433"]


@pytest.mark.parametrize(
    ("facts", "code", "level"),
    [
        (fact(fixed=True), "FSN436", Severity.ERROR),
        (fact(), "FSN434", Severity.INFO),
        (TypeFacts(), "FSN434", Severity.WARNING),
        (replace(fact(fixed=True), modular=True), "FSN436", Severity.INFO),
    ],
)
def test_other_entries_of_fixed_free_and_unknown_pdos(facts: TypeFacts, code: str, level: Severity):
    one = found(types(pdos(2, more_entries(out_pdo())), facts=facts))
    assert [(d.code, d.level) for d in one] == [(code, level)]
    assert one[0].span.file.endswith("el1904.yaml")
    assert len(one[0].related) == 1


def test_padding_alone_is_a_code_of_its_own():
    pdo = out_pdo()
    longer = replace(pdo, entries=(*pdo.entries, entry(0, 0, 8)))
    assert codes(types(pdos(2, longer), facts=fact(fixed=True))) == ["FSN435"]
    assert codes(changed(1, pdos(2, longer))) == ["FSN435"]


def test_names_do_not_count_and_padding_may_be_cut():
    pdo = out_pdo()
    halves = []
    for e in pdo.entries:
        if e.is_gap and e.bits > 1:
            halves += [replace(e, bits=1), replace(e, bits=e.bits - 1)]
        else:
            halves.append(replace(e, name="x"))
    assert len(halves) >= len(pdo.entries)
    assert codes(types(pdos(2, replace(pdo, entries=tuple(halves))))) == []


def test_mandatory_pdo_that_is_not_assigned():
    other = Pdo(index=0x1605, entries=(entry(0x7050, 1, 8),))
    facts = TypeFacts(
        pdos=(PdoFacts(index=0x1605, direction=Direction.OUTPUT, sm=2, mandatory=True),),
        assignable=True,
    )
    assert codes(types(pdos(2, out_pdo(), other), facts=facts)) == ["FSN437"]


def test_pdos_that_exclude_each_other():
    logic = bus().subdevices[0]
    excluding = PdoFacts(index=0x1600, direction=Direction.OUTPUT, excludes=frozenset({0x1601}))
    row = replace(logic, facts=TypeFacts(pdos=(excluding,)))
    esi = Description(format="esi", path="esi", subdevices=(row,))
    assert codes(esi) == ["FSN438"]


def test_two_sync_managers_for_outputs_are_one_finding():
    """Hazards 46 and 49: the FSoE frame of EP1957 is on SM6."""

    def move(sub: DescribedSubDevice) -> DescribedSubDevice:
        bare = pdos(2)(sub)
        six = SyncManager(index=6, direction=Direction.OUTPUT, pdos=(out_pdo(),))
        managers = (*bare.device.sync_managers, six)
        return replace(bare, device=replace(bare.device, sync_managers=managers))

    one = found(types(move))
    assert [d.code for d in one] == ["FSN439"]
    assert {"SM2", "SM6"} <= set(figures(one[0].message).split())


def test_lengths_of_sync_managers_where_nothing_else_is_known():
    opaque = Pdo(index=0, entries=(entry(0, 0, 64),))
    one = found(replace(changed(1, pdos(2, opaque)), copies=()))
    assert [d.code for d in one] == ["FSN440"]
    assert figures(one[0].message).split()[-2:] == ["6", "8"]


def test_direction_and_watchdog_of_sync_managers():
    def turn(sub: DescribedSubDevice) -> DescribedSubDevice:
        managers = tuple(
            replace(m, direction=Direction.INPUT) if m.index == 2 else m
            for m in sub.device.sync_managers
        )
        return replace(sub, device=replace(sub.device, sync_managers=managers))

    assert codes(changed(1, turn)) == ["FSN440"]


def test_watchdogs_are_compared_with_configurations_only(tmp_path: Path):
    folder = EXAMPLES.parent / "tests" / "diagnostics" / "base"
    network = resolved(folder / "network.yaml")
    made = bus(network)
    row = made.subdevices[0]
    managers = tuple(
        replace(m, watchdog=Watchdog.DISABLE) if m.index == 2 else m
        for m in row.device.sync_managers
    )
    other = replace(row, device=replace(row.device, sync_managers=managers))
    rows = (other, *made.subdevices[1:])
    assert codes(replace(made, subdevices=rows), network) == ["FSN440"]
    assert codes(replace(made, subdevices=rows, format="soem-slaveinfo"), network) == []


def test_default_size_is_a_note_and_only_without_other_findings():
    wrong = TypeFacts(default_bytes={2: 99})
    one = found(types(facts=wrong))
    assert [(d.code, d.level) for d in one] == [("FSN441", Severity.INFO)]
    assert codes(types(facts=TypeFacts(default_bytes={2: 6}))) == []
    assert codes(types(pdos(2, more_entries(out_pdo())), facts=wrong)) == ["FSN434"]


def test_a_device_that_is_cut_off_is_not_compared():
    cut = types(lambda s: replace(pdos(2)(s), truncated=True))
    assert codes(cut) == []


def test_a_device_with_errors_of_its_own_is_not_compared():
    device = ROBOT.network.subdevices[1].device
    assert device is not None
    known = [Diagnostic(code="FSN401", message="x", span=device.span)]
    reference = types(pdos(2, more_entries(out_pdo())))
    assert check_references(ROBOT, [reference], library=LIBRARY, found=known) == []


# -- copies, slots, cycle -------------------------------------------------------------------------


def test_one_copy_may_be_two_transfers_but_not_more():
    made = bus()
    assert len(made.copies) == 8
    missing = found(replace(made, copies=made.copies[1:]))
    assert [d.code for d in missing] == ["FSN444"]
    at_end = next(n for n, c in enumerate(made.copies) if c.destination.subdevice == 1)
    copies = list(made.copies)
    copies[at_end] = replace(copies[at_end], bits=copies[at_end].bits + 8)
    longer = found(replace(made, copies=tuple(copies)))
    assert [(d.code, figures(d.message).split()[-2:]) for d in longer] == [("FSN444", ["7", "1"])]
    assert codes(replace(made, copies=())) == []


def test_copy_from_another_byte_and_copy_without_a_source():
    made = bus()
    first = made.copies[0]
    moved = replace(first, source=replace(first.source, bit_offset=first.source.bit_offset + 8))
    one = found(replace(made, copies=(moved, *made.copies[1:])))
    assert [d.code for d in one] == ["FSN444"]


def test_copies_of_two_adjacent_transfers_may_be_one():
    network = example("estop")
    made = bus(network)
    first = made.copies[0]
    half = first.bits // 2
    parts = [
        replace(first, bits=half),
        replace(
            first,
            bits=half,
            source=replace(first.source, bit_offset=first.source.bit_offset + half),
            destination=replace(first.destination, bit_offset=first.destination.bit_offset + half),
        ),
    ]
    assert codes(replace(made, copies=(*parts, *made.copies[1:])), network) == []


def test_order_of_slots_in_linuxcnc():
    assert codes(slots(1, 2, 3, 4)) == []
    two = found(slots(2, 1, 3, 4))
    assert [d.code for d in two] == ["FSN444"]
    assert figures(two[0].message) == "0 el6910 el1904 el2904"
    assert codes(slots(2, 3, 1, 4)) == ["FSN444"] * 3


def test_a_slot_is_that_of_the_connection(tmp_path: Path):
    swapped = with_text(
        tmp_path / "swapped",
        *(
            change
            for way in ("0x6", "0x7")
            for change in (
                (f"el6910, index: {way}000", f"el6910, index: {way}0ff"),
                (f"el6910, index: {way}010", f"el6910, index: {way}000"),
                (f"el6910, index: {way}0ff", f"el6910, index: {way}010"),
            )
        ),
    )
    assert [c.slot for c in swapped.connections] == [1, 0, 2, 3]
    assert codes(slots(2, 1, 3, 4), swapped) == []
    assert codes(slots(1, 2, 3, 4), swapped) == ["FSN444"]
    # Two halves in different slots are an error of the network itself; they have no slot.
    split = crossed(tmp_path / "crossed")
    assert [c.slot for c in split.connections] == [None, None, 2, 3]
    for order in ((1, 2, 3, 4), (2, 1, 3, 4)):
        assert codes(slots(*order), split) == []
    assert codes(slots(1, 2, 4, 3), split) == ["FSN444"]


def test_differing_cycle_time_is_found():
    made = bus()
    assert made.cycle_us is not None
    assert codes(replace(made, cycle_us=made.cycle_us + 1)) == ["FSN445"]
    assert codes(replace(made, cycle_us=None)) == []


# -- library --------------------------------------------------------------------------------------


def test_the_library_has_only_notes_for_the_examples():
    for network in (ROBOT, example("estop")):
        assert check_library(network, LIBRARY, notes=False) == []
        told = check_library(network, LIBRARY, notes=True)
        assert {d.code for d in told} == {"FSN449"}
        assert len(told) == len({d.span.file for d in told})


@settings(max_examples=30)
@given(
    st.lists(described_devices(), max_size=5),
    st.sampled_from(["esi", "sii", "eni", "lcec", "ethercat-config", "ethercat-slaves"]),
    st.booleans(),
    st.data(),
)
@pytest.mark.uncounted
def test_no_description_breaks_the_comparison(
    rows: list[DescribedSubDevice], kind: str, placed: bool, data: st.DataObject
):
    made = bus()
    mixed = []
    for n, row in enumerate(rows):
        mine = made.subdevices[n]
        device = replace(
            row.device,
            vendor_id=mine.device.vendor_id,
            product_code=data.draw(st.sampled_from([mine.device.product_code, 0, 5])),
        )
        position = data.draw(st.integers(0, 9)) if placed else None
        mixed.append(replace(row, device=device, position=position, alias=n % 2))
    reference = replace(made, format=kind, subdevices=tuple(mixed))
    numbers = range(len(mixed))
    reference = replace(
        reference,
        copies=tuple(
            c
            for c in made.copies
            if c.source.subdevice in numbers and c.destination.subdevice in numbers
        ),
        connections=tuple(
            replace(c, slot=n)
            for n, c in enumerate(made.connections)
            if c.main in numbers and c.sub in numbers
        ),
    )
    for one in found(reference):
        assert one.code in CATALOGUE
        assert one.message
        assert one.hint
