"""``fsoe-net self-test``: try this installation with networks and runs whose results are known."""

from __future__ import annotations

import json

import click

from fsoe_net.cli.options import format_option
from fsoe_net.cli.terminal import echo, show
from fsoe_net.diag.words import counted
from fsoe_net.document.model import Column, Document, Level, Part, Table, Verdict, cell, words
from fsoe_net.self_test.model import PartResult
from fsoe_net.self_test.run import SelfTest, run_self_test

_EPILOG = """\b
Examples:
  fsoe-net self-test
  fsoe-net self-test --format json > self-test.json

Nothing is written and no interface is opened. Exit codes: 0 every part that applies here gave the
known result; 1 a part did not: do not use the output of this installation; 2 usage error."""

_LEVELS = {"pass": Level.CLEAR, "fail": Level.ERROR, "not tried": Level.OPEN}
_MOST_SHOWN = 3  # of the values of a part that differ; JSON has all
_LONGEST = 200  # characters of a value


@click.command("self-test", epilog=_EPILOG)
@format_option
@click.pass_context
def command(ctx: click.Context, fmt: str) -> None:
    """Test this installation: reference networks, recorded runs, formulas, the C core, fsn-master.

    It shows that this copy works as released on this machine. It does not show that a network is
    safe.
    """
    done = run_self_test()
    if fmt == "json":
        echo(json.dumps(done.to_json(), indent=2, ensure_ascii=False))
    else:
        show(_document(done))
    ctx.exit(0 if done.passed else 1)


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
