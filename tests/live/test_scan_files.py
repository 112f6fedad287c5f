"""Files from a scan: what is read from them again is what is on the bus."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from networks import resolved
from scans import scan_of, subdevice

from fsoe_net.cli.live_bus import run_live_bus
from fsoe_net.cli.scan_output import scan_document
from fsoe_net.compare.bus_scan import check_scan
from fsoe_net.diag.diagnostic import Severity
from fsoe_net.document.write_terminal import document_text
from fsoe_net.errors import InputError
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.scan import load_scan, parse_scan
from fsoe_net.formats.shared.write_files import write_all
from fsoe_net.live.live_bus import BusOptions
from fsoe_net.live.scan import TakenScan
from fsoe_net.live.scan_files import ScanFiles, compact_json, scan_files
from fsoe_net.model.resolve import resolve
from fsoe_net.project.check import Checked, check_files, whole_network
from fsoe_net.rules.check import check

EXAMPLES = Path(__file__).parents[2] / "examples"


def write(folder: Path, files: ScanFiles, *, overwrite: bool = False) -> None:
    texts = {name: text.encode("utf-8") for name, text in files.texts.items()}
    write_all(folder, texts, overwrite=overwrite)


def taken(document: dict) -> TakenScan:
    scan, found = parse_scan(json.dumps(document).encode(), "scan.json")
    assert scan is not None, found
    return TakenScan(document=document, scan=scan)


def example(name: str):
    network = load_network([EXAMPLES / name / "network.yaml"]).network
    assert network is not None
    return resolve(network)


@pytest.mark.parametrize("name", ["estop", "el6910"])
def test_files_of_an_example_state_what_its_files_state(name: str, tmp_path: Path):
    original = example(name)
    document = scan_of(original)
    files = scan_files(taken(document))
    assert files.left_out == ()
    write(tmp_path / "bus", files)
    loaded = load_network([tmp_path / "bus" / "network.yaml"])
    bad = [d for d in loaded.diagnostics if d.level is not Severity.INFO]
    assert [d.code for d in bad] == ["FSN125"]  # the transfers are still to be written
    again = resolve(loaded.network)
    assert [s.position for s in again.network.subdevices] == [
        s.position for s in original.network.subdevices
    ]
    for old, new in zip(original.network.subdevices, again.network.subdevices, strict=True):
        used = [sm for sm in old.layout.managers if sm.placed]
        assert [
            [(p.bit_offset, p.entry.index, p.entry.subindex, p.entry.bits) for p in sm.placed]
            for sm in new.layout.managers
        ] == [
            [(p.bit_offset, p.entry.index, p.entry.subindex, p.entry.bits) for p in sm.placed]
            for sm in used
        ]
    scan, found = load_scan(tmp_path / "bus" / "scan.json")
    assert found == []
    assert check_scan(again, scan) == []


def test_scan_of_a_bus_without_fsoe_is_planned_and_runs(tmp_path: Path):
    cell = EXAMPLES / "robot-cell"
    path = tmp_path / "network.yaml"
    row = "subdevices:\n  - {name: el1008, position: 0, config: %s}\n"
    path.write_text(f"version: 1\n{row % (cell / 'devices' / 'el1008.yaml')}nets: []\n", "utf-8")
    write(tmp_path / "bus", scan_files(taken(scan_of(resolved(path)))))
    checked = check_files([str(tmp_path / "bus" / "network.yaml")])
    assert [(d.code, d.level) for d in checked.diagnostics] == [("FSN125", Severity.INFO)]
    resolution = whole_network(checked, "not run")
    options = BusOptions(backend="emulated", interface="none", cycle_ns=10_000_000)
    wanted = {"plan_file": None, "duration_ns": 50_000_000}
    result = run_live_bus(resolution, options, wanted, None)
    assert (result.passed, result.connections, result.statistics.copies) == (True, (), 0)
    assert result.statistics.cycles > 0


def test_frames_without_transfers_are_not_planned(tmp_path: Path):
    network = load_network([EXAMPLES / "estop" / "network.yaml"]).network
    assert network is not None
    resolution = resolve(replace(network, nets=()))
    with pytest.raises(InputError, match=r"^no plan: there are FSoE frames, and no transfers"):
        whole_network(Checked(resolution=resolution, diagnostics=[]), "no plan")


def test_devices_of_one_type_share_a_file():
    files = scan_files(taken(scan_of(example("el6910"))))
    assert sorted(p for p in files.texts if p.startswith("devices/")) == [
        "devices/circulo.yaml",
        "devices/el1904.yaml",
        "devices/el2904.yaml",
        "devices/el6910.yaml",
    ]
    assert "FSoE address 201" in files.texts["network.yaml"]


@pytest.mark.parametrize("name", ["estop", "el6910"])
def test_the_proposed_net_is_the_one_of_the_example(name: str, tmp_path: Path):
    original = example(name)
    files = scan_files(taken(scan_of(original)))
    text = files.texts["network.yaml"]
    head, _, proposal = text.partition("nets: []\n")
    nets = proposal[proposal.index("# nets:") :].replace("\n# ", "\n")[2:]
    texts = dict(files.texts) | {"network.yaml": head + nets}
    for path, content in texts.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(content, "utf-8")
    loaded = load_network([tmp_path / "network.yaml"])
    again = resolve(loaded.network)
    found = [*loaded.diagnostics, *check(again)]
    assert [d.message for d in found if d.level is Severity.ERROR] == []
    rows = [(c.main.position, c.sub.position, c.slot) for c in original.connections]
    assert [(c.main.position, c.sub.position, c.slot) for c in again.connections] == rows
    facts = [(c.facts.address, c.facts.connection_id) for c in original.connections]
    assert [(c.facts.address, c.facts.connection_id) for c in again.connections] == facts


def test_no_net_is_proposed_when_an_address_is_there_twice():
    document = scan_of(example("el6910"))
    document["subdevices"][5]["fsoe"]["address"] = 201
    text = scan_files(taken(document)).texts["network.yaml"]
    assert "sub: circulo" not in text
    assert "sub: el1904" in text


def test_existing_files_stay(tmp_path: Path):
    files = scan_files(taken(scan_of(example("estop"))))
    (tmp_path / "network.yaml").write_text("mine", "utf-8")
    with pytest.raises(InputError, match=r"network\.yaml exists"):
        write(tmp_path, files)
    assert [p.name for p in tmp_path.iterdir()] == ["network.yaml"]
    assert (tmp_path / "network.yaml").read_text("utf-8") == "mine"
    write(tmp_path, files, overwrite=True)
    assert (tmp_path / "network.yaml").read_text("utf-8") != "mine"


def sm(index: int, kind: str, *pdos: dict, size: int = 1) -> dict:
    return {"sm": index, "kind": kind, "bytes": size, "pdos": list(pdos)}


def pdo(index: int, *bits: int, padding: bool = False) -> dict:
    rows = [
        {"index": 0 if padding else 0x2000 + n, "subindex": 0 if padding else 1, "bits": b}
        for n, b in enumerate(bits)
    ]
    return {"index": index, "entries": rows}


@pytest.mark.parametrize(
    ("sms", "why"),
    [
        ([sm(2, "outputs", pdo(0x1600, 8)), sm(4, "outputs", pdo(0x1601, 8))], "2 sync managers"),
        ([sm(2, "outputs", pdo(0x1600, 256), size=32)], "has 256 bits"),
        ([sm(2, "outputs", pdo(0x1600))], "maps nothing"),
        ([sm(2, "outputs", {"index": 0x1600})], "mapping of PDO 0x1600 was not read"),
        ([{"sm": 2, "kind": "outputs", "bytes": 4}], "PDOs of SM2 were not read"),
    ],
)
def test_parts_that_the_format_lacks_are_left_out_and_reported(sms: list, why: str):
    row = subdevice(0, vendor_id=1, product_code=2, name="odd", sms=sms)
    document = {"scan": 1, "interface": "eth1", "subdevices": [row]}
    files = scan_files(taken(document))
    assert why in files.left_out[0]
    assert why in files.texts["network.yaml"]
    assert sorted(files.texts) == ["network.yaml", "scan.json"]


def test_a_sync_manager_read_by_half_is_left_out():
    row = subdevice(0, vendor_id=1, product_code=2, sms=[sm(2, "outputs", pdo(0x1600, 8))])
    row["sms"][0]["complete"] = False
    row["problems"] = ["SM2: the mapping of PDO 0x1600 cannot be read"]
    files = scan_files(taken({"scan": 1, "interface": "eth1", "subdevices": [row]}))
    assert "SM2 was not read completely" in files.left_out[0]


def test_an_empty_bus_and_long_padding():
    empty = {"scan": 1, "interface": "eth1", "subdevices": []}
    assert "subdevices: []" in scan_files(taken(empty)).texts["network.yaml"]
    long = sm(2, "outputs", pdo(0x1600, 1000, padding=True), pdo(0x1601, 8), size=126)
    row = subdevice(0, vendor_id=1, product_code=2, name="long", sms=[long])
    assert scan_files(taken(empty | {"subdevices": [row]})).left_out == ()


NAMES = st.text(st.characters(codec="utf-8", exclude_categories=["Cs", "Cc"]), max_size=12)


@given(st.lists(st.tuples(NAMES, st.lists(st.integers(1, 255), min_size=1)), max_size=4))
def test_any_name_and_any_lengths_read_back(devices: list[tuple[str, list[int]]]):
    rows = [
        subdevice(
            n,
            vendor_id=1,
            product_code=n,
            name=name,
            sms=[sm(3, "inputs", pdo(0x1A00, *bits), size=(sum(bits) + 7) // 8)],
        )
        for n, (name, bits) in enumerate(devices)
    ]
    document = {"scan": 1, "interface": "eth1", "subdevices": rows}
    assert scan_files(taken(document)).left_out == ()  # which reads them again and compares


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | NAMES,
        lambda inner: st.lists(inner) | st.dictionaries(NAMES, inner),
    )
)
def test_compact_json_is_json(value: object):
    assert json.loads(compact_json(value)) == value


ONE_BYTE = [{"index": 0x1600, "entries": [{"index": 0x7000, "subindex": 1, "bits": 8}]}]
OUTPUTS = {"sm": 2, "kind": "outputs", "start": 0x1000, "bytes": 1, "source": "coe"}
NOTHING = {"sm": 3, "kind": "inputs", "start": 0x1100, "bytes": 0, "source": "coe", "pdos": []}
NETWORK = """\
subdevices:
  - {name: a_1, position: 0, revision: 0x00000001, config: "devices/a.yaml"}
  - {name: a_2, position: 1, revision: 0x00000001, config: "devices/a.yaml"}
  - {name: a_2_2, position: 2, revision: 0x00000001, config: "devices/b.yaml"}
  # position 3: no name, vendor 0x00000000, product 0x00000000: not read
  # position 4: no name, an identity that could not be read: its identity was not read
