"""``fsoe-net explain``: the page of a diagnostic code, in the terminal."""

from __future__ import annotations

import sys
from importlib import resources
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from fsoe_net.cli.terminal import echo
from fsoe_net.diag import CATALOGUE, nearest_code
from fsoe_net.rules import effects_today

__all__ = ["command", "page_text"]


_EPILOG = "\b\nExamples:\n  fsoe-net explain FSN203\n  fsoe-net explain 203"


class _Code(click.ParamType[str]):
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
    in_source = Path(__file__).parents[2] / "docs" / "diagnostics" / f"{code}.md"
    if in_source.is_file():  # a source tree, also when installed editable
        return in_source.read_text("utf-8")
    inside = resources.files("fsoe_net") / "diagnostics" / f"{code}.md"
    return inside.read_text("utf-8") if inside.is_file() else None


def _other_programs(code: str) -> str:
    """Return what the programs of ``--runtime`` do today with such a mistake."""
    rows = [
        f"- `{'`, `'.join(r.value for r in runtimes)}`: {text}"
        for runtimes, text in effects_today(code)
    ]
    return "\n".join(["", "", "## Other programs today", "", *rows]) if rows else ""


@click.command("explain", epilog=_EPILOG)
@click.argument("code", type=_Code(), required=False)
def command(code: str | None) -> None:
    """Say what a finding means, why it matters and how to mend it; without CODE list all codes."""
    if code is None:
        for info in CATALOGUE.values():
            echo(f"{info.code}  {info.severity:7}  {info.title}")
        return
    known = nearest_code(code)
    if known is None or known[3:] != code.strip().upper().removeprefix("FSN"):
        hint = f" Did you mean {known}?" if known else " `fsoe-net explain` lists all codes."
        raise click.BadParameter(f"no code {code!r}.{hint}", param_hint="CODE")
    text = page_text(known)
    if text is None:
        info = CATALOGUE[known]
        text = f"{known} ({info.severity}): {info.title}\n"
    text = text.rstrip("\n") + _other_programs(known)
    if sys.stdout.isatty():
        import rich.console
        import rich.markdown

        rich.console.Console().print(rich.markdown.Markdown(text))
    else:
        echo(text)
