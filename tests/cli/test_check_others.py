"""`fsoe-net check NETWORK OTHER…` as a user calls it."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import pytest
from bench.big_esi import write_big_esi
from cli.tool import fsn
from data_files import need
from networks import EXAMPLES

BASE = Path(__file__).parents[1] / "diagnostics" / "base"
ESTOP = EXAMPLES / "estop" / "network.yaml"


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    return Path(shutil.copytree(BASE, tmp_path / "cell"))


def edit(path: Path, find: str, put: str) -> None:
    text = path.read_text("utf-8")
    assert find in text
    path.write_text(text.replace(find, put), "utf-8")


def found(folder: Path, *files: str) -> list[dict]:
    done = fsn("check", *files, "--format", "json", cwd=folder)
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout)["diagnostics"]


def codes(folder: Path, *files: str) -> list[str]:
    return [d["code"] for d in found(folder, *files) if d["severity"] != "info"]


def test_files_that_agree(cell: Path):
    others = ["cell.eni.xml", "coupler.xml", "safety.xml", "slaves.txt"]
    done = fsn("check", "network.yaml", *others, cwd=cell)
    assert (done.returncode, done.stderr) == (0, "")
    assert ": 3 SubDevices, 2 FSoE connections" in done.stdout
    assert "no findings" not in done.stdout  # a note is one
    assert "compared with 4 other files; 2 notes\n" in done.stdout
    assert "Beckhoff" not in done.stdout
    quiet = fsn("check", "-q", "network.yaml", *others, cwd=cell)
    assert (quiet.returncode, quiet.stdout) == (0, "")


def test_order_of_the_files_does_not_matter(cell: Path):
    edit(cell / "safety.xml", "<ConId>10<", "<ConId>12<")
    assert codes(cell, "network.yaml", "safety.xml") == ["FSN446"]
    assert codes(cell, "safety.xml", "network.yaml") == ["FSN446"]


def test_place_in_both_files(cell: Path):
    edit(
        cell / "coupler.xml",
        "<Index>#x7001</Index><SubIndex>2<",
        "<Index>#x7001</Index><SubIndex>5<",
    )
    one = next(d for d in found(cell, "network.yaml", "coupler.xml") if d["code"] == "FSN436")
    assert (one["file"], one["line"]) == ("devices/ek1914.yaml", 9)
    assert [r["file"] for r in one["related"]] == ["coupler.xml"]
    assert "io and 1 more: entry 3 of PDO 0x1600" in one["message"]
    assert "(revision 0x00120000)" in one["message"]


def test_a_network_of_two_files_and_a_urdf(cell: Path):
    assert codes(cell, "robot.urdf", "coupler.xml") == []
    edit(cell / "coupler.xml", "<BitLen>14<", "<BitLen>6<")
    assert codes(cell, "robot.urdf", "coupler.xml") == ["FSN435"]
    assert codes(cell, "devices/ek1914.yaml", "coupler.xml") == ["FSN435"]


def test_older_revision_of_an_esi_is_said_at_the_users_place(cell: Path):
    edit(cell / "network.yaml", "{name: io, position: 0,", "{name: io, position: 0, revision: 1,")
    one = found(cell, "network.yaml", "coupler.xml")
    bad = [(d["code"], d["file"]) for d in one if d["severity"] != "info"]
    assert bad == [("FSN432", "network.yaml")]


def test_reference_that_is_cut_off(cell: Path):
    text = (cell / "cell.eni.xml").read_text("utf-8")
    (cell / "cell.eni.xml").write_text(text[: len(text) // 2], "utf-8")
    assert codes(cell, "network.yaml", "cell.eni.xml") == ["FSN118"]
    cut = (cell / "pdos.txt").read_text("utf-8").splitlines()[:5]
    (cell / "pdos.txt").write_text("\n".join([*cut, "    PDO entry 0x70"]), "utf-8")
    assert set(codes(cell, "network.yaml", "pdos.txt")) <= {"FSN146", "FSN443"}


def test_eni_of_another_machine_and_empty_safety_project(cell: Path):
    assert codes(cell, "network.yaml", "bus.eni.xml") == ["FSN443"]
    (cell / "safety.xml").write_text("<Project><Connections/></Project>", "utf-8")
    assert codes(cell, "network.yaml", "safety.xml") == ["FSN443"]


def test_files_that_are_nothing(cell: Path):
    (cell / "empty.xml").write_bytes(b"")
    (cell / "noise.bin").write_bytes(bytes(range(256)) * 40)
    (cell / "page.html").write_text("<html><body>ESI</body></html>", "utf-8")
    for name in ("empty.xml", "noise.bin", "page.html", "nowhere.xml"):
        one = [d for d in found(cell, "network.yaml", name) if d["severity"] == "error"]
        assert one, name
        assert all(d["file"] == name for d in one), one


def test_report_names_what_the_network_was_compared_with(cell: Path):
    done = fsn("report", "network.yaml", "safety.xml", "coupler.xml", "-o", "page.html", cwd=cell)
    assert done.returncode == 0, done.stderr
    page = (cell / "page.html").read_text("utf-8")
    compared = page.split("<h3>Compared with</h3>")[1]
    for name in ("safety.xml", "coupler.xml"):
        assert hashlib.sha256((cell / name).read_bytes()).hexdigest() in compared
    assert fsn("report", "network.yaml", "-o", "page.html", "--overwrite", cwd=cell).returncode == 0
    assert "Compared with" not in (cell / "page.html").read_text("utf-8")
    edit(cell / "safety.xml", "<ConId>10<", "<ConId>12<")
    done = fsn("report", "network.yaml", "safety.xml", "-o", "bad.html", cwd=cell)
    assert done.returncode == 1
    assert "FSN446" in done.stderr
    page = (cell / "bad.html").read_text("utf-8")
    assert page.index("NOT ACCEPTABLE: 1 error") < page.index("FSN446")


def test_only_other_files_are_not_network(cell: Path):
    done = fsn("check", "cell.eni.xml", cwd=cell)
    assert done.returncode == 1
    assert "nothing checked" in done.stdout


def test_of_a_big_esi_only_the_wanted_device_is_read(tmp_path: Path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    write_big_esi(tmp_path / "big.xml", 3_000_000)
    (tmp_path / "d.yaml").write_text(
        "vendor_id: 0x00000a5f\nproduct_id: 0x00000003\nrpdo:\n  - index: 0x1777\n    channels:\n"
        "      - {index: 0x7000, sub_index: 1, type: uint8}\n",
        "utf-8",
    )
    assert set(codes(tmp_path, "d.yaml", "big.xml")) == {"FSN433", "FSN437"}


def test_published_estop_files_against_text_of_an_ep1918():
    """The text is of a relative of the EL1918: the same PDOs, other objects."""
    text = need("igh", "igh_pdos_EP1918.txt")
    logic = need("yaml", "yguel_safety-humble_beckhoff_el1918.yaml")
    done = fsn("check", str(logic), str(text), "--format", "json")
    rows = json.loads(done.stdout)["diagnostics"]
    bad = [d for d in rows if d["severity"] != "info"]
    assert [d["code"] for d in bad] == ["FSN434", "FSN434"]
    assert all("0x6040:01" in d["message"] or "0x7040:01" in d["message"] for d in bad)


def test_published_files_of_other_machines_are_one_line_each():
    others = [
        need("eni", "kpierczy_test_eni.xml"),
        need("esi", "kickcat_ecat402-drive.xml"),
        need("sii", "ethercrab_el2262.bin"),
        need("yaml", "mikekaram_ethercat_slaves.yaml"),
    ]
    done = fsn("check", str(ESTOP), *map(str, others), "--format", "json")
    rows = [d for d in json.loads(done.stdout)["diagnostics"] if d["code"] != "FSN449"]
    assert [d["code"] for d in rows] == ["FSN443"] * len(others)


LONG = "x" * 3_000_000


@pytest.mark.shows("R26")
@pytest.mark.parametrize("form", ["text", "json", "sarif", "github"])
@pytest.mark.parametrize(
    ("find", "put"),
    [
        ("cycle_us: 1000", f"cycle_us: {LONG}"),
        ("in: {ec_module: ek1914,", f"in: {{ec_module: {LONG},"),
        ("devices/ek1914.yaml", LONG),
        ("cycle_us: 1000", f"cycle_us: *{LONG}"),
    ],
    ids=["number", "name", "path", "anchor"],
)
def test_a_value_of_any_length_is_shown_in_part(
    find: str, put: str, form: str, tmp_path: Path
) -> None:
    folder = Path(shutil.copytree(ESTOP.parent, tmp_path / "cell"))
    edit(folder / "network.yaml", find, put)
    done = fsn("check", "network.yaml", "--format", form, cwd=folder)
    assert done.returncode == 1
    shown = done.stdout + done.stderr
    assert len(shown) < 30_000
    assert " characters) … xxx" in shown or "characters) \\u2026 xxx" in shown
