"""``fsoe-net explain``: the page of a diagnostic code, in the terminal."""

from __future__ import annotations

import contextlib
import re
import sys

import click
from click.shell_completion import CompletionItem

from fsoe_net.cli.terminal import echo
from fsoe_net.core.status import status_table
from fsoe_net.diag.catalogue import CATALOGUE, nearest_codes
from fsoe_net.diag.guesses import guesses, one_of
from fsoe_net.errors import CoreMissing
from fsoe_net.project.installed import shipped
from fsoe_net.rules.effects import effects_today

_EPILOG = """\b
Examples:
  fsoe-net explain FSN203
  fsoe-net explain 203
  fsoe-net explain FSN_E_BUS_SILENT"""


class _Code(click.ParamType):  # type: ignore[type-arg]
    """A diagnostic code, with completion."""

    name = "code"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        return [
            CompletionItem(code, help=info.title)
            for code, info in CATALOGUE.items()
            if code.startswith(incomplete.upper())
        ]


def page_text(code: str) -> str | None:
    """Return the Markdown page of a code, from the package or the source tree, or ``None``."""
    page = shipped("diagnostics", "docs/diagnostics") / f"{code}.md"
    return page.read_text("utf-8") if page.is_file() else None


def _other_programs(code: str) -> str:
    """Return how the programs of ``--runtime`` handle the mistake today."""
    rows = [
        f"- `{'`, `'.join(r.value for r in runtimes)}`: {text}"
        for runtimes, text in effects_today(code)
    ]
    return "\n".join(["", "", "## Other programs today", "", *rows]) if rows else ""


def _status_page(code: str) -> str:
    """Return the meaning of a status of the C core, and what to do.

    Raises:
        click.BadParameter: Unknown status.
    """
    name = "FSN_" + code.strip().upper().removeprefix("FSN_")
    rows = {row.name: row for row in status_table()}
    row = rows.get(name)
    if row is None:
        close = guesses(name, rows)
        hint = f"Did you mean {one_of(close)}?" if close else "`fsoe-net explain` lists all codes."
        raise click.BadParameter(f"no code {code!r}. {hint}", param_hint="CODE")
    return f"{row.name} ({row.value}): {row.text}\n\nNext step: {row.next_step}."


@click.command("explain", epilog=_EPILOG)
@click.argument("code", type=_Code(), required=False)
def command(code: str | None) -> None:
    """Explain a finding: meaning, reason and fix. Without CODE, list all codes.

    CODE is the code of a finding (FSN203) or a status of fsn-master and the C core
    (FSN_E_BUS_SILENT).
    """
    if code is None:
        for info in CATALOGUE.values():
            echo(f"{info.code}  {info.severity:7}  {info.title}")
        # The codes of Python are listed even if the C core is missing.
        with contextlib.suppress(CoreMissing):
            for row in status_table():
                echo(f"{row.name}  {row.text}")
        return
    if re.match(r"(FSN_)?E_", code.strip().upper()):
        echo(_status_page(code))
        return
    # Bare numbers and lower case are also accepted.
    near = nearest_codes(code)
    known = next(iter(near), "")
    if known[3:] != code.strip().upper().removeprefix("FSN"):
        hint = f" Did you mean {one_of(near)}?" if near else " `fsoe-net explain` lists all codes."
        raise click.BadParameter(f"no code {code!r}.{hint}", param_hint="CODE")
    text = page_text(known)
    if text is None:
        info = CATALOGUE[known]
        text = f"{known} ({info.severity}): {info.title}\n"
    text = text.rstrip("\n") + _other_programs(known)
    # Markdown is formatted on a terminal only; a pipe receives the plain text.
    if sys.stdout.isatty():
        import rich.console
        import rich.markdown

        rich.console.Console().print(rich.markdown.Markdown(text))
    else:
        echo(text)
