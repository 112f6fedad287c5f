"""Every device of the library is read, and is what it says."""

from __future__ import annotations

from pathlib import Path

import pytest
from model.fsoe_table import rows

import fsoe_net
from fsoe_net.formats.own.json_schema import read_schema
from fsoe_net.formats.own.library import builtin_library, load_library, parse_library_device
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.bus import Direction

FOLDER = Path(fsoe_net.__file__).parent / "devices"
FILES = sorted(p.name for p in FOLDER.glob("*.yaml"))

OWN = """\
name: Drive
about: a drive of our own
identities:
  - {order: D1, vendor_id: 0x00000999, product_code: 0x00000001}
sources: {file: written for this test}
mappings:
  - name: map
    role: sub
    source: file
    sync_managers:
      - sm: 2
        direction: output
        first_byte: 2
        pdos:
          - {index: 0x1700, entries: "6770:01/8 6640:00/1 -/1x7 6770:03/16 6770:02/16"}
          - {index: 0x1701, entries: "2000:00/16"}
      - sm: 3
        direction: input
        pdos:
          - {index: 0x1b00, entries: "6760:01/8 6641:01-08/1 6760:03/16 6760:02/16"}
    frames:
      - {sm: 2, byte: 2, frame_bytes: 6, safe_bytes: 1}
      - {sm: 3, byte: 0, frame_bytes: 6, safe_bytes: 1}
    restart_relevant: ["2000:00"]
figures:
  - {name: input_time_ms, value: 4.5, source: file, unverified: true}
"""


def read(text: str) -> tuple[object, list[str]]:
    out = Collector()
    device = parse_library_device(text.encode(), "own.yaml", out)
    return device, [f"{d.code} {d.span.line} {d.message}" for d in out.diagnostics]


def test_each_word_of_a_list_is_checked():
    device, found = read(f"functions: [lamp, drive]\n{OWN}")
    assert (device, len(found)) == (None, 1)
    assert found[0].startswith("FSN116 1 functions 1 is 'lamp'; allowed: ")


@pytest.mark.parametrize("name", FILES)
def test_each_device_of_the_package_is_what_it_states(name):
    out = Collector()
    device = parse_library_device((FOLDER / name).read_bytes(), name, out)
    assert [str(d) for d in out.diagnostics] == []
    for mapping in device.mappings:
        layout = mapping.device(device.identities[0], "").layout
        found = {
            (b.sm_index, b.byte_offset, b.frame_bytes, b.safe_bytes)
            for sm in layout.managers
            for b in sm.blocks
        }
        stated = {(f.sm_index, f.byte_offset, f.frame_bytes, f.safe_bytes) for f in mapping.frames}
        assert found == stated
        assert len(stated) >= 2


def test_the_library_holds_every_row_of_the_table_of_process_data():
    held = {
        (sm.direction, tuple((e.index, e.subindex, e.bits) for e in pdo.entries))
        for device in builtin_library().devices
        for mapping in device.mappings
        for sm in mapping.sync_managers
        for pdo in sm.pdos
    }
    for row in rows():
        entries = tuple((e.index, e.subindex, e.bits) for e in row.pdo.entries)
        assert (row.direction, entries) in held, row.device


def test_no_identity_and_no_name_is_there_twice():
    devices = builtin_library().devices
    identities = [(i.vendor_id, i.product_code) for d in devices for i in d.identities]
    assert len(set(identities)) == len(identities)
    assert len({d.name for d in devices}) == len(devices) == len(FILES)


def test_a_device_is_found_by_identity_and_by_name():
    library = builtin_library()
    assert library.find(2, 0x077E3052).name == "EL1918"
    assert library.find(2, 0x16AE6012).name == "AX5805"
    assert library.named("el6900").mappings[0].slots == 6
    assert library.find(2, 1) is None
    assert library.named("EL9999") is None


def test_a_device_whose_project_makes_its_process_data():
    device = builtin_library().named("EL6910")
    assert (device.mappings, device.roles) == ((), ("main",))
    bare = OWN.split("mappings:")[0] + "mappings: []\n"
    for text in (bare, OWN + "role: sub\n"):
        assert [line.split()[0] for line in read(text)[1]] == ["FSN139"]
    device, found = read(bare + "role: sub\n")
    assert (found, device.roles) == ([], ("sub",))


