"""Expands xacro with the real xacro, in a child process with limits on time and memory.

Request and answer are JSON, see `fsoe_net.load.xacro_child`. Every element of the expansion keeps
the place where it was written, also through macros and includes.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from fsoe_net.diag import Related, Span
from fsoe_net.load.files import Collector
from fsoe_net.load.xml_tree import Element
from fsoe_net.model import SourceFile

__all__ = ["LIMITS", "XacroLimits", "expand_xacro", "uses_xacro"]


@dataclass(frozen=True, slots=True, kw_only=True)
class XacroLimits:
    """What an expansion may cost.

    Args:
        cpu_seconds: Processor time; real robots take about one second.
        wall_seconds: Time by the clock, for what blocks without computing.
        memory_bytes: Address space of the child process.
    """

    cpu_seconds: int = 20
    wall_seconds: float = 30.0
    memory_bytes: int = 1_500_000_000


LIMITS = XacroLimits()
_CHILD = "from fsoe_net.load.xacro_child import main; main()"


def uses_xacro(root: Element) -> bool:
    """Whether a document needs expansion: xacro tags or attributes, ``${…}`` or ``$(…)``."""
    for element in root.walk():
        if element.name.startswith("xacro:"):
            return True
        if any(name.startswith("xacro:") for name in element.attributes):
            return True
        texts = (element.text, *element.attributes.values())
        if any("${" in text or "$(" in text for text in texts):
            return True
    return False


def expand_xacro(
    path: str, out: Collector, *, packages: Mapping[str, str], arguments: Mapping[str, str]
) -> Element | None:
    """Expand a file.

    Args:
        path: The xacro file.
        out: Takes FSN119, FSN118 for an included file, and the files that were read.
        packages: ROS package name to folder, for ``$(find name)``.
        arguments: Values of ``$(arg name)``.

    Returns:
        The expanded document, or ``None`` with a finding.
    """
    request = {
        "file": path,
        "packages": dict(packages),
        "arguments": dict(arguments),
        "limits": asdict(LIMITS),
    }
    try:
        done = subprocess.run(  # noqa: S603 - our own interpreter and code, no shell
            # -P: modules that lie in the current folder are not the ones meant.
            [sys.executable, "-P", "-c", _CHILD],
            input=json.dumps(request).encode(),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=LIMITS.wall_seconds,
            check=False,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        )
        return _read_answer(json.loads(done.stdout), path, out)
    except subprocess.TimeoutExpired:
        _fail(out, Span(path, 1, 1), f"it does not end within {LIMITS.wall_seconds:g} s")
    except OSError as exc:
        _fail(out, Span(path, 1, 1), f"its process cannot be started: {exc.strerror or exc}")
    except (ValueError, TypeError, LookupError):
        # No answer, or one cut off: the kernel ended the child at a limit.
        _fail(out, Span(path, 1, 1), "it needs more time or memory than is allowed")
    return None


def _read_answer(answer: dict[str, Any], path: str, out: Collector) -> Element | None:
    for file, digest in answer["sources"]:
        row = SourceFile(path=str(file), sha256=str(digest))
        if row not in out.sources:
            out.sources.append(row)
    error = answer.get("error")
    if error is None:
        return _build(answer["rows"], path)
    span = Span(*error["place"]) if error["place"] else Span(path, 1, 1)
    if error["code"] == "FSN118":
        out.add("FSN118", span, error["message"], hint=error["hint"])
        return None
    related = tuple(
        Related(span=Span(file, line, column), message=f"expanded from <{name}> here")
        for file, line, column, name in error["via"]
    )
    _fail(out, span, error["message"], hint=error["hint"], related=related)
    return None


def _build(rows: list[list[Any]], path: str) -> Element:
    """Build the tree from its elements in document order, each with its depth."""
    stack: list[Element] = []
    for depth, name, attributes, place, text in rows:
        del stack[depth:]
        span, text_span = stack[-1].span if stack else Span(path, 1, 1), None
        if place is not None:
            file, line, column, text_line, text_column = place
            span = Span(file, line, column)
            text_span = Span(file, text_line, text_column) if text_line else None
        element = Element(name, attributes, span, text=text, text_span=text_span)
        if stack:
            stack[-1].children.append(element)
        stack.append(element)
    return stack[0]


_HINTS = (
    (r"unknown macro name: (\S+)", r"define the macro \1, or include the file that does"),
    (r"package://", "xacro does not read package://; write $(find PACKAGE)/… instead"),
    (r"[Nn]o such file|cannot read", "correct the path; it is relative to the file that names it"),
    (r"name '(\w+)' is not defined", r"define \1 with <xacro:property>, or correct the spelling"),
    (r"Undefined parameters \[(.*?)\]", r"give the macro: \1"),
    (r"Invalid parameter \"(.*?)\"", r"delete \1, or add it to the params of the macro"),
    (r"call each other|time or memory|does not end", "look for a macro that uses itself"),
    (r"environment variable (.*?) is not set", r"set \1 before the call"),
    (r"unbound prefix", 'add xmlns:xacro="http://www.ros.org/wiki/xacro" to <robot>'),
    (r"xacro is not installed", "pip install xacro, or apt install ros-<distribution>-xacro"),
)


def _fail(
    out: Collector, span: Span, message: str, *, hint: str = "", related: tuple[Related, ...] = ()
) -> None:
    if not hint:
        found = ((re.search(pattern, message), text) for pattern, text in _HINTS)
        hint = next(
            (match.expand(text) for match, text in found if match),
            f"`xacro {span.file}` shows the same error",
        )
    out.add("FSN119", span, f"xacro: {message}", hint=hint, related=related)
