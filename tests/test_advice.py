"""Advice that cannot hurt: about times, about the configuration, and about hands in a machine.

Every text that touches one of these stands in `advice.txt`, read by a person. A new or changed one
fails here: read it, correct it, then write the list anew with ``FSN_RECORD=1``.
"""

import ast
import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
CHANGES = re.compile(
    r"\b(longer|lengthen|raise|increase|greater|another) (the |an? )?(FSoE )?"
    r"(watchdogs?|bus cycle|required reaction time|reaction time)\b",
    re.IGNORECASE,
)
AGAIN = re.compile(r"calculat\w+ (\S+ ){0,3}again")
# Texts that advise nothing: what differs, what was measured, what hides a fault.
NO_ADVICE = (
    "a longer watchdog hides lost frames",
    "device has a longer watchdog time, this is no mistake",
    "People then raise the watchdog until it no longer expires",
    "has another bus cycle",
    "has another FSoE watchdog",
    "another mapping, another watchdog",
    "Another bus cycle, such as 250us or 4ms.",
)


def texts_of(path: Path) -> Iterator[str]:
    """Yield the texts of a module without docstrings, or the prose of a page by paragraphs."""
    if path.suffix == ".md":
        prose = re.sub(r"```.*?```", "", path.read_text("utf-8"), flags=re.DOTALL)
        yield from re.split(r"\n\n|\n- |\n\d+\. |\n   - |\n\| ", prose)
        return
    if path.suffix == ".c":
        for text in re.findall(r'(?:"(?:[^"\\\n]|\\.)*"\s*)+', path.read_text("utf-8")):
            yield re.sub(r'"\s*"', "", text).strip().strip('"')
        return
    tree = ast.parse(path.read_text("utf-8"))
    bare = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(v.value for v in node.values if isinstance(v, ast.Constant))
        elif (
            isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in bare
        ):
            # The catalogue is one text with a title per line.
            yield from node.value.splitlines() if path.stem == "catalogue" else [node.value]


@pytest.mark.shows("R23")
def test_advice_to_change_a_time_requires_a_new_calculation():
    found = []
    for path in _sources():
        for text in texts_of(path):
            words = " ".join(text.split())
            known = any(text in words for text in NO_ADVICE)
            if CHANGES.search(words) and not AGAIN.search(words) and not known:
                found.append(f"{path.relative_to(ROOT)}: {words}")
    assert found == []


TIMES = re.compile(r"\b(watchdogs?|bus cycle|reaction times?)\b", re.IGNORECASE)
ADVISES = re.compile(
    r"\b(set|raise|lower|change|correct|choose|write|give|allow|shorter|longer|at least)\b",
    re.IGNORECASE,
)
HANDS = re.compile(
    r"\b(unplug|plug in|reconnect|power[- ]cycle|switch(ed)? (it |the \S+ )?(off|on)|"
    r"(press|replace|exchange|measure|move|check|look at|put|change|restore|repair)( \S+){0,5} "
    r"(cables?|plugs?|connectors?|power|supply|wiring|fuse|devices?|button|reset))\b",
    re.IGNORECASE,
)
SECURED = re.compile(r"\bsecured?\b", re.IGNORECASE)
LIST = Path(__file__).with_name("advice.txt")


def _sources() -> list[Path]:
    core = [c for part in ("src", "app") for c in (ROOT / "master_core" / part).rglob("*.c")]
    tool = (ROOT / "fsoe_net").rglob("*.py")
    return [*core, *tool, *(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]


def _touches() -> Iterator[str]:
    for path in sorted(_sources()):
        for text in texts_of(path):
            words = " ".join(text.split())
            if len(words.split()) < 4:
                continue
            hands, times = HANDS.search(words), TIMES.search(words) and ADVISES.search(words)
            if hands or times:
                kind = "hands" if hands else "times"
                yield f"{path.relative_to(ROOT)} | {kind} | {words}"


@pytest.mark.shows("R23")
def test_every_text_about_times_and_hands_was_read():
    text = "".join(f"{row}\n" for row in _touches())
    if os.environ.get("FSN_RECORD"):
        LIST.write_text(text, "utf-8")
    known = LIST.read_text("utf-8").splitlines()
    assert [row for row in text.splitlines() if row not in known] == []
    assert [row for row in known if row not in text.splitlines()] == []


@pytest.mark.shows("R23")
def test_a_page_that_sends_hands_into_a_machine_begins_with_securing_it():
    found = []
    for path in (ROOT / "docs" / "diagnostics").glob("*.md"):
        fix = path.read_text("utf-8").partition("**Fix.**")[2]
        hands = HANDS.search(fix)
        if hands and not SECURED.search(fix[: hands.start()]):
            found.append(f"{path.name}: {hands[0]}")
    assert found == []


def test_a_hint_about_what_is_on_the_bus_begins_with_securing_the_machine():
    found = []
    paths = list((ROOT / "fsoe_net" / "compare").glob("*scan*.py"))
    assert any("{SECURED}" in path.read_text("utf-8") for path in paths)
    for path in paths:
        tree = ast.parse(path.read_text("utf-8"))
        for call in (n for n in ast.walk(tree) if isinstance(n, ast.Call)):
            for hint in (k.value for k in call.keywords if k.arg == "hint"):
                text = ast.unparse(hint)
                hands = HANDS.search(text)
                if hands and "SECURED" not in text[: hands.start()]:
                    found.append(text)
    assert found == []
