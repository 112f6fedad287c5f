"""`fsoe-net diff` as a user and as CI call it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from cli.tool import fsn
from data_files import listed, need
from described import bus
from networks import EXAMPLES, example
from scans import scan_of

from fsoe_net.formats.eni.write import write_eni

ESTOP = str(EXAMPLES / "estop" / "network.yaml")


@pytest.fixture
def other(tmp_path: Path) -> Path:
    folder = shutil.copytree(EXAMPLES / "estop", tmp_path / "estop")
    file = Path(folder) / "network.yaml"
    file.write_text(file.read_text("utf-8").replace("address: 14", "address: 15"), "utf-8")
    return file


def test_same_is_0_and_is_reported(tmp_path: Path):
    plan = str(tmp_path / "estop.fsnplan")
    assert fsn("plan", ESTOP, "-o", plan).returncode == 0
    done = fsn("diff", ESTOP, plan)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("no difference\n")


def test_a_difference_is_1_as_text_json_and_silently(other: Path):
    done = fsn("diff", ESTOP, str(other))
    assert done.returncode == 1
    assert "~ connection el1918 - ek1914 changed: address 14 -> 15\n1 difference\n" in done.stdout
    done = fsn("diff", ESTOP, str(other), "--format", "json")
    document = json.loads(done.stdout)
    assert (done.returncode, document["same"]) == (1, False)
    assert document["changes"] == [
        {
            "kind": "changed",
            "area": "connection",
            "where": "el1918 - ek1914",
            "what": "address",
            "before": 14,
            "after": 15,
            "entries": [],
            "subdevices": ["el1918", "ek1914"],
        }
    ]
    done = fsn("diff", "-q", ESTOP, str(other))
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "")


def test_each_kind_of_file_is_known_by_its_content(tmp_path: Path):
    scan = tmp_path / "a"
    scan.write_text(json.dumps(scan_of(example("estop"))), "utf-8")
    assert "(scan)" in fsn("diff", ESTOP, str(scan)).stdout
    eni = tmp_path / "b"
    eni.write_text(write_eni(bus(3)), "utf-8")
    done = fsn("diff", str(eni), str(eni))
    assert (done.returncode, "(eni)" in done.stdout) == (0, True)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no such file"),
        (b"", "an empty file"),
        (b"FSNPLAN\0cut off", "FSN101"),
        (b"{}", "FSN110"),
        (b"<EtherCATConfig><Config>", "FSN118"),
        (b"<other/>", "FSN1"),
        (b"\0\0\0\0\1\2", "FSN138"),
        (b"version: 1\nsubdevices: 4\n", "FSN11"),
    ],
)
def test_unreadable_input_exits_with_1_and_a_reason(tmp_path: Path, content, words):
    file = tmp_path / "file"
    if content is not None:
        file.write_bytes(content)
    done = fsn("diff", ESTOP, str(file))
    assert done.returncode == 1
    assert done.stdout == ""
    assert f"error: {file} cannot be compared" in done.stderr
    assert words in done.stderr


@pytest.mark.parametrize("name", listed("igh", "*.txt"))
def test_pasted_text_is_the_same_as_itself(name):
    file = str(need("igh", name))
    assert fsn("diff", file, file).returncode == 0