def test_a_revision_picks_the_mapping():
    first, second, _ = builtin_library().named("EL1918").mappings
    assert (first.fits(0x00100000), second.fits(0x00100000)) == (True, False)
    assert (first.fits(0x00120000), second.fits(0x00120000)) == (False, True)
    assert first.fits(None)


def test_a_device_of_the_users_own():
    device, found = read(OWN)
    assert found == []
    manager = device.mappings[0].sync_managers[0]
    assert manager.direction is Direction.OUTPUT
    assert [p.bits for p in manager.pdos] == [16, 48, 16]
    assert device.figures[0].value == 4.5


@pytest.mark.parametrize(
    ("old", "new", "code", "words"),
    [
        (
            "frame_bytes: 6, safe_bytes: 1}\n      - {sm: 3",
            "frame_bytes: 7, safe_bytes: 2}\n      - {sm: 3",
            "FSN139",
            "6 by entry",
        ),
        ("safe_bytes: 1}\n    restart", "safe_bytes: 2}\n    restart", "FSN139", "2 safe bytes"),
        ("byte: 2, frame", "byte: 1, frame", "FSN139", "none there"),
        ("      - {sm: 3, byte: 0, frame_bytes: 6, safe_bytes: 1}\n", "", "FSN139", "not stated"),
        ('"6760:01/8', '"6790:01/8', "FSN139", "none there"),
        ("source: file\n    sync", "source: book\n    sync", "FSN139", "'book'"),
        ('["2000:00"]', '["6640:00"]', "FSN139", "not a standard output"),
        (
            '"6760:01/8 6641:01-08/1 6760:03/16 6760:02/16"',
            '"6900:01/8 6641:01-08/1 6900:03/16 6900:02/16"',
            "FSN139",
            "other direction",
        ),
        ("2000:00/16", "2000:00-FF/1x99", "FSN141", "more than 4096"),
        ('["2000:00"]', '["2000"]', "FSN141", "no address"),
        ("2000:00/16", "2000:0/16", "FSN141", "'2000:0/16'"),
        ("unverified: true", "unverified: false", "FSN116", "never verified"),
        ("role: sub", "role: slave", "FSN116", "'slave'"),
        ("role: sub", "rolle: sub", "FSN109", "'rolle'"),
        ("product_code: 0x00000001", "product_code: 0x1ffffffff", "FSN113", "outside"),
    ],
)
def test_a_contradiction_is_named_with_its_place(old, new, code, words):
    assert OWN.count(old) == 1
    device, found = read(OWN.replace(old, new))
    assert device is None
    hits = [f for f in found if f.startswith(code) and words in f]
    assert hits, found
    assert " 0 " not in hits[0][:9]


def test_two_mappings_of_one_name_are_refused():
    start, end = OWN.index("  - name: map"), OWN.index("figures:")
    device, found = read(OWN[:end] + OWN[start:end] + OWN[end:])
    assert device is None
    assert any("'map' is there twice" in f for f in found)


def test_own_files_are_before_the_library(tmp_path):
    own = tmp_path / "own.yaml"
    own.write_text(OWN.replace("0x00000999", "2").replace("0x00000001", "0x07703052"), "utf-8")
    library, found = load_library([own, tmp_path / "none.yaml"])
    assert [d.code for d in found] == ["FSN101"]
    assert library.find(2, 0x07703052).name == "Drive"
    assert library.named("EL1904") is None
    assert library.named("EL2904") is not None


def test_the_schema_has_what_the_files_use():
    assert set(read_schema("device")["required"]) <= set(read_schema("device")["properties"])


def test_each_device_is_found_by_its_product_code_alone():
    for device in builtin_library().devices:
        for identity in device.identities:
            few = builtin_library(frozenset((identity.product_code,)))
            assert few.find(identity.vendor_id, identity.product_code) == device
    assert builtin_library(frozenset()).devices == ()
