"""Findings for a text that is not valid YAML."""

from __future__ import annotations

import re

import yaml

from fsoe_net.diag.diagnostic import Related, Span
from fsoe_net.formats.shared.files import Collector

MAX_DEPTH = 64
DEEPER = f"nested deeper than {MAX_DEPTH} levels"
FLATTER = "no file of this kind needs more than a dozen levels"
# What newer builds of libyaml say of a flow list in more than 1000 others, before it is read.
_TOO_DEEP = "exceeded maximum nesting depth"


def add_syntax_error(exc: yaml.YAMLError, file: str, text: str, out: Collector) -> None:
    """Add FSN102 or FSN103 for an error of the parser, at its place and with the next step."""
    mark = getattr(exc, "problem_mark", None) or getattr(exc, "context_mark", None)
    span = Span(file, mark.line + 1, mark.column + 1) if mark else Span(file, 1, 1)
    problem = getattr(exc, "problem", None) or str(exc).splitlines()[0]
    if problem == _TOO_DEEP:
        out.add("FSN103", span, DEEPER, hint=FLATTER)
        return
    context = getattr(exc, "context", None)
    start = getattr(exc, "context_mark", None)
    related: tuple[Related, ...] = ()
    if context and start is not None and mark is not None and start.line != mark.line:
        related = (Related(span=Span(file, start.line + 1, start.column + 1), message=context),)
    hint = _syntax_hint(problem, text.splitlines()[: span.line])
    if problem == "could not find expected ':'" and start is not None:
        hint = f"line {start.line + 1} has no colon after a key; an item of a list begins with `- `"
    out.add("FSN102", span, f"not valid YAML: {problem}", hint=hint, related=related)


def _syntax_hint(problem: str, lines: list[str]) -> str:
    """Return what to do about a syntax error in the last of these lines."""
    line = lines[-1] if lines else ""
    if "\t" in line[: len(line) - len(line.lstrip())]:
        return "replace the tab by spaces; YAML forbids tabs in indentation"
    if problem == "did not find expected '-' indicator":
        return "start the item with `- `, or indent it like the other keys of the item above"
    for number in range(len(lines), max(len(lines) - 4, 0), -1):
        if glued := re.match(r"\s*-([A-Za-z_]\w*):", lines[number - 1]):
            return f"write `- {glued[1]}:` in line {number}: a dash needs a blank"
    return "check indentation and brackets above this place"
