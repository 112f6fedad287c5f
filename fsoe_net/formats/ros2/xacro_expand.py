"""Expands xacro with the real xacro, in a child process that the kernel confines.

Request and answer are JSON, see `fsoe_net.formats.ros2.xacro_child`. Every element of the expansion
keeps the place where it was written, also through macros and includes. An expression of the file
may have written the answer: it is checked like a file of unknown origin.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from typing import IO, Any, TypeVar

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Related, Span
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.ros2.confine import can_confine, inside
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.xml_tree import Element, shown_attributes


@dataclass(frozen=True, slots=True, kw_only=True)
class XacroLimits:
    """Limits of an expansion.

    Args:
        cpu_seconds: Processor time; real robots take about one second.
        wall_seconds: Elapsed time, for files that block without computing.
        memory_bytes: Address space of the child process.
        answer_bytes: Length of the answer; 1000 elements have about 0.2 MB. This process parses it,
            in at most 25 times as much memory.
        source_bytes: Total size of the files that the answer names; this process reads them.
    """

    cpu_seconds: int = 20
    wall_seconds: float = 30.0
    memory_bytes: int = 1_500_000_000
    answer_bytes: int = 4 * 1024 * 1024
    source_bytes: int = 64 * 1024 * 1024


LIMITS = XacroLimits()
_MOST_SOURCES = 1000
_MOST_RELATED = 4
_MOST_CHARACTERS = 1000  # of a message or hint
# Needed to start an interpreter at an unusual location.
_PYTHON_NEEDS = ("LD_LIBRARY_PATH", "PYTHONHOME")
_NO_CONFINEMENT = (
    "install libseccomp2, and boot a kernel with Landlock (Linux 5.13 or newer); or pass "
    "--trust-xacro if you trust the file like a program"
)
_T = TypeVar("_T")
_CHILD = "from fsoe_net.formats.ros2.xacro_child import main; main()"


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
    path: str, out: Collector, options: LoadOptions, *, calls: Sequence[str] = ()
) -> Element | None:
    """Expand a file.

    Args:
        path: The xacro file.
        out: Takes FSN119, FSN118 for an included file, and the files that were read.
        options: Packages, arguments and environment variables that the file may use, and whether it
            is trusted.
        calls: Macros of the file that are called at its end, without parameters.

    Returns:
        The expanded document, or ``None`` with a finding.
    """
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    shares = [os.path.join(prefix, "share") for prefix in prefixes if prefix]
    readable = None
    if not options.trust_xacro:
        folders = [os.path.dirname(path), os.path.dirname(os.path.realpath(path))]
        folders += [*options.packages.values(), *shares]
        readable = list(map(os.path.abspath, folders))
    if readable is not None and not can_confine():
        message = "this machine cannot confine the expansion, and the file may hold any program"
        _fail(out, Span(path, 1, 1), message, hint=_NO_CONFINEMENT)
        return None
    request = _request(path, options, shares, readable) | {"calls": list(calls)}
    env = _child_environment()
    with tempfile.TemporaryFile() as answer:
        try:
            subprocess.run(  # noqa: S603 - our own interpreter and code, no shell
                # -P: modules in the current folder must not be imported.
                [sys.executable, "-P", "-c", _CHILD],
                input=json.dumps(request).encode(),
                stdout=answer,
                stderr=subprocess.DEVNULL,
                timeout=LIMITS.wall_seconds,
                check=False,
                env=os.environ | env if options.trust_xacro else env,
            )
            answer.seek(0)
            return _read_answer(json.loads(_bounded(answer)), path, readable, out)
        except subprocess.TimeoutExpired:
            _fail(out, Span(path, 1, 1), f"it does not end within {LIMITS.wall_seconds:g} s")
        except OSError as exc:
            _fail(out, Span(path, 1, 1), f"its process cannot be started: {exc.strerror or exc}")
        except (ValueError, TypeError, LookupError, AttributeError, RecursionError):
            # No answer, or a truncated one: the kernel ended the child at a limit.
            _fail(out, Span(path, 1, 1), "it needs more time or memory than is allowed")
    return None


def _bounded(answer: IO[bytes]) -> bytes:
    """Return a complete answer; for a trusted file the kernel does not enforce the limit.

    Raises:
        ValueError: The answer is too long.
    """
    data = answer.read(LIMITS.answer_bytes + 1)
    if len(data) > LIMITS.answer_bytes:
        raise ValueError("too long")
    return data


def _child_environment() -> dict[str, str]:
    env = {name: os.environ[name] for name in _PYTHON_NEEDS if name in os.environ}
    env["PYTHONPATH"] = os.pathsep.join(p for p in sys.path if p)
    return env


def _request(
    path: str, options: LoadOptions, shares: list[str], readable: list[str] | None
) -> dict[str, Any]:
    """Return the request to the child; ``readable`` is ``None`` for a trusted file."""
    given = os.environ if options.trust_xacro else options.xacro_env
    return {
        "file": path,
        # xacro would resolve a relative folder from the file that names the package.
        "packages": {name: os.path.abspath(d) for name, d in options.packages.items()},
        "arguments": dict(options.xacro_args),
        "env": {name: os.environ[name] for name in given if name in os.environ},
        "withheld": [name for name in os.environ if name not in given],
        "shares": shares,
        "readable": readable,
        "limits": asdict(LIMITS),
    }


def _read_answer(
    answer: dict[str, Any], path: str, readable: list[str] | None, out: Collector
) -> Element | None:
    """Return the expansion in an answer.

    Raises:
        ValueError, TypeError, LookupError: The answer does not have the form that the child writes.
    """
    read = Collector()
    left = LIMITS.source_bytes
    for file in _list_of(str, answer["sources"])[:_MOST_SOURCES]:
        # A path that the child could not read is not a source; its error is reported.
        if readable is None or inside(file, readable):
            left -= len(read_bytes(file, read, most=left) or b"")
    out.sources += [row for row in read.sources if row not in out.sources]
    known = {path, *(row.path for row in read.sources)}
    error = answer.get("error")
    if error is None:
        return _build(answer["rows"], path, known)
    span = _span(error["place"], known) if error["place"] else Span(path, 1, 1)
    message, hint = _text(error["message"]), _text(error["hint"])
    if error["code"] == "FSN118":
        out.add("FSN118", span, message, hint=hint)
        return None
    related = tuple(
        Related(span=_span(place, known), message=f"expanded from <{_text(name)}> here")
        for *place, name in error["via"][:_MOST_RELATED]
    )
    _fail(out, span, message, hint=hint, related=related)
    return None


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{type(value)} instead of a text")
    return value[:_MOST_CHARACTERS]


def _list_of(kind: type[_T], values: object) -> list[_T]:
    if not isinstance(values, list) or not all(type(value) is kind for value in values):
        raise TypeError(f"not a list of {kind}")
    return values


def _span(place: Sequence[object], known: set[str]) -> Span:
    """Return a place in one of the files that were read."""
    file, line, column = place
    if file not in known or type(line) is not int or type(column) is not int:
        raise ValueError("a place that no file has")
    return Span(str(file), line, column)


def _build(rows: list[Any], path: str, known: set[str]) -> Element:
    """Build the tree from its elements in document order, each with its depth."""
    stack: list[Element] = []
    for depth, name, attributes, place, text in rows:
        if not (0 < depth <= len(stack)) and (depth != 0 or stack):
            raise ValueError("an element that hangs on nothing")
        _list_of(str, [name, text, *attributes, *attributes.values()])
        del stack[depth:]
        span, text_span = stack[-1].span if stack else Span(path, 1, 1), None
        if place is not None:
            file, line, column, text_line, text_column = place
            span = _span((file, line, column), known)
            text_span = _span((file, text_line, text_column), known) if text_line else None
        element = Element(name, shown_attributes(attributes), span, text=text, text_span=text_span)
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
    (
        r"call each other|time or memory|does not end|is longer than",
        "look for a macro that uses itself",
    ),
    (r"environment variable '(.*?)' is not set", r"set \1 before the call, and pass --env \1"),
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
