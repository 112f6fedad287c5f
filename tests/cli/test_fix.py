"""`check --fix`: what has one way is fixed, shown first; nothing else in the file changes."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from cli.tool import fsn
from networks import EXAMPLES

from fsoe_net.cli import check
from fsoe_net.cli.main import main
from fsoe_net.diag.diagnostic import Edit, Span
from fsoe_net.errors import InputError
from fsoe_net.formats.own.patch import patch_yaml

BROKEN = EXAMPLES / "broken"
GOOD = {
    "01_direction": ("out: {ec_module: ek1914, index: 0x6000", "in: {ec_module: ek1914"),
    "02_wrong_index": ("index: 0x6001, subindex: 3", "index: 0x6000, subindex: 1"),
    "04_size": ("- size: 7   # safe outputs", "- size: 6   # safe outputs"),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    return tmp_path / "examples" / "broken"


@pytest.mark.parametrize("name", GOOD)
def test_it_is_shown_and_only_written_with_yes(name: str, folder: Path):
    path = folder / f"{name}.yaml"
    before = path.read_text("utf-8")
    shown = fsn("check", path.name, "--fix", cwd=folder)
    assert shown.returncode == 1
    assert "\n1 finding of 1 would be fixed\nnot written; --yes writes it\n" in shown.stdout
    assert path.read_text("utf-8") == before
    done = fsn("check", path.name, "--fix", "--yes", cwd=folder)
    assert done.returncode == 0, done.stdout
    assert f"\nwritten: {path.name}\nestop: no findings" in done.stdout
    after = path.read_text("utf-8")
    old, new = GOOD[name]
    assert old in before
    assert new in after
    changed = [
        (a, b) for a, b in zip(before.splitlines(), after.splitlines(), strict=True) if a != b
    ]
    assert 1 <= len(changed) <= 2
    for a, b in changed:  # comments and spaces stay
        assert a.partition("#")[2] == b.partition("#")[2]
        assert len(a) - len(a.lstrip()) == len(b) - len(b.lstrip())
        assert f"-{a}\n" in shown.stdout
        assert f"+{b}\n" in shown.stdout
    assert fsn("check", path.name, "--fix", "--yes", cwd=folder).returncode == 0
    assert path.read_text("utf-8") == after


def test_the_exact_diff(folder: Path):
    done = fsn("check", "04_size.yaml", "--fix", cwd=folder)
    diff = done.stdout.partition("--- ")[2].partition("1 finding")[0]
    assert diff == (
        "04_size.yaml\n"
        "+++ 04_size.yaml, fixed\n"
        "@@ -14,7 +14,7 @@\n"
        "       - size: 6   # safe inputs of the coupler to the logic\n"
        "         in: {ec_module: ek1914, index: 0x6000, subindex: 1}\n"
        "         out: {ec_module: el1918, index: 0x7080, subindex: 1}\n"
        "-      - size: 7   # safe outputs from the logic to the coupler\n"
        "+      - size: 6   # safe outputs from the logic to the coupler\n"
        "         in: {ec_module: el1918, index: 0x6080, subindex: 1}\n"
        "         out: {ec_module: ek1914, index: 0x7000, subindex: 1}\n"
        "     connections:\n"
    )


@pytest.mark.shows("R22")
@pytest.mark.parametrize("name", sorted(p.stem for p in BROKEN.glob("*.yaml")))
def test_a_finding_without_a_single_fix_is_unchanged(name: str, folder: Path):
    if name in GOOD:
        return
    path = folder / f"{name}.yaml"
    before = path.read_bytes()
    done = fsn("check", path.name, "--fix", "--yes", cwd=folder)
    assert done.returncode == 1
    assert "nothing to fix: no hint has exactly one way to follow it" in done.stdout
    assert path.read_bytes() == before


def test_a_file_that_changed_since_it_was_read_is_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    path = folder / "04_size.yaml"
    monkeypatch.chdir(folder)

    def question(*_: object, **_more: object) -> bool:
        path.write_text(path.read_text("utf-8") + "# mine\n", "utf-8")
        return True

    monkeypatch.setattr(check, "_is_wanted", question)
    monkeypatch.setattr("sys.argv", ["fsoe-net", "check", path.name, "--fix"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    assert "nothing written: 04_size.yaml has changed since it was read" in capsys.readouterr().err
    assert path.read_text("utf-8").endswith("# mine\n")
    assert "size: 7" in path.read_text("utf-8")
    assert check.command.name == "check"


def test_a_disk_that_is_full_leaves_the_file(folder: Path, monkeypatch: pytest.MonkeyPatch):
    path = folder / "04_size.yaml"
    before = path.read_bytes()
    monkeypatch.chdir(folder)
    write = Path.write_bytes

    def full(self: Path, data: bytes) -> int:
        write(self, data[: len(data) // 2])
        raise OSError(28, "No space left on device", str(self))

    monkeypatch.setattr(Path, "write_bytes", full)
    monkeypatch.setattr("sys.argv", ["fsoe-net", "check", path.name, "--fix", "--yes"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 3
    assert path.read_bytes() == before
    assert not [name for name in os.listdir(folder) if name.endswith(".part")]


def test_fix_is_for_people(folder: Path):
    done = fsn("check", "04_size.yaml", "--fix", "--format", "json", cwd=folder)
    assert done.returncode == 2
    assert "--fix shows changes for people: leave out --format" in done.stderr


TEXT = (
    "\ufeff# ü\r\nnets:\r\n- transfers:\r\n  - size: 7 # why\r\n"
    "    'in': {index: '0x6000', subindex: 1}\r\n"
    "    out: {index: 0x7000, subindex: 1, address: 5, watchdog_ms: 100}\r\n"
)


def edit(line: int, column: int, key: str, text: str, *, renames: bool = False) -> Edit:
    return Edit(span=Span("n.yaml", line, column), key=key, text=text, renames=renames)


@pytest.mark.shows("R22")
def test_only_the_scalar_changes_byte_for_byte():
    wanted = edit(4, 11, "size", "6")
    after, made = patch_yaml(TEXT.encode(), "n.yaml", [wanted])
    assert after == TEXT.replace("size: 7", "size: 6").encode()
    assert made == {wanted}


@pytest.mark.parametrize(
    "wrong",
    [
        edit(4, 12, "size", "6"),  # not where it stands
        edit(4, 11, "index", "6"),  # another key
        edit(5, 19, "index", "0x6001"),  # quoted
        edit(6, 10, "out", "address", renames=True),  # a key that none may become
        edit(6, 48, "address", "6"),
        edit(6, 64, "watchdog_ms", "1000"),
    ],
)
def test_protected_parts_are_unchanged(wrong: Edit):
    assert patch_yaml(TEXT.encode(), "n.yaml", [wrong]) == (TEXT.encode(), frozenset())


def test_two_wishes_for_one_place_change_nothing():
    both = [edit(4, 11, "size", "6"), edit(4, 11, "size", "11")]
    assert patch_yaml(TEXT.encode(), "n.yaml", both) == (TEXT.encode(), frozenset())


def test_invalid_yaml_is_rejected():
    with pytest.raises(InputError):
        patch_yaml(b"{", "n.yaml", [])