"""
DEVICE = """\
# A, as it was found on the bus by `fsoe-net scan`. Types
# are not known from a bus: whole bytes are unsigned here, other lengths bits.
vendor_id: 0x00000002
product_id: 0x00000003

rpdo:
  - index: 0x1600
    channels:
      - {index: 0x7000, sub_index: 1, type: uint8}

sm:
  - {index: 2, type: output, pdo: rpdo, watchdog: enable}
  - {index: 3, type: input, watchdog: disable}
"""
TABLE = """\
pos  name     vendor      product     revision    state               out/in     FSoE  links
0    A        0x00000002  0x00000003  0x00000001  PREOP               SM2 1 / 0  -     xx
1    A        0x00000002  0x00000003  0x00000001  PREOP               SM2 1 / 0  -     xx
2    a_2 (B)  0x00000002  0x00000004  0x00000001  PREOP               SM2 1 / 0  -     xx
3             0x00000000  0x00000000  0x00000001  PREOP error 0x001e  -          -     xx
4             -           0x00000000  0x00000001  PREOP               SM2 1 / 0  -     xx

3: problem: AL status code 0x001e
4: problem: SII: not read
eth1: 5 SubDevices, brought to PREOP
"""


def test_a_bus_of_which_little_is_known():
    """Names that meet, an identity and sync managers that could not be read."""
    sms = [OUTPUTS | {"pdos": ONE_BYTE}]
    known = {"vendor_id": 2, "product_code": 3, "dc": False, "sms": [*sms, NOTHING]}
    rows = [
        subdevice(0, name="A", **known),
        subdevice(1, name="A", **known),
        subdevice(2, name="B", planned="a_2", vendor_id=2, product_code=4, sms=sms),
        subdevice(3, al_status=0x12, al_code=0x1E),
        subdevice(4, sms=sms, problems=["SII: not read"]),
    ]
    del rows[3]["sms"], rows[4]["vendor_id"]
    found = taken(scan_of(example("estop")) | {"subdevices": rows})
    files = scan_files(found)
    assert document_text(scan_document(found.scan)) == TABLE
    assert NETWORK in files.texts["network.yaml"]
    assert files.texts["devices/a.yaml"] == DEVICE
    assert files.left_out == (
        "position 3: no name, vendor 0x00000000, product 0x00000000: its sync managers were not "
        "read",
        "position 4: no name, an identity that could not be read: its identity was not read",
    )


def test_no_net_is_proposed_without_an_address():
    document = scan_of(example("estop"))
    (logic,) = [s for s in document["subdevices"] if s["fsoe"] and s["fsoe"]["connections"]]
    del logic["fsoe"]["connections"][0]["address"]
    assert scan_files(taken(document)).texts["network.yaml"].endswith("\nnets: []\n")


@pytest.mark.parametrize(
    ("what", "instead", "why"),
    [
        (
            "load_network",
            lambda _: SimpleNamespace(network=None),
            "the network of this scan cannot be read again; nothing was written",
        ),
        (
            "check_scan",
            lambda *_: [SimpleNamespace(code="FSN480", message="io is gone")],
            "the files of this scan do not say what is on the bus: io is gone; nothing was written",
        ),
    ],
)
def test_files_that_do_not_read_back_are_not_written(monkeypatch, what, instead, why):
    monkeypatch.setattr(f"fsoe_net.live.scan_files.{what}", instead)
    monkeypatch.setattr("fsoe_net.live.scan_files._COMPARED", {"FSN480"})
    with pytest.raises(InputError) as refused:
        scan_files(taken(scan_of(example("estop"))))
    assert str(refused.value) == why
