"""The pattern of the process data of safety logic, against files that were not made by it."""

from __future__ import annotations

import pytest
from networks import EXAMPLES

from fsoe_net.errors import PduSizeError
from fsoe_net.formats.own.library import builtin_library, parse_library_device
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.library import LibraryMapping, LibraryPattern, contradictions

LIBRARY = builtin_library()
FILE = """
name: X
about: x
role: main
identities: [{order: X, vendor_id: 1, product_code: 2}]
sources: {a: b}
mappings: []
connections:
  source: a
  most: 4
  step: 16
  outputs: {sm: 2, pdo: 0x1600, object: 0x7000, data: 0x7001}
  inputs: {sm: 3, pdo: 0x1a00, object: 0x6000, data: 0x6001}
"""


def _pattern(name: str) -> LibraryPattern:
    pattern = LIBRARY.named(name).connections
    assert pattern is not None
    return pattern


def _entries(mapping: LibraryMapping) -> list[list[tuple[int, int, int]]]:
    return [
        [(e.index, e.subindex, e.bits) for e in pdo.entries]
        for sm in mapping.sync_managers
        for pdo in sm.pdos
    ]


def test_the_pattern_gives_the_process_data_that_an_el6900_had() -> None:
    device = LIBRARY.named("EL6900")
    (there,) = device.mappings
    made = _pattern("EL6900").mapping([(6, 6)] * 6)
    assert _entries(made) == _entries(there)
    assert [(f.sm_index, f.byte_offset, f.frame_bytes, f.safe_bytes) for f in made.frames] == [
        (f.sm_index, f.byte_offset, f.frame_bytes, f.safe_bytes) for f in there.frames
    ]


def test_the_pattern_continues_the_connection_that_an_el1918_had() -> None:
    device = LIBRARY.named("EL1918")
    (there,) = (m for m in device.mappings if m.role == "main")
    to, back, *_ = (pdo for pdo in _entries(there) if pdo[0][0] < 0xF000 and len(pdo) > 1)
    first, second, first_back, second_back = _entries(_pattern("EL1918").mapping([(6, 6), (6, 6)]))
    assert (first, first_back) == (to, back)
    # The driver of linuxcnc-ethercat: 0x7080 + (n << 4), 0x6080 + (n << 4).
    assert [index for index, _, _ in second] == [0x7090, 0x7091, 0x7090, 0x7090]
    assert [index for index, _, _ in second_back] == [0x6090, 0x6091, 0x6090, 0x6090]


def test_the_pattern_gives_the_frames_of_the_example() -> None:
    network = load_network([str(EXAMPLES / "el6910" / "network.yaml")]).network
    assert network is not None
    (logic,) = (sub.device for sub in network.subdevices if sub.name == "el6910")
    there = [
        (p.entry.index, p.entry.subindex, p.entry.bits)
        for manager in logic.layout.managers
        for p in manager.placed
        if p.entry.index < 0xF000  # without the standard signals of the logic
    ]
    pairs = [(pair.taken_bytes, pair.sent_bytes) for pair in logic.layout.frame_pairs]
    assert pairs == [(6, 6), (6, 6), (31, 11), (31, 11)]
    made = _entries(_pattern("EL6910").mapping(pairs))
    assert [entry for pdo in made for entry in pdo] == there


@pytest.mark.parametrize("count", [1, 16])
def test_the_detector_finds_each_connection(count: int) -> None:
    device = LIBRARY.named("EL6910")
    lengths = [(6, 7), (11, 31), (15, 6), (7, 63)] * 4
    made = _pattern("EL6910").mapping(lengths[:count])
    layout = made.device(device.identities[0], "").layout
    assert [(p.taken_bytes, p.sent_bytes) for p in layout.frame_pairs] == lengths[:count]
    assert contradictions(device) == []


@pytest.mark.parametrize("lengths", [[], [(6, 6)] * 17])
def test_a_wrong_number_of_connections_is_rejected(lengths: list[tuple[int, int]]) -> None:
    with pytest.raises(ValueError, match="1 to 16 connections"):
        _pattern("EL6910").mapping(lengths)


@pytest.mark.parametrize("size", [0, 8, -7])
def test_a_length_that_fsoe_does_not_have_is_rejected(size: int) -> None:
    with pytest.raises(PduSizeError):
        _pattern("EL6910").mapping([(6, size)])


def test_a_pattern_of_a_file_is_checked() -> None:
    out = Collector()
    device = parse_library_device(FILE.encode(), "x.yaml", out)
    assert device is not None
    assert (device.connections.most, device.connections.outputs.pdo) == (4, 0x1600)
    for old, new, code in (
        ("source: a\n", "source: c\n", "FSN139"),
        ("most: 4", "most: 256", "FSN"),
        ("outputs: {sm: 2, pdo: 0x1600, object: 0x7000, data: 0x7001}", "outputs: 2", "FSN"),
        ("role: main", "role: main\nfunctions: [toaster]", "FSN"),
    ):
        out = Collector()
        assert parse_library_device(FILE.replace(old, new).encode(), "x.yaml", out) is None
        assert any(d.code.startswith(code) for d in out.diagnostics)
