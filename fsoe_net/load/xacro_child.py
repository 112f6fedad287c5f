"""Runs the real xacro in a process of its own; started by `fsoe_net.load.xacro_expand`.

Reads a JSON request from standard input, writes a JSON answer to standard output. Every element of
the sources gets a number before xacro sees it, so that the expansion knows where each came from,
also through macros and includes.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import xml.dom.minidom
from typing import Any
from xml.dom import expatbuilder

MARK = "fsn-at"
CPU_SECONDS = 20
MEMORY_BYTES = 1_500_000_000


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_SECONDS, CPU_SECONDS))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    sys.setrecursionlimit(2000)


class _Places:
    """The table of places and the files that were read."""

    def __init__(self) -> None:
        self.table: list[tuple[str, int, int]] = []
        self.files: list[str] = []

    def parse(self, data: bytes, file: str) -> xml.dom.minidom.Document:
        self.files.append(file)
        document: xml.dom.minidom.Document = _Builder(self.table, file).parseString(data)
        return document


class _Builder(expatbuilder.ExpatBuilderNS):
    """minidom's own builder, which numbers each element in passing."""

    def __init__(self, table: list[tuple[str, int, int]], file: str) -> None:
        super().__init__()
        self._table = table
        self._file = file

    def start_element_handler(self, name: str, attributes: Any) -> None:
        super().start_element_handler(name, attributes)
        element = self.curNode
        # xacro refuses unknown attributes of its own tags.
        if isinstance(element, xml.dom.minidom.Element) and not element.tagName.startswith(
            "xacro:"
        ):
            element.setAttribute(MARK, str(len(self._table)))
        parser = self.getParser()
        self._table.append((self._file, parser.CurrentLineNumber, parser.CurrentColumnNumber + 1))

    def start_doctype_decl_handler(self, *_arguments: object) -> None:
        raise ValueError("a document type is declared; entities are not used in a description")


def _expand(request: dict[str, Any], places: _Places) -> str:
    import xacro

    original = xacro.parse

    def parse(inp: Any, filename: str | None = None) -> Any:
        if inp is not None or filename is None:
            return original(inp, filename)
        with open(filename, "rb") as file:
            return places.parse(file.read(), filename)

    packages = request["packages"]

    def find(name: str) -> str:
        if name in packages:
            return str(packages[name])
        for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(":"):
            share = os.path.join(prefix, "share", name)
            if prefix and os.path.isdir(share):
                return share
        raise LookupError(f"package {name!r} is not known; pass --package {name}=DIR")

    xacro.parse = parse
    from xacro import substitution_args

    substitution_args._eval_find = find
    document = xacro.process_file(request["file"], mappings=dict(request["arguments"]))
    text: str = document.toxml()
    return text


def main() -> None:
    """Answer one request."""
    _limit()
    request = json.load(sys.stdin)
    answer_to = os.dup(1)
    os.dup2(2, 1)  # what xacro prints must not mix with the answer
    places = _Places()
    answer: dict[str, Any] = {}
    try:
        answer["text"] = _expand(request, places)
    except MemoryError:
        answer["error"] = "it needs more memory than is allowed"
    except RecursionError:
        answer["error"] = "macros call each other without end"
    except Exception as exc:
        message = str(exc) or type(exc).__name__
        answer["error"] = message.strip().splitlines()[0][:500]
        answer["files"] = _stack_files()
    answer["table"] = places.table
    answer["read"] = places.files
    with os.fdopen(answer_to, "w", encoding="utf-8") as pipe:
        json.dump(answer, pipe)


def _stack_files() -> list[str]:
    """Return the files xacro was in when it failed, innermost first."""
    import xacro

    stack = getattr(xacro, "filestack", None) or []
    return [f for f in reversed(stack) if isinstance(f, str)]


if __name__ == "__main__":
    main()
