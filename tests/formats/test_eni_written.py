"""ENI from descriptions, and the copies of an ENI replaced: read back and compared."""

from __future__ import annotations

import re

import pytest
from data_files import need
from described import bus, copy, device, entry
from hypothesis import given, settings
from hypothesis import strategies as st
from networks import example

from fsoe_net.diag.printable import printable
from fsoe_net.errors import InputError
from fsoe_net.formats.eni.read import EniImages, load_eni, load_eni_images
from fsoe_net.formats.eni.write import write_eni
from fsoe_net.formats.eni.write_copies import replace_copies
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.bus import Device, Direction, Pdo, Sdo, SyncManager, Watchdog
from fsoe_net.model.described_network import describe
from fsoe_net.model.description import DescribedSubDevice, Description


def back(text: str | bytes) -> EniImages:
    out = Collector()
    data = text.encode() if isinstance(text, str) else text
    images = load_eni_images(data, out)
    assert [(d.code, d.message) for d in out.diagnostics] == []
    assert images is not None
    return images


# -- whole files ----------------------------------------------------------------------------------

# Names as a reader keeps them: what does not print is read as its escape.
names = st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"]), max_size=8).filter(
    lambda name: printable(name) == name
)
entries = st.builds(
    entry,
    st.integers(0, 0xFFFF),
    st.integers(0, 255),
    st.integers(1, 64),
    names,
)


def clean(row):
    return entry(0, 0, row.bits) if row.index == 0 else row


@st.composite
def managers(draw: st.DrawFn, number: int, direction: Direction, base: int) -> SyncManager:
    count = draw(st.integers(0, 3))
    pdos = tuple(
        Pdo(
            index=base + n,
            entries=tuple(map(clean, draw(st.lists(entries, min_size=1, max_size=4)))),
        )
        for n in range(count)
    )
    return SyncManager(
        index=number,
        direction=direction,
        pdos=pdos,
        start_byte=draw(st.integers(0, 0xFFFF)),
        watchdog=draw(st.sampled_from(Watchdog)),
    )


@st.composite
def descriptions(draw: st.DrawFn) -> Description:
    subs = []
    for position in draw(st.lists(st.integers(0, 0xFFFE), unique=True, min_size=1, max_size=4)):
        sms = [
            draw(managers(2, Direction.OUTPUT, 0x1600)),
            draw(managers(3, Direction.INPUT, 0x1A00)),
        ]
        if draw(st.booleans()):
            sms.append(draw(managers(6, Direction.OUTPUT, 0x1640)))
        sdo = Sdo(
            index=draw(st.integers(0x2000, 0xFFFF)),
            subindex=1,
            size_bytes=2,
            value=draw(st.integers(0, 0xFFFF)),
        )
        made = Device(
            path="<eni>",
            vendor_id=draw(st.integers(0, 0xFFFFFFFF)),
            product_code=draw(st.integers(0, 0xFFFFFFFF)),
            assign_activate=draw(st.integers(0, 0xFFFF)),
            sync_managers=tuple(sms),
            sdos=draw(st.sampled_from([(), (sdo,)])),
        )
        subs.append(
            DescribedSubDevice(
                name=draw(names),
                position=position,
                device=made,
                revision=draw(st.none() | st.integers(0, 0xFFFFFFFF)),
            )
        )
    cycle = draw(st.integers(1, 100_000))
    return Description(format="eni", path="<eni>", subdevices=tuple(subs), cycle_us=cycle)


@pytest.mark.shows("R22")
@settings(max_examples=25, deadline=None)
@given(descriptions(), st.sampled_from([0, 10]))
def test_written_values_are_read_back(given_: Description, header: int):
    out = Collector()
    found = load_eni(write_eni(given_, header_bytes=header).encode(), out)
    assert [d.message for d in out.diagnostics] == []
    assert found is not None
    assert [strip(s) for s in found.subdevices] == [strip(s) for s in given_.subdevices]
    assert found.cycle_us == given_.cycle_us


def strip(sub: DescribedSubDevice) -> tuple[object, ...]:
    return (sub.name, sub.position, sub.revision, sub.device)


@pytest.mark.parametrize("header", [0, 10])
@pytest.mark.parametrize("terminals", [1, 16, 90])
def test_copies_come_back(terminals: int, header: int):
    wanted = bus(terminals)
    images = back(write_eni(wanted, header_bytes=header))
    assert images.header_bits == 8 * header
    assert set(images.description.copies) == set(wanted.copies)


@pytest.mark.parametrize("name", ["estop", "el6910"])
def test_network_becomes_an_eni_with_its_transfers(name: str):
    resolution = example(name)
    wanted = describe(resolution.network)
    found = back(write_eni(wanted)).description
    place = {(c.source, c.destination, c.bits) for c in wanted.copies}
    assert {(c.source, c.destination, c.bits) for c in found.copies} == place
    assert len(place) == len(resolution.transfers)
    for one, two in zip(wanted.subdevices, found.subdevices, strict=True):
        rows = [[m.placed for m in s.device.layout.managers if m.bits] for s in (one, two)]
        assert [[(p.bit_offset, p.entry.address) for p in r] for r in rows[0]] == [
            [(p.bit_offset, p.entry.address) for p in r] for r in rows[1]
        ]


