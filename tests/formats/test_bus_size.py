"""More SubDevices than EtherCAT addresses are refused; the work grows with them and no faster."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from described import bus
from formats.kinds import KINDS
from formats.startup import startup
from scans import scan_of, subdevice

from fsoe_net.formats.eni.write import write_eni
from fsoe_net.formats.own.answers import parse_answers
from fsoe_net.formats.own.library import builtin_library
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.own.scan import parse_scan
from fsoe_net.formats.recognise import find_format
from fsoe_net.formats.registry import Yields, read_foreign
from fsoe_net.formats.shared import ring
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.answers import Answers
from fsoe_net.model.resolve import resolve
from fsoe_net.proposal.draft import Inputs, make_draft
from fsoe_net.proposal.gather import gather
from fsoe_net.proposal.ring import list_types, ring_of

EXAMPLE = Path(__file__).parents[2] / "examples" / "estop" / "network.yaml"
FILES = {
    kind: text.encode()
    for kind, (text, _) in KINDS.items()
    if kind != "twincat_box"  # a part of a file
} | {"capture": startup()}


def _read(data: bytes):
    out = Collector()
    kind = find_format(data, out)
    assert kind is not None
    return kind, read_foreign(data, kind, out, name="file"), out.diagnostics


def test_addresses_have_sixteen_bits_and_none_is_zero() -> None:
    assert ring.MOST_SUBDEVICES == 0xFFFF


@pytest.mark.parametrize("name", FILES)
def test_one_more_than_a_bus_can_have(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    kind, found, _ = _read(FILES[name])
    assert found is not None
    last = found.subdevices[-1]
    monkeypatch.setattr(ring, "MOST_SUBDEVICES", len(found.subdevices))
    assert _read(FILES[name])[1] == found
    monkeypatch.setattr(ring, "MOST_SUBDEVICES", len(found.subdevices) - 1)
    _, refused, findings = _read(FILES[name])
    if kind.yields is not Yields.BUS:  # types and connections are on no bus yet
        assert refused == found
        return
    assert refused is None
    (finding,) = [d for d in findings if d.code == "FSN103"]
    assert finding.span == last.span
    assert finding.message.startswith(f"this is SubDevice {len(found.subdevices)}; ")


NETWORK = """\
version: 1
name: two
buses:
  - name: a
    cycle_us: 1000
    subdevices: [{name: a1, alias: 1, position: 0, config: io.yaml}]
  - name: b
    cycle_us: 1000
    subdevices:
      - {name: b1, alias: 1, position: 0, config: io.yaml}
      - {name: b2, alias: 1, position: 1, config: io.yaml}
nets: []
"""
IO = """\
vendor_id: 2
product_id: 3
rpdo: [{index: 0x1600, channels: [{index: 0x7000, sub_index: 1, type: uint8}]}]
"""


def test_each_bus_of_a_network_counts_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "network.yaml").write_text(NETWORK)
    (tmp_path / "io.yaml").write_text(IO)
    monkeypatch.setattr(ring, "MOST_SUBDEVICES", 2)
    assert load_network([tmp_path / "network.yaml"]).network is not None
    monkeypatch.setattr(ring, "MOST_SUBDEVICES", 1)
    found = load_network([tmp_path / "network.yaml"])
    assert found.network is None
    assert [d.span.line for d in found.diagnostics if d.code == "FSN103"] == [11]


def test_a_scan_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    network = load_network([EXAMPLE]).network
    assert network is not None
    document = scan_of(resolve(network)) | {"subdevices": [subdevice(0), subdevice(1)]}
    data = json.dumps(document, indent=1).encode()
    assert parse_scan(data, "scan.json")[0] is not None
    monkeypatch.setattr(ring, "MOST_SUBDEVICES", 1)
    found, (finding,) = parse_scan(data, "scan.json")
    assert (found, finding.code) == (None, "FSN103")
    second = data.index(b"{", data.index(b'"position": 0'))
    assert finding.span.line >= data.count(b"\n", 0, second)


def test_answers_of_a_user_count(monkeypatch: pytest.MonkeyPatch) -> None:
    out = Collector()
    text = b"subdevices:\n  - {type: EL1904, count: 2}\n  - {type: EL1904}\n"
    answers = parse_answers(text, "a.yaml", out)
    assert answers is not None
    library = builtin_library()
    monkeypatch.setattr(ring, "MOST_SUBDEVICES", 2)
    assert ring_of(answers.subdevices, list_types([], [], library, out), out) is None
    assert [(d.code, str(d.span)) for d in out.diagnostics] == [("FSN103", "a.yaml:3:5")]


def _calls(paths: list[Path]) -> int:
    """Return how many functions are called to propose a network and write it."""
    count = 0

    def called(_frame: object, event: str, _argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    files = [str(p) for p in paths]
    sys.setprofile(called)
    try:
        made = make_draft(Inputs.of(gather(files, LoadOptions())), Answers())
        made.files()
    finally:
        sys.setprofile(None)
    return count


@pytest.mark.weekly
def test_the_work_of_a_proposal_grows_with_the_bus(tmp_path: Path) -> None:
    sizes = {}
    for size in (100, 400):
        file = tmp_path / f"{size}.xml"
        file.write_text(write_eni(bus(size)))
        sizes[size] = _calls([file])
    assert sizes[400] < 4.2 * sizes[100]
