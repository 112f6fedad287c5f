"""``fsoe-net fingerprint``: what identifies everything safety-relevant in a network or plan."""

from __future__ import annotations

import json

import click

from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import format_option
from fsoe_net.cli.terminal import echo
from fsoe_net.errors import InputError
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.plan.fingerprint import SECTIONS
from fsoe_net.project.known import Known, read_known

_EPILOG = """\b
Examples:
  fsoe-net fingerprint network.yaml
  fsoe-net fingerprint machine.fsnplan
  fsoe-net fingerprint network.yaml --format json > accepted.json
  fsoe-net fingerprint network.yaml --text copies | sha256sum

A fingerprint is not an approval: it shows that two configurations are the same, not that one is
correct."""


@click.command("fingerprint", epilog=_EPILOG)
@input_options
@format_option
@click.option(
    "--text",
    "section",
    type=click.Choice(SECTIONS),
    help="Print the canonical text of a section. Its SHA-256 is the hash of the section.",
)
def command(
    files: tuple[str, ...],
    loading: LoadOptions,
    fmt: str,
    section: str | None,
) -> None:
    """Print the fingerprint of a network or plan: short code, SHA-256, one hash per section.

    FILES: a .fsnplan, or a network as for `fsoe-net check`. Comments, key order, file names and
    dates do not change it; docs/reference/fingerprint.md lists what does.
    """
    known = read_known(files, loading)
    if section is not None:
        echo(_section(known, section), nl=False)
    elif fmt == "json":
        echo(json.dumps(known.fingerprint.to_json(), indent=2))
    else:
        echo(f"{known.fingerprint.short}\nwhole             {known.fingerprint.whole}")
        for name, digest in known.fingerprint.sections.items():
            echo(f"{name:<17} {digest}")


def _section(known: Known, name: str) -> str:
    text = known.section_text(name)
    if text is None:
        raise InputError(
            f"{known.path} holds only the hash of {name}; name the files of the network"
        )
    return text
