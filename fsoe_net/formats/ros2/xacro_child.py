"""Runs the real xacro in a separate process; started by `fsoe_net.formats.ros2.xacro_expand`.

Reads a JSON request from standard input, writes a JSON answer to standard output. Every element
gets its place as DOM user data before xacro sees it. minidom passes user data on when xacro clones
macro bodies and blocks, so the place of each element survives the expansion.

The file may be hostile, and its expressions have access to the whole interpreter. The kernel
therefore confines this process before it reads the file (`fsoe_net.formats.ros2.confine`): it reads
files in a few folders and writes its answer. Processor time, memory and the length of the answer
are bounded.
"""

from __future__ import annotations

import glob
import json
import os
import re
import resource
import signal
import sys
import xml.dom.minidom
from types import FrameType, SimpleNamespace, TracebackType
from typing import Any
from xml.dom import Node
from xml.parsers.expat import ExpatError

from fsoe_net.formats.ros2.confine import confine, end_with_parent, inside, python_folders
from fsoe_net.formats.ros2.xacro_macros import MACRO
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.xml_tree import Element, parse_xml

_PLACE = "fsn-place"
_TEXT_NODES = (Node.TEXT_NODE, Node.CDATA_SECTION_NODE)

Place = tuple[str, int, int, int, int]  # file, line, column; line and column of the text, or 0, 0


class _TimeUp(BaseException):
    """The processor time is used up. Not an Exception, because xacro swallows some of those."""


class _Refused(Exception):
    """A finding that is already complete."""

    def __init__(
        self, code: str, message: str, hint: str, place: tuple[str, int, int] | None
    ) -> None:
        super().__init__(message)
        self.answer: dict[str, Any] = {
            "code": code,
            "message": message,
            "hint": hint,
            "place": place,
            "via": [],
        }


class _Unknown(LookupError):
    """Unknown package."""


class _Withheld(LookupError):
    """An environment variable that is set, but not available to the file."""


class _Outside(Exception):
    """A file outside the folders that may be read."""


class _Carry:
    """DOM user data handler: gives a clone the place of its original."""

    def handle(self, _operation: int, key: str, data: Place, _source: Any, clone: Any) -> None:
        if clone is not None:
            clone.setUserData(key, data, self)


def _limit(limits: dict[str, Any]) -> None:
    def time_up(_signal: int, _frame: FrameType | None) -> None:
        raise _TimeUp

    signal.signal(signal.SIGXCPU, time_up)
    seconds = int(limits["cpu_seconds"])
    for what, soft, hard in (
        # The soft limit leaves a second for the answer; the hard one kills.
        (resource.RLIMIT_CPU, seconds, seconds + 1),
        (resource.RLIMIT_AS, limits["memory_bytes"], limits["memory_bytes"]),
        (resource.RLIMIT_FSIZE, limits["answer_bytes"], limits["answer_bytes"]),
        (resource.RLIMIT_CORE, 0, 0),
    ):
        top = resource.getrlimit(what)[1]
        if top != resource.RLIM_INFINITY:
            soft, hard = min(soft, top), min(hard, top)
        resource.setrlimit(what, (soft, hard))


