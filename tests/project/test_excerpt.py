"""The line of a file below a finding: marked where the finding is, and never raw."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fsoe_net.diag.diagnostic import Span
from fsoe_net.project.excerpt import excerpt


def of(tmp_path: Path, text: str | bytes, line: int, column: int) -> list[str]:
    path = tmp_path / "a.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return excerpt(Span(str(path), line, column), [str(tmp_path)])


def test_the_word_at_the_column_is_marked(tmp_path: Path):
    assert of(tmp_path, "a: 1\n  index: 0x6000, b: 2\r\nc: 3\n", 2, 10) == [
        "    2 |   index: 0x6000, b: 2",
        "      |          ^^^^^^",
    ]


@pytest.mark.parametrize(
    ("text", "column", "mark"),
    [
        ("name: 'two words'  # c", 7, "      ^^^^^^^^^^^"),
        ("\ta: b", 5, "    ^"),
        ("a: {b: }", 8, "       ^"),
        ("a: 1,5", 4, "   ^^^"),
        ("a: [1,5]", 5, "    ^"),
        ("cycle: 1000 Hz  # fast", 8, "       ^^^^^^^"),
        ("a: {b: 1.5 ms, c: d}", 8, "       ^^^^^^"),
        ("a: 1000 of them", 4, "   ^^^^"),
        ("<Sm Default='1'/>", 1, "^^^"),
        ("機: 械械", 4, "    ^^^^"),
        ("e\u0301: x", 5, "   ^"),
    ],
)
def test_the_mark_is_below_its_text_in_a_terminal(
    tmp_path: Path, text: str, column: int, mark: str
):
    assert of(tmp_path, text, 1, column)[1] == f"      | {mark}"


def test_a_long_line_is_cut_on_both_sides(tmp_path: Path):
    line, mark = of(tmp_path, "a" * 500 + " here " + "b" * 500, 1, 502)
    assert len(line) <= 102
    assert line.count("…") == 2
    start = mark.index("^")
    assert line[start : start + mark.count("^")] == "here"


def test_control_characters_are_escaped(tmp_path: Path):
    line, mark = of(tmp_path, "a: \x1b[31m\u202e b", 1, 4)
    assert "\x1b" not in line
    assert "\u202e" not in line
    assert line[mark.index("^") :].startswith("\\u001b")


@pytest.mark.parametrize(
    ("text", "line", "column"),
    [
        ("a: 1\n", 0, 0),
        ("a: 1\n", 9, 1),
        ("a: 1\n", 1, 99),
        (b"a: \xff\n", 1, 1),
        ("a: 1\u2028b: 2\n", 1, 1),
        (b"a: 1\n" + bytes(5 << 20), 1, 1),
    ],
)
def test_a_place_that_cannot_be_shown_has_no_excerpt(
    tmp_path: Path, text: str | bytes, line: int, column: int
):
    assert of(tmp_path, text, line, column) == []


def test_a_pipe_a_folder_and_a_missing_file_have_none(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, tmp_path / "none", "/dev/zero"):
        assert excerpt(Span(str(path), 1, 1), ["/"]) == []


def test_a_file_with_the_name_of_standard_input_is_not_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "-").write_text("a: 1\n")
    assert excerpt(Span("-", 1, 1), ["."]) == []
    assert excerpt(Span("./-", 1, 1), ["."]) != []


@pytest.mark.parametrize("file", ["secret.yaml", "in/.hidden", "in/.ssh/key", "in/link.yaml"])
def test_a_file_that_the_user_did_not_name_is_not_shown(tmp_path: Path, file: str):
    (tmp_path / "in" / ".ssh").mkdir(parents=True)
    (tmp_path / "secret.yaml").write_text("password: hunter2\n")
    (tmp_path / "in" / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    path = tmp_path / file
    if not path.exists():
        path.write_text("password: hunter2\n")
    assert excerpt(Span(str(path), 1, 1), [str(tmp_path / "in")]) == []
    assert excerpt(Span(str(path), 1, 1), []) == []


def test_a_file_that_changed_is_read_again(tmp_path: Path):
    assert of(tmp_path, "a: 1\n", 1, 1)[0] == "    1 | a: 1"
    path = tmp_path / "a.yaml"
    path.write_text("b: 2\n")
    os.utime(path, ns=(1, 1))  # the same size, another time
    assert excerpt(Span(str(path), 1, 1), [str(tmp_path)])[0] == "    1 | b: 2"
