"""Several files for one network: which belong together, what is refused, where paths begin."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.options import LoadOptions

BASE = Path(__file__).parents[1] / "diagnostics" / "base"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(BASE, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def found(*paths: str, **options) -> list[tuple[str, str, str]]:
    result = load_network(paths, LoadOptions(**options))
    return [(str(d.span), d.code, d.message) for d in result.diagnostics]


def edit(path: Path, find: str, put: str) -> None:
    text = path.read_text("utf-8")
    assert find in text
    path.write_text(text.replace(find, put, 1), "utf-8")


@pytest.mark.parametrize("name", ["network.yaml", "robot.urdf"])
def test_a_second_network_is_refused(name: str, folder: Path):
    shutil.copy(folder / name, folder / f"second_{name}")
    rows = found(name, f"second_{name}")
    message = f"a second network; {name} already describes one"
    assert (f"second_{name}:1:1", "FSN117", message) in rows


def test_transfers_may_be_in_a_file_of_their_own(folder: Path):
    text = (folder / "network.yaml").read_text("utf-8")
    at, end = text.index("      - size: 1\n"), text.index("    connections:")
    (folder / "ring.yaml").write_text(text[:at] + text[end:], "utf-8")
    net = "nets:\n  - name: standard\n    safety_master: logic\n    transfers:\n"
    (folder / "copies.yaml").write_text(net + text[at:end], "utf-8")
    result = load_network(["ring.yaml", "copies.yaml"])
    assert result.diagnostics == ()
    assert result.network is not None
    nets = [(net.name, [t.size_bytes for t in net.transfers]) for net in result.network.nets]
    assert nets == [("safety", [6, 6, 6, 6]), ("standard", [1])]


def test_a_file_is_known_by_a_key_that_is_nearly_right(folder: Path):
    (folder / "odd.yaml").write_text("vendor_idd: 2\nproduct: 3\n", "utf-8")
    (row, *_) = found("odd.yaml")
    assert row == ("odd.yaml:1:1", "FSN109", "unknown key 'vendor_idd' at the top level")
    (folder / "odder.yaml").write_text("colour: red\nshape: round\n", "utf-8")
    (row,) = found("odder.yaml")
    assert row[:2] == ("odder.yaml:1:1", "FSN117")
    assert "colour, shape" in row[2]


def test_keys_of_every_yaml_do_not_make_a_network(folder: Path):
    (folder / "build.yaml").write_text("name: build\nversion: 2\njobs: []\n", "utf-8")
    (row,) = found("build.yaml")
    assert row[:2] == ("build.yaml:1:1", "FSN117")
    (folder / "begun.yaml").write_text("name: cell\nversion: 1\n", "utf-8")
    assert [row[2] for row in found("begun.yaml")] == [
        "the document has no 'nets'",
        "the document has no 'subdevices'",
    ]


OTHER = "not a network YAML or a URDF"
PROPOSES = "`fsoe-net init {}` proposes a network from it"


@pytest.mark.parametrize(
    ("name", "data", "message", "hint"),
    [
        ("a.bin", b"\x93\x94\0", f"this is probably an SII image, {OTHER}", PROPOSES),
        (
            "a.txt",
            b"SM0: PhysAddr 0x1\n",
            f"this is the output of `ethercat pdos`, {OTHER}",
            PROPOSES,
        ),
        (
            "a.c",
            b"ec_sync_info_t a[] = {\n",
            f"this is the output of `ethercat cstruct`, {OTHER}",
            PROPOSES,
        ),
        (
            "a.pcap",
            b"\xd4\xc3\xb2\xa1\2\0\4\0",
            f"this is a packet capture (pcap), {OTHER}",
            PROPOSES,
        ),
        (
            "a.zip",
            b"PK\3\4",
            f"this is a ZIP archive, {OTHER}",
            "unpack it, then name the files in it",
        ),
        (
            "a.fsnplan",
            b"FSNPLAN\0\xff",
            f"this is a compiled plan, {OTHER}",
            "name the network it was made from; `fsoe-net plan --show FILE` shows a plan",
        ),
        (
            "a.xml",
            b"<EtherCATConfig/>",
            "this is an ENI (EtherCAT network information), not a URDF or xacro",
            PROPOSES,
        ),
        (
            "a.xml",
            b"<a/>",
            "this is XML with the root <a>, not a URDF or xacro",
            "name a URDF or xacro",
        ),
        (
            "a.sdf",
            b"<sdf/>",
            "this is an SDF file, not a URDF or xacro",
            "name the URDF or xacro it was made from",
        ),
    ],
)
def test_a_file_of_another_tool_is_named_with_what_takes_it(name, data, message, hint, folder):
    (folder / name).write_bytes(data)
    (found,) = load_network([name]).diagnostics
    assert (str(found.span), found.code) == (f"{name}:1:1", "FSN117")
    assert (found.message, found.hint) == (message, hint.format(name))


@pytest.mark.parametrize("text", ["subdevices: [\n", "nets:\n\t- a\n", "a: \x01\n", "steps: {\n"])
def test_a_broken_file_of_its_own_is_not_taken_for_another(text, folder):
    (folder / "a.yaml").write_text(text, "utf-8")
    assert [row[1] for row in found("a.yaml")] == ["FSN102"]


def test_a_subdevice_without_a_place(folder: Path):
    edit(folder / "network.yaml", "name: io2, position: 1, ", "name: io2, ")
    rows = found("network.yaml")
    message = "subdevice io2 has neither position nor alias"
    assert rows[0] == ("network.yaml:6:5", "FSN110", message)


def test_a_subdevice_without_a_file(folder: Path):
    edit(folder / "network.yaml", ", config: devices/el6910.yaml", "")
    assert ("FSN110", "network.yaml:7:5") in {(code, at) for at, code, _ in found("network.yaml")}


@pytest.mark.parametrize("known", [True, False])
def test_a_package_is_where_the_option_states(known: bool, folder: Path):
    edit(folder / "network.yaml", "config: devices/el6910", "config: package://safety/el6910")
    packages = {"safety": str(folder / "devices")} if known else {}
    rows = found("network.yaml", packages=packages)
    assert [(at, code) for at, code, _ in rows] == (
        [] if known else [("network.yaml:7:40", "FSN133")]
    )


def test_a_path_may_begin_where_the_driver_starts(folder: Path):
    (folder / "config").mkdir()
    shutil.move(folder / "network.yaml", folder / "config")
    edit(
        folder / "config" / "network.yaml",
        "config: devices/el6910",
        "config: file://devices/el6910",
    )
    assert found("config/network.yaml") == []


@pytest.mark.parametrize("size", [-1, 1487])
def test_sizes_that_no_datagram_has(size: int, folder: Path):
    edit(folder / "network.yaml", "size: 6", f"size: {size}")
    message = f"size {size} is outside 0 … 1486 bytes (one EtherCAT datagram)"
    assert found("network.yaml")[0] == ("network.yaml:12:15", "FSN113", message)


@pytest.mark.parametrize("position", ["65536", "99999999999999999999"])
def test_positions_that_no_ring_has(position: str, folder: Path):
    edit(folder / "transfers.yaml", "alias: 0, position: 0", f"alias: 0, position: {position}")
    message = f"position {position} is outside 0 … 65535"
    assert found("transfers.yaml")[0] == ("transfers.yaml:4:38", "FSN113", message)
