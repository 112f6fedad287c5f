"""Values of a slave YAML are read as yaml-cpp reads them, which is what the ROS 2 driver uses.

``yaml_cpp.tsv`` was recorded with yaml-cpp 0.7.0 by ``yaml_cpp_probe.cpp``; where the library is
installed (``libyaml-cpp-dev``, ``g++``), the table is recorded again and compared.
"""

from __future__ import annotations

import math
import shutil
import subprocess
from pathlib import Path

import pytest

from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.slave_yaml import device_from_yaml
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.numbers import Reader, read_flag, read_float, read_int
from fsoe_net.formats.shared.yaml_tree import ScalarNode, parse_yaml

HERE = Path(__file__).parent
TABLE = HERE / "yaml_cpp.tsv"
ROWS = [line.split("\t") for line in TABLE.read_text("utf-8").splitlines()[1:]]
NAMES = [row[0] or "nothing" for row in ROWS]
STRICTER = {"010", "-010", "+010", "08"}  # other readers take another number: FSN114


def node_of(spelling: str) -> ScalarNode:
    root = parse_yaml(f"key: {spelling}\n".encode(), "f.yaml", Collector())
    assert root is not None
    node = root.get("key")
    assert isinstance(node, ScalarNode)
    return node


@pytest.fixture(scope="session")
def probe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("g++")
    if compiler is None or not Path("/usr/include/yaml-cpp/yaml.h").is_file():
        pytest.skip("needs g++ and yaml-cpp (package libyaml-cpp-dev of Debian)")
    program = tmp_path_factory.mktemp("probe") / "probe"
    source = HERE / "yaml_cpp_probe.cpp"
    words = [compiler, "-std=c++17", str(source), "-lyaml-cpp", "-o", str(program)]
    subprocess.run(words, check=True)
    return program


def test_the_table_is_what_this_yaml_cpp_reads(probe: Path):
    values = "".join(f"{row[0]}\n" for row in ROWS)
    said = subprocess.run([probe], input=values, capture_output=True, text=True, check=True).stdout
    assert [line.split("\t") for line in said.splitlines()] == ROWS


@pytest.mark.parametrize("row", ROWS, ids=NAMES)
@pytest.mark.parametrize(("column", "low", "high"), [(2, -(2**31), 2**31 - 1), (3, 0, 255)])
def test_an_integer_is_what_yaml_cpp_reads(row: list[str], column: int, low: int, high: int):
    out, node = Collector(), node_of(row[0])
    value = read_int(node, out, what="value", low=low, high=high, reader=Reader.SLAVE)
    if node.is_null:
        assert row[column] == "throws"  # the schema refuses it
    elif row[0] in STRICTER:
        assert out.diagnostics
    elif row[column] == "throws":
        assert value is None
        assert out.diagnostics
    else:
        assert (value, out.diagnostics) == (int(row[column]), [])


@pytest.mark.parametrize("row", ROWS, ids=NAMES)
def test_a_number_is_what_yaml_cpp_reads(row: list[str]):
    out, node = Collector(), node_of(row[0])
    value = read_float(node, out, what="factor")
    if row[4] == "throws":
        assert value is None
        assert node.is_null or out.diagnostics
    else:
        assert out.diagnostics == []
        assert value is not None
        assert math.isclose(value, float(row[4]), rel_tol=1e-5) or math.isnan(float(row[4]))
        assert math.isnan(value) is math.isnan(float(row[4]))


@pytest.mark.parametrize("row", ROWS, ids=NAMES)
def test_a_boolean_is_what_yaml_cpp_reads(row: list[str]):
    out, node = Collector(), node_of(row[0])
    value = read_flag(node, out, what="skip")
    if row[5] == "throws":
        assert node.is_null or out.diagnostics
    else:
        assert (str(value).lower(), out.diagnostics) == (row[5], [])


