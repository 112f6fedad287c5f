"""No text advises another watchdog or cycle but with reaction times that are calculated again."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

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
    "People then raise the watchdog until it keeps quiet",
    "has another bus cycle",
    "has another FSoE watchdog",
    "another mapping, another watchdog",
    "Another bus cycle, such as 250us or 4ms.",
)


def texts_of(path: Path) -> Iterator[str]:
    """Yield the texts of a module without docstrings, or the paragraphs of a page."""
    if path.suffix == ".md":
        yield from re.split(r"\n\n|\n- |\n\d+\. |\n   - |\n\| ", path.read_text("utf-8"))
        return
    tree = ast.parse(path.read_text("utf-8"))
    bare = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(v.value for v in node.values if isinstance(v, ast.Constant))
        elif (
            isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in bare
        ):
            yield node.value


def test_who_advises_another_time_says_that_it_is_calculated_again():
    paths = [*(ROOT / "fsoe_net").rglob("*.py"), *(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]
    found = []
    for path in paths:
        for text in texts_of(path):
            words = " ".join(text.split())
            known = any(text in words for text in NO_ADVICE)
            if CHANGES.search(words) and not AGAIN.search(words) and not known:
                found.append(f"{path.relative_to(ROOT)}: {words}")
    assert found == []