def test_registers_of_a_simple_subdevice_are_written():
    text = write_eni(bus(1))
    written = dict(re.findall(r"<Adp>1002</Adp><Ado>(\d+)</Ado><Data>([0-9a-f]+)</Data>", text))
    assert written[str(0x0810)] == "0012" + "0700" + "24000100"  # 56 bits of outputs from 0x1200
    assert written[str(0x0818)] == "001d" + "0800" + "20000100"
    logical = 0x10000000 + 7 + 8  # behind the logic
    assert (
        written[str(0x0600)]
        == logical.to_bytes(4, "little").hex() + "0700000700120002" + "01000000"
    )
    assert re.findall(r"<DataLength>(\d+)</DataLength><Cnt>(\d+)</Cnt>", text) == [("30", "6")]


def test_each_state_is_requested_and_checked_as_the_bus_expects_it():
    """ETG.1000.6: AL control 0x0120 and AL status 0x0130, 16 bits, little endian."""
    text = write_eni(bus(1))
    requested = set(re.findall(r"<Ado>288</Ado><Data>([0-9a-f]+)</Data>", text))
    checked = set(re.findall(r"<Validate><Data>([0-9a-f]+)</Data><DataMask>0f00", text))
    assert requested >= {"0200", "0400", "0800"}
    assert requested | {"0100"} == checked | {"0100"} <= {"0100", "0200", "0400", "0800"}


def test_an_unwritable_target_is_rejected():
    one = bus(1)
    sub = one.subdevices[0]
    nowhere = DescribedSubDevice(name="type", device=sub.device)
    for wrong, word in (
        (Description(format="", path="", subdevices=(nowhere,)), "no ring position"),
        (Description(format="", path="", subdevices=(sub, sub)), "a second SubDevice"),
        (
            Description(
                format="",
                path="",
                subdevices=one.subdevices,
                copies=(copy((1, 3, 0), (0, 2, 0), 99),),
            ),
            "runs past the end",
        ),
        (
            Description(
                format="",
                path="",
                subdevices=one.subdevices,
                copies=(copy((1, 2, 0), (0, 2, 0), 8),),
            ),
            "no input",
        ),
        (
            Description(
                format="",
                path="",
                subdevices=(DescribedSubDevice(name="big", position=0, device=device(2, 3, 250)),),
            ),
            "one datagram",
        ),
    ):
        with pytest.raises(InputError, match=word):
            write_eni(wrong)
    with pytest.raises(InputError, match="header"):
        write_eni(one, header_bytes=4)


# -- only the copies ------------------------------------------------------------------------------

INFOS = re.compile(rb"\s*<CopyInfos>.*?</CopyInfos>", re.DOTALL)


def variants() -> dict[str, bytes]:
    text = write_eni(bus(3), header_bytes=10)
    indented = re.sub(r"^(?=<Cmd>|<State>|<DataL|<InputOffs|</Cmd>)", "    ", text, flags=re.M)
    latin = text.replace('"UTF-8"', '"ISO-8859-1"').replace("<Name>logic<", "<Name>L\u00f6gik<")
    return {
        "lines": text.encode(),
        "one line": text.replace("\n", "").encode(),
        "CRLF": text.replace("\n", "\r\n").encode(),
        "indented": indented.encode(),
        "latin-1": latin.replace("\u00e4", "ae").encode("latin-1"),
        "BOM": b"\xef\xbb\xbf" + text.encode(),
        "UTF-16": text.replace('"UTF-8"', '"UTF-16"').encode("utf-16"),
    }


@pytest.mark.parametrize("kind", variants())
def test_only_the_copies_change(kind: str):
    data = variants()[kind]
    images = back(data)
    rows = [bits for c in images.description.copies if (bits := images.bits_of(c)) is not None]
    kept = rows[:2]
    changed = replace_copies(data, kept, header_bits=images.header_bits)
    assert changed != data
    again = back(changed)
    assert [again.bits_of(c) for c in again.description.copies] == kept
    if kind != "UTF-16":
        assert INFOS.sub(b"", changed) == INFOS.sub(b"", data)
    if kind in ("CRLF",):
        assert b"\n" not in changed.replace(b"\r\n", b"")
    if kind == "one line":
        assert changed.count(b"\n") == 0


@pytest.mark.parametrize("kind", variants())
def test_taken_out_and_put_in_again(kind: str):
    data = variants()[kind]
    images = back(data)
    rows = [bits for c in images.description.copies if (bits := images.bits_of(c)) is not None]
    bare = replace_copies(data, [], header_bits=80)
    assert back(bare).description.copies == ()
    full = replace_copies(bare, rows, header_bits=80)
    assert set(back(full).description.copies) == set(images.description.copies)
    assert replace_copies(full, [], header_bits=80) == bare
    assert replace_copies(full, rows, header_bits=80) == full


def test_real_file_takes_copies_and_gives_them_up_again():
    data = need("eni", "kpierczy_test_eni.xml").read_bytes()
    images = back(data)
    wanted = copy((1, 3, 0), (2, 2, 16), 16)
    bits = images.bits_of(wanted)
    assert bits is not None
    changed = replace_copies(data, [bits], header_bits=images.header_bits)
    assert back(changed).description.copies == (wanted,)
    assert replace_copies(changed, [], header_bits=80) == data


def test_source_that_no_command_brings_is_refused():
    said = r"^no cyclic command of this ENI brings input bits 100000 to 100048$"
    with pytest.raises(InputError, match=said):
        replace_copies(write_eni(bus(1)).encode(), [(100_000, 0, 48)], header_bits=0)
    with pytest.raises(InputError, match="this ENI cannot be changed"):
        replace_copies(b"<a", [], header_bits=0)