# What `--runtime` says of a code, as yaml-cpp does it: "TEXT ROWS" at a path of the document.
NET = "nets: [{name: a, safety_master: %s, transfers: []}]\n"
NETS = "nets:\n  - {name: a, transfers: []}\n"
STATEMENTS = [
    ("FSN105", NETS + "---\n" + NETS.replace("name: a", "name: b"), "nets 0 name", "a 0"),
    ("FSN106", NETS.replace("name: a", "name: a, name: b"), "nets 0 name", "a 0"),
    ("FSN107", "nets: [{<<: {name: a}, transfers: []}]\n", "nets 0 name", "throws 0"),
    ("FSN108", "\u00a0" + NETS, "nets", "throws 0"),
    ("FSN110", NETS.replace("name: a, ", ""), "nets 0 name", "throws 0"),
    ("FSN111", NET % "[logic]", "nets 0 safety_master", "throws 1"),
    ("FSN111", NET % "{name: logic}", "nets 0 safety_master", "throws 1"),
    ("FSN111", "nets: {name: a}\n", "nets 0 name", "throws"),
    ("FSN111", "nets: [abc]\n", "nets 0 name", "throws"),
    ("FSN451", NET % "~", "nets 0 safety_master", "null 0"),
    ("FSN451", NET % "", "nets 0 safety_master", "null 0"),
    ("FSN451", "nets: ~\n", "nets", "null 0"),
    ("FSN451", "nets: abc\n", "nets", "abc 0"),
    ("FSN451", NETS.replace("[]", "~"), "nets 0 transfers", "null 0"),
]


@pytest.mark.parametrize(("code", "text", "path", "read"), STATEMENTS)
def test_yaml_cpp_reads_a_document_as_its_runtime_is_described(
    probe: Path, tmp_path: Path, code: str, text: str, path: str, read: str
):
    words = [probe, *path.split()]
    said = subprocess.run(words, input=text, capture_output=True, text=True, check=True).stdout
    assert said.strip() == read
    file = tmp_path / "transfers.yaml"
    file.write_text(text, "utf-8")
    assert code in [d.code for d in load_network([file]).diagnostics]


CHANNEL = """\
vendor_id: 1
product_id: 2
rpdo:
  - index: 0x1600
    channels:
      - index: 0x7000
        sub_index: 1
        type: uint16
        {key}: {value}
"""


@pytest.mark.parametrize("row", ROWS, ids=NAMES)
def test_an_interface_is_the_text_that_yaml_cpp_reads(row: list[str]):
    out = Collector()
    text = CHANNEL.format(key="command_interface", value=row[0])
    root = parse_yaml(text.encode(), "f.yaml", out)
    assert root is not None
    device = device_from_yaml(root, "f.yaml", out)
    assert device is not None
    name = device.rpdos[0].entries[0].command_interface
    assert out.diagnostics == []
    assert name == (None if row[1] == "null" else row[1])  # of which no joint has an interface


def test_an_empty_type_of_a_channel_is_the_text_null():
    out = Collector()
    text = CHANNEL.format(key="mask", value="1").replace("type: uint16", "type: ~")
    root = parse_yaml(text.encode(), "f.yaml", out)
    assert root is not None
    device_from_yaml(root, "f.yaml", out)
    assert [(d.code, d.span.line) for d in out.diagnostics] == [("FSN451", 8)]


@pytest.mark.parametrize("key", ["default", "factor", "offset", "mask", "skip"])
@pytest.mark.parametrize("value", ["~", "", "null"])
def test_an_empty_number_or_boolean_is_an_error(key: str, value: str):
    assert {row[0]: row[2:] for row in ROWS}[value] == ["throws"] * 4
    out = Collector()
    root = parse_yaml(CHANNEL.format(key=key, value=value).encode(), "f.yaml", out)
    assert root is not None
    device_from_yaml(root, "f.yaml", out)
    kind = "true or false" if key == "skip" else "a whole number" if key == "mask" else "a number"
    assert [d.code for d in out.diagnostics] == ["FSN111"]
    assert [d.message for d in out.diagnostics] == [
        f"rpdo 1, channels 1, {key} must be {kind}, it is empty"
    ]
