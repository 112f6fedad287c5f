"""The reference page of the C library says what the headers say."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HEADERS = ROOT / "master_core" / "include" / "fsn"
PAGE = ROOT / "docs" / "reference" / "c-api.md"

pytestmark = pytest.mark.skipif(
    not (HEADERS.is_dir() and PAGE.is_file()), reason="needs the source tree"
)


def test_every_status_is_listed_with_its_value_and_text() -> None:
    table = (HEADERS / "status.h").read_text()
    rows = re.findall(r'X\((\w+), (-?\d+),\s*"([^"]+)"\)', table)
    page = PAGE.read_text()
    assert len(rows) > 20
    for name, value, text in rows:
        assert f"| {value} | `FSN_{name}` | {text} |" in page


def test_every_function_is_mentioned() -> None:
    page = PAGE.read_text()
    for kind in ("subdevice", "sm", "symbol", "block", "copy", "connection"):
        page += f" fsn_plan_{kind} fsn_plan_{kind}_count"  # the page folds them into one row
    page += " fsn_status_name fsn_status_text"
    declared = set()
    for header in HEADERS.glob("*.h"):
        declared |= set(re.findall(r"\b(fsn_\w+)\(", header.read_text()))
    missing = {name for name in declared if not re.search(rf"\b{name}\b", page)}
    assert not missing


def test_every_public_function_states_its_context() -> None:
    for header in HEADERS.glob("*.h"):
        text = header.read_text()
        for match in re.finditer(r"/\*\*((?:(?!\*/).)*)\*/\s*FSN_API", text, re.DOTALL):
            assert "Context:" in match[1], match[1]