class _Xacro:
    """The xacro module with replaced file access, package search and expressions."""

    def __init__(self, request: dict[str, Any]) -> None:
        import xacro
        import yaml  # noqa: F401 - xacro imports it when first used, too late for the limits
        from xacro import substitution_args

        self._read: list[str] = []
        self._request = request
        self._calls: list[str] = request["calls"]  # in the first file, which is the named one
        self._xacro: Any = xacro
        self._parse = xacro.parse
        xacro.parse = self._parse_file
        xacro.glob = SimpleNamespace(glob=self._glob)
        for name, function in (("find", self._find), ("env", self._env), ("optenv", self._optenv)):
            setattr(substitution_args, f"_eval_{name}", function)
            substitution_args._eval_dict[name] = function

    def expand(self) -> list[list[Any]]:
        document = self._xacro.process_file(
            self._request["file"], mappings=dict(self._request["arguments"]), verbosity=0
        )
        return _rows(document.documentElement)

    def sources(self) -> list[str]:
        """Return every file that was read, including YAML loaded by expressions."""
        return list(dict.fromkeys([*self._read, *self._xacro.all_includes]))

    def _parse_file(self, inp: Any, filename: str | None = None) -> Any:
        if inp is not None or filename is None:
            return self._parse(inp, filename)
        self._check_place(filename)
        out = Collector()
        data = read_bytes(filename, out)
        self._read += [row.path for row in out.sources]
        if data is None:
            # As in xacro itself: otherwise messages would name this file as the one in process.
            self._xacro.filestack.pop()
            message = out.diagnostics[0].message
            # xacro ignores exactly this exception for an optional include.
            raise self._xacro.XacroException(message, exc=OSError(""))
        root = parse_xml(data, filename, out)
        if root is None:
            bad = out.diagnostics[0]
            place = (bad.span.file, bad.span.line, bad.span.column)
            raise _Refused(bad.code, bad.message, bad.hint, place)
        try:
            document = xml.dom.minidom.parseString(data)  # noqa: S318 - parse_xml refused DTDs
        except ExpatError as exc:
            place = (filename, exc.lineno, exc.offset + 1)
            raise _Refused("FSN119", str(exc).partition(":")[0], "", place) from exc
        _mark(document, root)
        calls, self._calls = self._calls, []
        _add_calls(document, calls)
        return document

    def _check_place(self, path: str) -> None:
        folders = self._request["readable"]
        if folders is not None and not inside(path, folders):
            raise _Outside(path)

    def _glob(self, pattern: str) -> list[str]:
        fixed = re.split(r"[*?[]", pattern, maxsplit=1)[0]
        self._check_place(os.path.dirname(fixed) or ".")
        return glob.glob(pattern)

    def _find(self, name: str) -> str:
        packages = self._request["packages"]
        if name in packages:
            return str(packages[name])
        for share in self._request["shares"]:
            folder = os.path.join(share, name)
            if os.path.isdir(folder):
                return folder
        raise _Unknown(name)

    def _env(self, name: str) -> str:
        if name in self._request["env"]:
            return str(self._request["env"][name])
        if name in self._request["withheld"]:
            raise _Withheld(name)
        raise LookupError(f"environment variable {name!r} is not set")

    def _optenv(self, name: str, default: str = "") -> str:
        known = name in self._request["env"] or name in self._request["withheld"]
        return self._env(name) if known else default


def _mark(document: xml.dom.minidom.Document, root: Element) -> None:
    """Give each DOM element the place that the located tree has for it."""
    carry = _Carry()
    for node, element in zip(document.getElementsByTagName("*"), root.walk(), strict=True):
        text = element.text_span
        at = (text.line, text.column) if text is not None else (0, 0)
        place: Place = (element.span.file, element.span.line, element.span.column, *at)
        node.setUserData(_PLACE, place, carry)


def _add_calls(document: Any, names: list[str]) -> None:
    """Call macros at the end of a document; the calls have the places of the macros."""
    for macro in document.getElementsByTagName(MACRO):
        name = macro.getAttribute("name").removeprefix("xacro:")
        if name in names:
            call = document.createElement(f"xacro:{name}")
            call.setUserData(_PLACE, macro.getUserData(_PLACE), _Carry())
            document.documentElement.appendChild(call)


def _rows(root: Any) -> list[list[Any]]:
    """Return the elements in document order: depth, name, attributes, place, own text."""
    rows: list[list[Any]] = []
    stack = [(root, 0)]
    while stack:
        node, depth = stack.pop()
        texts = [c.data for c in node.childNodes if c.nodeType in _TEXT_NODES]
        # xacro also omits blanks next to other nodes.
        text = "".join(t for t in texts if not t.isspace())
        attributes = dict(node.attributes.items())
        rows.append([depth, node.tagName, attributes, node.getUserData(_PLACE), text])
        below = [c for c in node.childNodes if c.nodeType == Node.ELEMENT_NODE]
        stack.extend((c, depth + 1) for c in reversed(below))
    return rows


