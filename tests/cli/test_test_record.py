"""`fsoe-net test-record`: files it writes, what it refuses, exit codes."""

from __future__ import annotations

from pathlib import Path

import yaml
from cli.tool import fsn

TIMED = str(Path(__file__).parents[1] / "diagnostics" / "base" / "timed.yaml")


def test_an_empty_test_record_and_its_page(tmp_path: Path) -> None:
    text, page = tmp_path / "test-record.yaml", tmp_path / "test-record.html"
    done = fsn("test-record", TIMED, "-o", str(text))
    assert done.returncode == 0, done.stderr
    assert "steps" in done.stdout
    assert "open at the machine" in done.stdout
    written = text.read_text("utf-8")
    assert "EMULATED, not evidence for this machine" in written
    for step in yaml.safe_load(written)["steps"]:  # no form to fill in where none is taken
        assert ("machine" in step) == (step["kind"] != "fault")
    done = fsn("test-record", TIMED, "--test-record", str(text), "-o", str(page))
    assert done.returncode == 0, done.stderr
    assert "trigger estop" in page.read_text("utf-8")


def test_handwriting_survives_and_a_broken_file_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "test-record.yaml"
    assert fsn("test-record", TIMED, "-o", str(path)).returncode == 0
    filled = path.read_text("utf-8").replace("by: ''", "by: A. Person", 1)
    path.write_text(filled, "utf-8")
    assert fsn("test-record", TIMED, "-o", str(path)).returncode == 1
    assert path.read_text("utf-8") == filled
    assert fsn("test-record", TIMED, "-o", str(path), "--overwrite").returncode == 0
    assert path.read_text("utf-8") == filled
    path.write_text("version: 1\n", "utf-8")
    done = fsn("test-record", TIMED, "-o", str(path), "--overwrite")
    assert done.returncode == 1
    assert "nothing written" in done.stderr
    assert path.read_text("utf-8") == "version: 1\n"


def test_live_needs_a_person_at_a_terminal(tmp_path: Path) -> None:
    done = fsn(
        "test-record", TIMED, "--live", "--socket", "nowhere.sock", "-o", str(tmp_path / "p.yaml")
    )
    assert done.returncode == 2
    assert "from a terminal" in done.stderr
    assert not (tmp_path / "p.yaml").exists()


def test_incompatible_options_are_rejected(tmp_path: Path) -> None:
    both = fsn(
        "test-record",
        TIMED,
        "--virtual",
        "--live",
        "--socket",
        "x",
        "-o",
        str(tmp_path / "p.yaml"),
    )
    assert both.returncode == 2
    other = fsn("test-record", TIMED, "-o", str(tmp_path / "p.pdf"))
    assert other.returncode == 2
    assert ".yaml" in other.stderr
