"""Expands xacro with the real xacro, in a child process with limits on time and memory."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from typing import Any

from fsoe_net.diag import Span
from fsoe_net.load.files import Collector, read_bytes
from fsoe_net.load.xacro_child import MARK
from fsoe_net.load.xml_tree import Element, parse_xml

__all__ = ["expand_xacro", "uses_xacro"]

_TIMEOUT_SECONDS = 30


def uses_xacro(root: Element) -> bool:
    """Whether a document needs expansion: xacro tags, ``${…}`` or ``$(…)`` anywhere."""
    for element in root.walk():
        texts = [element.text, *element.attributes.values()]
        if element.name.startswith("xacro:") or any("${" in t or "$(" in t for t in texts):
            return True
    return False


def expand_xacro(
    path: str, out: Collector, *, packages: Mapping[str, str], arguments: Mapping[str, str]
) -> Element | None:
    """Return the expanded document with the original places, or ``None`` with FSN119."""
    request = {"file": path, "packages": dict(packages), "arguments": dict(arguments)}
    try:
        done = subprocess.run(
            [sys.executable, "-m", "fsoe_net.load.xacro_child"],
            input=json.dumps(request).encode(),
            capture_output=True,
            timeout=_TIMEOUT_SECONDS,
            check=False,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        )
    except subprocess.TimeoutExpired:
        _fail(out, path, f"it does not end within {_TIMEOUT_SECONDS} s", None)
        return None
    try:
        answer: dict[str, Any] = json.loads(done.stdout)
    except ValueError:
        why = "it needs more time or memory than is allowed; do macros call each other?"
        _fail(out, path, why, None)
        return None
    for file in answer["read"][1:]:
        read_bytes(file, out)
    if "error" in answer:
        _fail(out, path, answer["error"], answer)
        return None
    root = parse_xml(answer["text"].encode(), path, out)
    if root is not None:
        _restore_places(root, answer["table"])
    return root


def _restore_places(root: Element, table: list[list[Any]]) -> None:
    """Give every element its place in the sources; text is placed right behind its start tag."""
    for element in root.walk():
        number = element.attributes.pop(MARK, None)
        if number is not None:
            file, line, column = table[int(number)]
            element.span = Span(file, line, column)
        element.text_span = None


def _fail(out: Collector, path: str, message: str, answer: dict[str, Any] | None) -> None:
    file = next(iter(answer.get("files", [])), path) if answer else path
    span, hint = _place_of(file, message)
    out.add("FSN119", span, f"xacro: {message}", hint=hint)


_HINTS = (
    (r"pass --package", "pass --package NAME=DIR once for each package that $(find …) names"),
    (r"[Uu]ndefined substitution argument (\S+)", r"pass --arg \1:=VALUE"),
    (r"unknown macro name: (\S+)", r"define the macro \1, or include the file that does"),
    (r"No such file", "check the path of the xacro:include"),
    (r"name '(\w+)' is not defined", r"define \1 with <xacro:property> or <xacro:arg>"),
    (r"without end|more time", "look for a macro that uses itself"),
)


def _place_of(file: str, message: str) -> tuple[Span, str]:
    """Find what xacro complains about in the source; xacro itself names no line."""
    hint = next(
        (m.expand(text) for pattern, text in _HINTS if (m := re.search(pattern, message))),
        "`xacro FILE` shows the same error",
    )
    try:
        with open(file, "rb") as source:
            lines = source.read(1 << 20).decode("utf-8", "replace").splitlines()
    except OSError:
        return Span(file, 1, 1), hint
    for word in re.findall(r"[\w:./-]{3,}", message):
        for number, line in enumerate(lines, start=1):
            at = line.find(f"<{word}")
            if at < 0 and ("$" in line or "xacro:" in line):
                at = line.find(word)
            if at >= 0:
                return Span(file, number, at + 1), hint
    return Span(file, 1, 1), hint