def _where(traceback: TracebackType | None) -> list[tuple[str, int, int, str]]:
    """Return the active elements of xacro, innermost first: place and tag."""
    found: list[tuple[str, int, int, str]] = []
    while traceback is not None:
        frame = traceback.tb_frame
        node = frame.f_locals.get("node") if frame.f_code.co_name == "eval_all" else None
        if isinstance(node, xml.dom.minidom.Node):
            text = node.nodeType in _TEXT_NODES
            owner: Any = node.parentNode if text else node
            place = owner.getUserData(_PLACE) if owner is not None else None
            if place is not None:
                file, line, column, text_line, text_column = place
                at = (text_line, text_column) if text and text_line else (line, column)
                row = (file, *at, owner.tagName)
                if row not in found[:1]:
                    found.insert(0, row)
        traceback = traceback.tb_next
    return found


def _chain(exc: BaseException) -> list[BaseException]:
    """Return an exception and all its causes."""
    chain: list[BaseException] = []
    todo: list[BaseException | None] = [exc]
    while todo:
        one = todo.pop()
        if one is not None and one not in chain and len(chain) < 100:
            chain.append(one)
            todo += [one.__context__, one.__cause__, getattr(one, "exc", None)]
    return chain


def _path_outside(cause: BaseException, readable: list[str] | None) -> str | None:
    """Return the path that an error is about, if the file may not read it."""
    if isinstance(cause, _Outside):
        return str(cause.args[0])
    # The kernel denies files that an expression opens, or makes them appear missing.
    if not isinstance(cause, OSError) or cause.filename is None or readable is None:
        return None
    path = str(cause.filename)
    return None if inside(path, readable) else path


def _explain(exc: BaseException, readable: list[str] | None) -> dict[str, Any]:
    where = _where(exc.__traceback__)
    message, hint = " ".join(str(exc).split())[:500] or type(exc).__name__, ""
    for cause in _chain(exc):
        if isinstance(cause, _Refused):
            return cause.answer
        if isinstance(cause, _Unknown):
            name = cause.args[0]
            message, hint = f"package {name!r} is not known", f"pass --package {name}=DIR"
        elif isinstance(cause, _Withheld):
            name = cause.args[0]
            message = f"environment variable {name!r} is set, but this file may not read it"
            hint = f"pass --env {name} if it may"
        elif (path := _path_outside(cause, readable)) is not None:
            message = f"{path!r} is outside the folders that this file may read"
            hint = f"pass --package NAME={os.path.dirname(path) or '.'} if it may"
        elif type(cause).__name__ == "ArgException":
            name = str(cause)
            message, hint = f"$(arg {name}) has no value", f"pass --arg {name}:=VALUE"
        elif isinstance(cause, RecursionError):
            message, hint = "macros call each other without end", ""
        elif isinstance(cause, (_TimeUp, MemoryError)):
            message, hint = "it needs more time or memory than is allowed", ""
        else:
            continue
        break
    via = [row for row in where[1:] if row[3].startswith("xacro:")]
    return {
        "code": "FSN119",
        "message": message,
        "hint": hint,
        "place": where[0][:3] if where else None,
        "via": list(dict.fromkeys(via)),
    }


def _text_of(answer: dict[str, Any], most: int) -> str:
    text = json.dumps(answer)
    if len(text) <= most:
        return text
    message = f"its expansion is longer than {most >> 20} MiB"
    return json.dumps({"sources": [], "error": _Refused("FSN119", message, "", None).answer})


def main() -> None:
    """Answer one request."""
    request = json.load(sys.stdin)
    answer_to = os.dup(1)
    os.dup2(2, 1)  # output of xacro must not mix with the answer
    sys.dont_write_bytecode = True
    answer: dict[str, Any] = {"sources": []}
    try:
        worker = _Xacro(request)
        end_with_parent()
        _limit(request["limits"])
        try:
            if request["readable"] is not None:
                confine([*request["readable"], *python_folders()])
            answer["rows"] = worker.expand()
        except (Exception, _TimeUp) as exc:
            answer["error"] = _explain(exc, request["readable"])
        answer["sources"] = worker.sources()
    except ImportError as exc:
        answer["error"] = _explain(exc, request["readable"]) | {
            "message": f"xacro is not installed: {exc}"
        }
    with os.fdopen(answer_to, "w", encoding="utf-8") as file:
        file.write(_text_of(answer, request["limits"]["answer_bytes"]))
