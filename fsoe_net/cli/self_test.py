"""``fsoe-net doctor --self-test``: test this installation with known results."""

from __future__ import annotations

import json

from fsoe_net.cli.terminal import echo, show
from fsoe_net.diag.words import counted
from fsoe_net.document.model import Column, Document, Level, Part, Table, Verdict, cell, words
from fsoe_net.self_test.model import PartResult
from fsoe_net.self_test.run import SelfTest, run_self_test

_LEVELS = {"pass": Level.CLEAR, "fail": Level.ERROR, "not tried": Level.OPEN}
_MOST_SHOWN = 3  # of the differing values of a part; JSON has all of them
_LONGEST = 200  # characters of a value


def print_self_test(fmt: str) -> int:
    """Run the self-test, print it and return the exit code."""
    done = run_self_test()
    if fmt == "json":
        echo(json.dumps(done.to_json(), indent=2, ensure_ascii=False))
    else:
        show(_document(done))
    return 0 if done.passed else 1


def _document(done: SelfTest) -> Document:
    rows = tuple(
        (cell(part.name), cell(Verdict(part.result, _LEVELS[part.result])), cell(_about(part)))
        for part in done.parts
    )
    columns = (Column("part"), Column("result"), Column("compared", wraps=True))
    parts: list[Part] = [words(line) for line in _identity(done)]
    parts.append(Table(columns=columns, rows=rows))
    for part in done.parts:
        if part.different:
            parts += _failure(part)
    parts.append(words(_verdict(done)))
    return Document(title=f"fsoe-net {done.versions['fsoe-net']}: self-test", lead=tuple(parts))


def _identity(done: SelfTest) -> list[str]:
    lines = [", ".join(f"{name} {version}" for name, version in done.versions.items())]
    lines.append(f"build {done.build} ({counted(done.files, 'file')}, {done.kind})")
    if done.master is not None:
        lines.append(f"{done.master[0]}, SHA-256 {done.master[1]}")
    return lines


def _about(part: PartResult) -> str:
    if part.not_tried:
        return part.not_tried
    different = f", {len(part.different)} different" if part.different else ""
    return f"{counted(part.compared, 'value')}{different}"


def _failure(part: PartResult) -> list[Part]:
    head = Verdict(f"{part.name} failed", Level.ERROR)
    parts: list[Part] = [words(head, f": {part.next_step}")]
    for one in part.different[:_MOST_SHOWN]:
        parts.append(words(f"{one.what}: expected {_short(one.expected)}, got {_short(one.got)}"))
    if len(part.different) > _MOST_SHOWN:
        more = len(part.different) - _MOST_SHOWN
        parts.append(words(f"{more} more; --format json lists all"))
    return parts


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


def _verdict(done: SelfTest) -> str:
    failed = [part.name for part in done.parts if part.result == "fail"]
    missing = [part.name for part in done.parts if part.not_tried]
    tail = f"; not tried: {', '.join(missing)}" if missing else ""
    if failed:
        return f"FAILED: {', '.join(failed)}{tail}"
    return f"{counted(len(done.parts) - len(missing), 'part')} passed{tail}"
