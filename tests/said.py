"""Whole texts: what a test makes the product say is what was read and recorded.

A module of tests says `pytestmark = pytest.mark.usefixtures("said")`. Every finding that is made
in one of its tests, with place, severity, further places, hint and edits, and every error raised on
purpose must then stand in `said.txt` beside it; a test may add texts. After a wanted change

    FSN_RECORD=1 python -m pytest tests/rules tests/diagnostics tests/timing tests/plan

writes the files of these folders anew, `FSN_RECORD=more` adds to them; the difference is to be
read. Tests of hypothesis are left out (theirs are other findings each time), and those that make
more than a hundred.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from networks import PLAIN

from fsoe_net.diag import Diagnostic
from fsoe_net.errors import FsnError

ROOT = Path(__file__).parents[1]
NAME = "said.txt"
# A test that makes more of them than this is about their number or how long they take.
MANY = 100
_recorded: dict[Path, set[str]] = defaultdict(set)


class Said:
    """What a test heard: findings, and texts it adds."""

    def __init__(self) -> None:
        self.findings: list[Diagnostic] = []
        self.errors: list[FsnError] = []
        self.texts: list[str] = []

    def add(self, text: str) -> None:
        """Add a text; lines that are empty do not count."""
        self.texts.append("\n".join(line for line in text.splitlines() if line.strip()))

    def whole(self, *folders: Path) -> set[str]:
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
        out = set()
        for text in self.texts:
            for folder in folders:
                text = text.replace(f"{folder}/", "")
            out.add(text)
        return out


@cache
def _read(path: Path) -> frozenset[str]:
    return frozenset(path.read_text("utf-8").rstrip("\n").split("\n\n"))


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
    path = request.path.with_name(NAME)
    if "FSN_RECORD" in os.environ:
        _recorded[path] |= texts
        return
    new = texts - _read(path)
    assert not new, f"not in {path}:\n" + "\n".join(sorted(new))


def pytest_sessionfinish() -> None:
    """Write what was recorded, one file a folder."""
    for path, texts in _recorded.items():
        if os.environ["FSN_RECORD"] == "more":
            texts |= _read(path)
        path.write_text("\n\n".join(sorted(texts)) + "\n", "utf-8")
