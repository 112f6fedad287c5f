"""What readers say, whole: a good text of each kind, with one thing changed in it.

`cases.yaml` holds what is changed (each pair: text to find, text to put there; the first only) and
all that is said: findings with place and hint, notes of SubDevices. Run this file to write it anew,
and read the difference: ``PYTHONPATH=tests python tests/formats/test_cases.py``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import yaml
from cases_file import write_cases
from formats.kinds import KINDS

from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.description import Description

HERE = Path(__file__).parent
CASES: dict[str, dict[str, dict]] = yaml.safe_load((HERE / "cases.yaml").read_text("utf-8"))


def said(kind: str, case: dict) -> str:
    """Read the text of a kind with the changes of a case; return all that is said."""
    text, read = KINDS[kind]
    for find, put in case.get("edit", ()):
        assert find in text, f"{find!r} is not in the text"
        text = text.replace(find, put, 1)
    out = Collector()
    found = read(text.encode(), out, name="file")
    lines = []
    for d in out.diagnostics:
        lines.append(f"{d.span} {d.code} {d.level.value}: {d.message}")
        lines += [f"  fix: {d.hint}"] if d.hint else []
        lines += [f"  {r.span}: {r.message}" for r in d.related]
    if found is None:
        lines.append("nothing is given")
    always = _notes(read(KINDS[kind][0].encode(), Collector(), name="file"))
    lines += [line for line in _notes(found) if line not in always or not case.get("edit")]
    return "".join(f"{line}\n" for line in lines)


def _notes(found: Description | None) -> list[str]:
    subdevices = found.subdevices if found is not None else ()
    return [f"note of {s.position} {s.name!r}: {note}" for s in subdevices for note in s.notes]


@pytest.mark.parametrize(
    ("kind", "name"), [(kind, name) for kind, cases in CASES.items() for name in cases]
)
def test_all_that_is_said(kind: str, name: str):
    case = CASES[kind][name]
    assert said(kind, case) == case["says"]


def _write() -> None:
    for kind, cases in CASES.items():
        for case in cases.values():
            case["says"] = said(kind, case)
    write_cases(HERE / "cases.yaml", CASES, "test_cases.py")


if __name__ == "__main__":
    sys.exit(_write())
