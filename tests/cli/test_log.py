"""``fsoe-net log``: tables, findings and the ZIP file of an intervention log."""

from __future__ import annotations

import hashlib
import json
import subprocess
import zipfile
from pathlib import Path

import pytest
from cli.tool import fsn
from intervention_log.intervention_logs import a_log, chained, hash_of, written


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return written(tmp_path / "log", a_log(3, 3))


def log(*arguments: object, folder: Path, code: int = 0) -> str:
    """Run a command of the log; returns what it prints."""
    done = fsn("log", *map(str, arguments), cwd=folder.parent)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_entries_are_shown(folder: Path) -> None:
    assert log("show", "log", "--user", "anna", folder=folder).splitlines() == [
        "Intervention log",
        "The chain holds",
        "",
        "Entries",
        "───────",
        "Entry  Time (UTC)           Event    Who               What",
        "    2  2026-11-23 16:52:02  request  anna, fsoe-net 7  what happened 2",
        "    5  2026-11-23 16:52:05  request  anna, fsoe-net 7  what happened 5",
    ]
    shown = log("show", "log", "--most", 1, "--event", "file", folder=folder)
    assert "what happened 4" in shown
    assert "what happened 1" not in shown
    assert "1 earlier entries are left out; --most shows more" in shown
    assert "No entry fits." in log("show", "log", "--event", "none", folder=folder)


@pytest.mark.parametrize(
    ("limits", "numbers"),
    [
        (("--since", "2026-11-23T16:52:05"), [5, 6]),
        (("--until", "2026-11-23T17:52:03+01:00"), [1, 2]),
        (("--since", "2026-11-24"), []),
    ],
)
def test_entries_of_a_time_are_shown(
    folder: Path, limits: tuple[str, ...], numbers: list[int]
) -> None:
    shown = json.loads(log("show", "log", *limits, "--format", "json", folder=folder))
    assert [entry["number"] for entry in shown["entries"]] == numbers
    assert (shown["left_out"], shown["check"]["holds"]) == (0, True)


def test_a_log_is_verified(folder: Path) -> None:
    found = json.loads(log("verify", "log", "--format", "json", folder=folder))
    assert found["holds"] is True
    assert found["last"]["number"] == found["entries"] == 6
    last = found["last"]["sha256"]
    assert "(--last HASH)" in " ".join(log("verify", "log", folder=folder).split())
    assert "--last: 0." in log("verify", "log", "--last", last.upper(), folder=folder)
    second = "log/interventions-000002.jsonl"
    shown = log("verify", second, folder=folder, code=1)
    assert "The chain does not hold: 1 finding\n" in shown
    assert f"- {second}:1: entries 1 to 3 are missing: name the files before" in shown
    before = hash_of((folder / "interventions-000001.jsonl").read_bytes().splitlines()[-1])
    log("verify", second, "--after", before, folder=folder)
    first, *rest = (folder / "interventions-000001.jsonl").read_bytes().splitlines(keepends=True)
    (folder / "interventions-000001.jsonl").write_bytes(
        first.replace(b"1", b"2", 1) + b"".join(rest)
    )
    assert "leave the files as they are" in log("verify", "log", folder=folder, code=1)
    assert "log verify names every place" in log("show", "log", folder=folder, code=1)


def test_a_log_is_packed_byte_for_byte(folder: Path) -> None:
    for code, last in ((0, []), (1, ["--last", "0" * 64])):
        shown = log(
            "export", "log", "-o", "log.zip", "--overwrite", *last, folder=folder, code=code
        )
        assert "log.zip: 2 files, SHA256SUMS, verification.txt and .json" in shown
        with zipfile.ZipFile(folder.parent / "log.zip") as archive:
            archive.extractall(folder.parent / "packed")
        for path in folder.iterdir():
            assert (folder.parent / "packed" / path.name).read_bytes() == path.read_bytes()
        subprocess.run(
            ["sha256sum", "--check", "--strict", "SHA256SUMS"],
            cwd=folder.parent / "packed",
            check=True,
            capture_output=True,
        )
        found = json.loads((folder.parent / "packed" / "verification.json").read_text())
        assert found["holds"] is (code == 0)
    assert "exists" in log("export", "log", "-o", "log.zip", folder=folder, code=1)
    (folder.parent / "other").mkdir()
    (folder.parent / "other" / "interventions-000001.jsonl").write_bytes(
        (folder / "interventions-000001.jsonl").read_bytes()
    )
    log("export", "log", "other", "-o", "two.zip", folder=folder, code=1)
    with zipfile.ZipFile(folder.parent / "two.zip") as archive:
        names = archive.namelist()
        assert names[:3] == [
            "1-interventions-000001.jsonl",
            "interventions-000002.jsonl",
            "3-interventions-000001.jsonl",
        ]
    assert not list(folder.parent.glob("*.part"))


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (("show", "none"), 1, "no such file"),
        (("verify", "empty"), 1, "holds no interventions-*.jsonl: name the folder"),
        (("verify", "log", "--last", "12"), 2, "64 hexadecimal digits"),
        (("verify", "log", "--after", "x" * 64), 2, "64 hexadecimal digits"),
        (("show", "log", "--since", "soon"), 2, "write 2026-11-23 or"),
        (("export", "log"), 2, "--output"),
        (("export", "log", "-o", "-"), 2, "only written into a file"),
        (("export", "log", "-o", "none/x.zip"), 3, "missing folder"),
        (("export", "none", "-o", "x.zip"), 1, "no such file"),
        (("verify",), 2, "FILES"),
    ],
)
def test_usage_error_writes_no_export(
    folder: Path, arguments: tuple[str, ...], code: int, text: str
) -> None:
    (folder.parent / "empty").mkdir()
    assert text in log(*arguments, folder=folder, code=code)
    assert not (folder.parent / "x.zip").exists()


@pytest.mark.shows("R24")
def test_nothing_in_a_log_acts_on_the_terminal(folder: Path) -> None:
    path = folder / "interventions-000002.jsonl"
    last = path.read_bytes().splitlines(keepends=True)[-1]
    hostile = {"event": "\x1b[2J", "text": "\x1b]0;x\x07\u202e\ud800", "user": "\x9b1m", "uid": 1}
    path.write_bytes(path.read_bytes() + chained(last, **hostile) + b"\x1b[31m junk\n")
    for command, code in (("show", 1), ("verify", 1)):
        for fmt in ("text", "json"):
            shown = log(command, "log", "--format", fmt, folder=folder, code=code)
            assert not set(shown) & {"\x1b", "\x07", "\x9b", "\u202e"}


def test_a_whole_file_of_one_line_is_read_in_pieces(folder: Path) -> None:
    path = folder / "interventions-000002.jsonl"
    path.write_bytes(b"x" * (4 << 20))
    found = json.loads(log("verify", "log", "--format", "json", folder=folder))
    assert "the last line is incomplete" in found["remarks"][0]
    assert found["files"][1]["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
