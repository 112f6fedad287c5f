"""Names from files, devices and file names never act on a terminal."""

from __future__ import annotations

import os
import pty
import re
import shutil
import subprocess
import sys
import unicodedata
from pathlib import Path

import pytest
from weekly import first

from fsoe_net.diag.printable import first_control, printable

ROOT = Path(__file__).parents[2]
ESTOP = ROOT / "examples" / "estop"
# A title of the window, a colour, one byte that some terminals take for ESC [, and a turn of the
# reading direction.
BAD = "a\x1b]0;owned\x07\x1b[31m\x9b2J\u202eb"
FSN = [sys.executable, "-m", "fsoe_net.cli"]
OURS = re.compile("\x1b\\[(0|1|3[1-6])m")


def _run(*args: str, cwd: Path) -> str:
    """Return everything that a command prints on a terminal, our own colours taken out."""
    main, other = pty.openpty()
    done = subprocess.Popen(
        [*FSN, *args],
        stdin=subprocess.DEVNULL,
        stdout=other,
        stderr=other,
        cwd=cwd,
        env=os.environ | {"TERM": "xterm", "COLUMNS": "100"},
    )
    os.close(other)
    data = b""
    while True:
        try:
            piece = os.read(main, 65536)
        except OSError:  # the other end is closed
            break
        if not piece:
            break
        data += piece
    os.close(main)
    done.wait()
    return OURS.sub("", data.decode().replace("\r\n", "\n"))


def _assert_clean(text: str) -> None:
    hidden = [c for c in text if unicodedata.category(c) in ("Cc", "Cf", "Zl", "Zp")]
    assert set(hidden) <= {"\n", "\t"}, ascii(text)


@pytest.fixture
def estop(tmp_path: Path) -> Path:
    shutil.copytree(ESTOP, tmp_path / "n")
    return tmp_path / "n"


@pytest.mark.uncounted
@pytest.mark.shows("R24")
@pytest.mark.parametrize(
    "command",
    first(
        8,
        [
            ["check"],
            ["report", "-o", "r.html"],
            ["run"],
            ["decode"],
            ["log", "incident"],
            ["explain"],
            ["nonsense"],
            ["init", "--no-input"],
            ["plan", "--show"],
            ["plan", "-o", "x.fsnplan"],
            ["diff", "network.yaml"],
            ["acceptance", "verify", "--accepted"],
            ["timing"],
            ["convert", "--to", "eni", "-o", "x.xml"],
            ["campaign"],
            ["campaign", "--replay"],
            ["init", "--list"],
        ],
    ),
    ids=lambda c: c[0],
)
def test_a_file_name_is_shown_and_does_nothing(command: list[str], tmp_path: Path, estop: Path):
    for content in (None, "", "{}", (estop / "network.yaml").read_text().replace("1000", "0")):
        if content is not None:
            (estop / f"{BAD}\nx").write_text(content)
        text = _run(*command, f"{BAD}\nx", cwd=estop)
        _assert_clean(text)
        assert text


@pytest.mark.parametrize("where", ["name: estop", "name: ek1914", "name: safety_net"])
def test_a_name_in_yaml_is_refused(where: str, estop: Path):
    path = estop / "network.yaml"
    path.write_text(path.read_text().replace(where, 'name: "a\\e]0;owned\\a\\u202e"', 1))
    text = _run("check", "network.yaml", cwd=estop)
    _assert_clean(text)
    assert "error[FSN102]: control character U+001B in a text\n" in text


def test_a_name_of_two_lines_is_refused(estop: Path):
    path = estop / "network.yaml"
    good = path.read_text()
    for name in ('"a\\nb"', "|\n      a\n      b"):
        path.write_text(good.replace("name: safety_net", f"name: {name}", 1))
        assert "error[FSN102]" in _run("check", "network.yaml", cwd=estop)


@pytest.mark.shows("R24")
def test_names_in_an_eni_are_shown_and_kept_apart(tmp_path: Path, estop: Path):
    assert "x.xml" in _run("convert", "network.yaml", "-o", "x.xml", cwd=estop)
    path = estop / "x.xml"
    text = path.read_text()
    assert "ek1914" in text
    path.write_text(text.replace("ek1914", "a&#x9b;2J&#x202e;&#10;error: b"))
    for command in (["convert", "--to", "yaml"], ["init", "--no-input"], ["diff", "network.yaml"]):
        shown = _run(*command, "x.xml", cwd=estop)
        _assert_clean(shown)
        assert "\nerror: b" not in shown
    checked = _run("check", "network.yaml", "x.xml", cwd=estop)
    _assert_clean(checked)


def test_json_for_a_terminal_is_json(estop: Path):
    (estop / "network.yaml").rename(estop / f"{BAD}.yaml")
    text = _run("check", f"{BAD}.yaml", "nothing\u202e", "--format", "json", cwd=estop)
    _assert_clean(text)
    import json

    files = {d["file"] for d in json.loads(text)["diagnostics"]}
    assert files & {f"{BAD}.yaml", "nothing\u202e"}


def test_a_plan_with_such_a_name_is_refused(estop: Path):
    import zlib

    _run("plan", "network.yaml", "-o", "x.fsnplan", cwd=estop)
    path = estop / "x.fsnplan"
    data = path.read_bytes().replace(b"ek1914\0", b"\x1b[31mx\0")
    size = len(data) - 4
    path.write_bytes(data[:size] + zlib.crc32(data[:size]).to_bytes(4, "little"))
    text = _run("plan", "--show", "x.fsnplan", cwd=estop)
    _assert_clean(text)
    assert "error" in text


@pytest.mark.shows("R24")
def test_printable_text_is_unchanged():
    arabic = "\u062a\u0648\u0642\u0641"
    for text in ("Förderband 2, links", "急停", arabic, "a b", ""):
        assert printable(text) == text
        assert first_control(text) == ""
    assert printable("a\x1b\n\u202e\U000e0041") == "a\\u001b\\u000a\\u202e\\udb40\\udc41"
    assert printable("a\nb", keep="\n") == "a\nb"
    # Persian needs the zero-width non-joiner: shown as its escape, and not refused.
    assert (printable("\u0645\u200c\u062e"), first_control("\u0645\u200c\u062e")) == (
        "\u0645\\u200c\u062e",
        "",
    )
    assert first_control("a\n\t") == ""
    controls = "\x07\x85\u2028\u202e\u2066"
    assert [first_control(c) for c in controls] == list(controls)
