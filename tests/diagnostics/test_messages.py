"""The table of messages: each text of a rule, with its arguments, rendered once.

`messages.yaml` has the finding of each code of `cases.yaml`, and of further inputs (edits of the
clean files, or one that `message_inputs.py` makes) those of the named codes. Its values differ from
each other, so that an exchanged argument shows here. Other tests assert codes and places only. Run
this file to write the texts again, and read the difference:
``PYTHONPATH=tests python tests/diagnostics/test_messages.py``.
"""

from __future__ import annotations

import ast
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from cases_file import write_cases
from diagnostics import test_cases as cases
from diagnostics.message_inputs import INPUTS
from networks import PLAIN

from fsoe_net.diag.diagnostic import Diagnostic

HERE = Path(__file__).parent
PACKAGE = HERE.parents[1] / "fsoe_net"
RULES = [
    *PACKAGE.glob("rules/*.py"),
    *PACKAGE.glob("compare/reference*.py"),
    *PACKAGE.glob("compare/*scan*.py"),
]
TABLE: dict[str, Any] = yaml.safe_load((HERE / "messages.yaml").read_text("utf-8"))
EDITS: dict[str, dict] = TABLE["edits"]
# A table of texts, without arguments.
ELSEWHERE = "effects.py"


def rendered(findings: list[Diagnostic]) -> str:
    lines = []
    for one in findings:
        lines.append(f"{one.span}: {one.level.value}[{one.code}]: {one.message}")
        lines += [f"  see {r.span}: {r.message}" for r in one.related]
        lines += [f"  hint: {one.hint}"] if one.hint else []
        lines += [
            f"  edit {e.span}: {e.key} {'becomes' if e.renames else 'is'} {e.text}"
            for e in one.edits
        ]
    return "".join(f"{line}\n" for line in lines).replace(f"{PLAIN}/", "")


def of_files(case: dict, folder: Path) -> list[Diagnostic]:
    """Return what is found in the clean files with the edits of a case."""
    shutil.copytree(HERE / "base", folder)
    cases._seed(folder, case)
    before = Path.cwd()
    os.chdir(folder)
    try:
        return cases.findings(case)
    finally:
        os.chdir(before)


def of_code(code: str, folder: Path) -> str:
    case = cases.CASES[code]
    found = of_files(case, folder)
    return rendered([d for d in found if (d.code, str(d.span)) == (code, case["at"])])


def of_edits(name: str, folder: Path) -> str:
    case = EDITS[name]
    return rendered([d for d in of_files(case, folder) if d.code in case["codes"]])


@pytest.mark.parametrize("code", sorted(cases.CASES))
def test_the_message_of_each_code(code: str, tmp_path: Path) -> None:
    assert of_code(code, tmp_path / "case") == TABLE["codes"].get(code)


@pytest.mark.parametrize("name", EDITS)
def test_the_messages_of_edited_files(name: str, tmp_path: Path) -> None:
    assert of_edits(name, tmp_path / "case") == EDITS[name]["says"]


@pytest.mark.parametrize("name", TABLE["made"])
def test_the_messages_of_a_bus_and_of_descriptions(name: str) -> None:
    assert rendered(INPUTS[name]()) == TABLE["made"][name]


# Texts that nothing in the table reaches.
NOT_SHOWN = {
    " is at position {}, at position {} in ",
    "; as vendors print it, {} ms would be left",
    "; no slot of {} fits that",
    "leave it as it is",
    "list the PDOs of both directions in one order, or ",
    "name the safety terminal on the bus that holds the MainInstance",
    "slot {} of {}: by their object numbers {} and {} belong to two connections",
    "the bytes after SM{} of ",
    "write the two transfers out",
}


def _texts(tree: ast.Module) -> Iterator[list[str]]:
    """Yield the constant parts of each text of three words and more; docstrings are none."""
    nodes = list(ast.walk(tree))
    skipped = {id(n.value) for n in nodes if isinstance(n, ast.Expr)}
    skipped |= {id(v) for n in nodes if isinstance(n, ast.JoinedStr) for v in n.values}
    calls = (n for n in nodes if isinstance(n, ast.Call) and isinstance(n.func, ast.Name))
    skipped |= {id(n.args[0]) for n in calls if n.func.id == "cast"}
    for node in nodes:
        if isinstance(node, ast.JoinedStr):
            parts = [v.value for v in node.values if isinstance(v, ast.Constant)]
        elif isinstance(node, ast.Constant) and id(node) not in skipped:
            parts = [node.value]
        else:
            continue
        whole = [p for p in parts if isinstance(p, str)]
        words = re.findall(r"[A-Za-z]{2,}", " ".join(whole))
        if len(words) >= 3 and any(" " in part for part in whole):
            yield whole


def test_every_text_of_a_rule_is_in_the_table() -> None:
    says = [*TABLE["codes"].values(), *TABLE["made"].values(), *(e["says"] for e in EDITS.values())]
    lines = {line for text in says for line in text.splitlines()}
    missing = set()
    for path in sorted(RULES):
        if path.name == ELSEWHERE:
            continue
        for parts in _texts(ast.parse(path.read_text("utf-8"))):
            longest, pattern = max(parts, key=len), re.compile(".*".join(map(re.escape, parts)))
            if not any(longest in line and pattern.search(line) for line in lines):
                missing.add("{}".join(parts))
    assert missing == NOT_SHOWN


def _write() -> None:
    with tempfile.TemporaryDirectory() as root:
        codes = {code: of_code(code, Path(root) / code) for code in sorted(cases.CASES)}
        for number, (name, case) in enumerate(EDITS.items()):
            case["says"] = of_edits(name, Path(root) / str(number))
    made = {name: rendered(INPUTS[name]()) for name in TABLE["made"]}
    table = {"codes": codes, "edits": EDITS, "made": made}
    write_cases(HERE / "messages.yaml", table, "test_messages.py")


if __name__ == "__main__":
    sys.exit(_write())
