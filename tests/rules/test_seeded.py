"""Mistakes seeded into the robot cell: each is named where it stands, without a cascade."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from changed import figures
from networks import EXAMPLES

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.project.check import check_files

LOGIC = "devices/el6910.yaml"

# file, text, replacement, what must be found: exactly these codes that are not mere notes.
SEEDED = {
    "connection stated twice": ("network.yaml", "sub: drive_2,", "sub: drive_1,", {"FSN227"}),
    "standard entry instead of a CRC": (
        LOGIC,
        "{index: 0x7020, sub_index: 5, type: uint16}",
        "{index: 0xf788, sub_index: 0, type: uint16}",
        {"FSN212"},
    ),
    "CRC object repeated": (
        LOGIC,
        "{index: 0x7020, sub_index: 5, type: uint16}",
        "{index: 0x7020, sub_index: 6, type: uint16}",
        {"FSN212", "FSN408"},
    ),
    "PDO number in decimal": ("devices/circulo.yaml", "index: 0x1700", "index: 1700", {"FSN115"}),
    "entry in decimal": (
        "devices/circulo.yaml",
        "index: 0x6041",
        "index: 6041",
        {"FSN115", "FSN472"},  # it may be meant
    ),
    "safe data mapped twice": (
        LOGIC,
        "{index: 0x7031, sub_index: 2, type: uint16}",
        "{index: 0x7031, sub_index: 1, type: uint16}",
        {"FSN408"},
    ),
    "size too large": ("network.yaml", "size: 31   # drive 1", "size: 32   # drive 1", {"FSN209"}),
    "name used twice": ("network.yaml", "{name: drive_2,", "{name: drive_1,", {"FSN134"}),
    "transfers misspelt": ("network.yaml", "    transfers:", "    transferz:", {"FSN109"}),
    "wrong kind of file": ("network.yaml", "devices/el1904.yaml", "network.yaml", {"FSN140"}),
    "underscore in a number": (
        "network.yaml",
        "ec_module: el6910, index: 0x7030",
        "ec_module: el6910, index: 0x70_30",
        {"FSN112"},
    ),
    "exchanged slots": ("network.yaml", "index: 0x6020", "index: 0x6030", {"FSN225", "FSN204"}),
}


def seed(folder: Path, file: str, old: str, new: str) -> None:
    shutil.copytree(EXAMPLES / "el6910", folder, dirs_exist_ok=True)
    path = folder / file
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), "utf-8")


@pytest.mark.shows("R6")
@pytest.mark.parametrize("name", SEEDED)
def test_seeded_mistake_is_found(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    file, old, new, codes = SEEDED[name]
    seed(tmp_path, file, old, new)
    monkeypatch.chdir(tmp_path)
    found = [d for d in check_files(["network.yaml"]).diagnostics if d.level is not Severity.INFO]
    named = {d.code for d in found}
    assert named, name
    assert named <= codes, [f"{d.span} {d.code} {d.message}" for d in found]


def test_the_mend_of_a_number_keeps_all_digits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    seed(tmp_path, *SEEDED["underscore in a number"][:3])
    monkeypatch.chdir(tmp_path)
    (found,) = [d for d in check_files(["network.yaml"]).diagnostics if d.code == "FSN112"]
    assert found.hint is not None
    assert figures(found.hint) == "0x7030"


# Unusual, but right: nobody may be blamed.
VALID = {
    "names YAML would type": ("drive_1", "on"),
    "numbers as names": ("drive_2", "1.5"),
    "unicode": ("drive_1", "Achse_ä"),
}


@pytest.mark.shows("R6")
@pytest.mark.parametrize("name", VALID)
def test_valid_networks_are_not_blamed(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    old, new = VALID[name]
    shutil.copytree(EXAMPLES / "el6910", tmp_path, dirs_exist_ok=True)
    path = tmp_path / "network.yaml"
    path.write_text(path.read_text("utf-8").replace(old, new), "utf-8")
    monkeypatch.chdir(tmp_path)
    found = [d for d in check_files(["network.yaml"]).diagnostics if d.level is not Severity.INFO]
    assert found == []


def test_a_connection_stated_twice_is_said_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    seed(tmp_path, *SEEDED["connection stated twice"][:3])
    monkeypatch.chdir(tmp_path)
    (found,) = [d for d in check_files(["network.yaml"]).diagnostics if d.code == "FSN227"]
    assert figures(found.message) == "el6910-drive_1"
    assert found.related[0].span.line == found.span.line - 1


ESTOP = EXAMPLES / "estop"


def estop(folder: Path, *edits: tuple[str, str, str]) -> list[tuple[str, str, str]]:
    """Return code, message and hint of what is found in the E-stop cell with these edits."""
    shutil.copytree(ESTOP, folder / "cell", dirs_exist_ok=True)
    for file, old, new in edits:
        path = folder / "cell" / file
        text = path.read_text("utf-8")
        assert old in text
        path.write_text(text.replace(old, new), "utf-8")
    found = check_files([str(folder / "cell" / "network.yaml")]).diagnostics
    return [(d.code, d.message, d.hint) for d in found if d.level is not Severity.INFO]


def test_the_hint_for_a_wrong_main_is_not_the_wrong_name(tmp_path: Path):
    """The name is wrong at every transfer, so all transfers share it."""
    edit = ("network.yaml", "el1918", "el1981")
    keep = ("network.yaml", "name: el1981, position", "name: el1918, position")
    found = estop(tmp_path, edit, keep)
    (main,) = [row for row in found if row[0] == "FSN218"]
    assert tuple(map(figures, main)) == ("FSN218", "el1981", "el1918")
    assert "FSN219" not in {row[0] for row in found}


def test_an_unknown_end_is_not_also_in_a_wrong_net(tmp_path: Path):
    edit = ("network.yaml", "out: {ec_module: el1918,", "out: {ec_module: el19l8,")
    found = estop(tmp_path, edit)
    assert [row[0] for row in found] == ["FSN201"]


def repeated(file: Path, number: str) -> tuple[str, str, str]:
    """Return an edit that repeats the first PDO under a number."""
    lines = file.read_text("utf-8").splitlines(keepends=True)
    first = next(n for n, line in enumerate(lines) if line.startswith("  - index: 0x1a00"))
    end = next(n for n in range(first + 1, len(lines)) if not lines[n].startswith("    "))
    block = "".join(lines[first:end])
    return ("devices/ek1914.yaml", block, block + block.replace("0x1a00", number))


@pytest.mark.parametrize(("number", "code"), [("0x1a00", "FSN407"), ("0x1a05", "FSN408")])
def test_a_repeated_pdo_is_one_finding(number: str, code: str, tmp_path: Path):
    found = estop(tmp_path, repeated(ESTOP / "devices" / "ek1914.yaml", number))
    assert [row[0] for row in found if row[0] in ("FSN407", "FSN408")] == [code]
    if code == "FSN408":
        (row,) = [row for row in found if row[0] == "FSN408"]
        assert figures(row[1]) == "0x1a05 0x1a00"
