"""Whole texts: what a test makes the product say is what was read and recorded.

A module of tests says `pytestmark = pytest.mark.usefixtures("said")`. Every finding that is made
in one of its tests, with place, severity, further places, hint and edits, and every error raised on
purpose must then stand in `said.txt` beside it; a test may add texts. Where there is a
`said_by.txt`, it has which of them each test makes, and how often: nothing comes along, nothing is
missing. After a wanted change

    FSN_RECORD=1 python -m pytest tests/rules tests/diagnostics tests/timing tests/plan

writes the files of these folders anew, `FSN_RECORD=more` adds to them; the difference is to be
read. Tests of hypothesis are left out (theirs are other findings each time), and those that make
more than a hundred.
"""

from __future__ import annotations

import hashlib
import os
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from networks import PLAIN

from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.errors import FsnError

ROOT = Path(__file__).parents[1]
NAME, BY = "said.txt", "said_by.txt"
# A test that makes more of them than this is about their number or how long they take.
MANY = 100
_recorded: dict[Path, set[str]] = defaultdict(set)
_by: dict[Path, dict[str, str]] = defaultdict(dict)


class Said:
    """What a test heard: findings, and texts it adds."""

    def __init__(self) -> None:
        self.findings: list[Diagnostic] = []
        self.errors: list[FsnError] = []
        self.texts: list[str] = []

    def add(self, text: str) -> None:
        """Add a text; lines that are empty do not count."""
        self.texts.append("\n".join(line for line in text.splitlines() if line.strip()))

    def whole(self, *folders: Path) -> list[str]:
        """Return all texts, without the folders of the files that they name."""
        for one in self.findings:
            lines = [f"{one.span}: {one.level.value}[{one.code}]: {one.message}"]
            lines += [f"  see {r.span}: {r.message}" for r in one.related]
            lines += [f"  hint: {one.hint}"] if one.hint else []
            lines += [
                f"  edit {e.span}: {e.key} {'becomes' if e.renames else 'is'} {e.text}"
                for e in one.edits
            ]
            self.add("\n".join(lines))
        for error in self.errors:
            self.add(f"{type(error).__name__}: {error}")
        out = []
        for text in self.texts:
            for folder in folders:
                text = text.replace(f"{folder}/", "")
            out.append(text)
        return sorted(out)


def _short(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:6]


@cache
def _read(path: Path) -> frozenset[str]:
    return frozenset(path.read_text("utf-8").rstrip("\n").split("\n\n"))


@cache
def _read_by(path: Path) -> dict[str, str]:
    rows = (line.rpartition(": ") for line in path.read_text("utf-8").splitlines())
    return {name: texts for name, _, texts in rows}


@pytest.fixture
def said(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Iterator[Said]:
    """Compare all that is said meanwhile with the recorded ones."""
    heard = Said()
    whole = Diagnostic.__post_init__

    def kept(self: Diagnostic) -> None:
        whole(self)
        heard.findings.append(self)

    def raised(self: FsnError, *args: object) -> None:
        Exception.__init__(self, *args)
        heard.errors.append(self)

    monkeypatch.setattr(Diagnostic, "__post_init__", kept)
    monkeypatch.setattr(FsnError, "__init__", raised)
    yield heard
    drawn = hasattr(request.function, "hypothesis")
    if drawn or len(heard.findings) + len(heard.errors) > MANY:
        return
    texts = heard.whole(tmp_path, PLAIN, ROOT)
    path, by = request.path.with_name(NAME), request.path.with_name(BY)
    name = f"{request.path.name}::{request.node.name}"
    row = " ".join(map(_short, texts))
    if "FSN_RECORD" in os.environ:
        _recorded[path] |= set(texts)
        if by.exists():
            _by[by][name] = row
        return
    new = set(texts) - _read(path)
    assert not new, f"not in {path}:\n" + "\n".join(sorted(new))
    if not by.exists():
        return
    wanted = _read_by(by).get(name, "").split()
    known = {_short(text): text for text in _read(path)}
    lacking = [known.get(x, x) for x in (Counter(wanted) - Counter(row.split())).elements()]
    assert not lacking, f"not said as in {by}:\n" + "\n".join(lacking)
    more = [known[x] for x in (Counter(row.split()) - Counter(wanted)).elements()]
    assert not more, f"not said by this test in {by}:\n" + "\n".join(more)


def pytest_sessionfinish() -> None:
    """Write what was recorded, one file a folder."""
    for path, texts in _recorded.items():
        if os.environ["FSN_RECORD"] == "more":
            texts |= _read(path)
        path.write_text("\n\n".join(sorted(texts)) + "\n", "utf-8")
    for path, rows in _by.items():
        if os.environ["FSN_RECORD"] == "more":
            rows = {**_read_by(path), **rows}
        path.write_text("".join(f"{n}: {rows[n]}\n" for n in sorted(rows) if rows[n]), "utf-8")
