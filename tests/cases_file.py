"""Writes files of cases that a person reads: long texts as blocks."""

from __future__ import annotations

from pathlib import Path

import yaml

DIAGNOSTICS = Path(__file__).parent / "diagnostics"


class _Dumper(yaml.SafeDumper):
    pass


def _text(dumper: yaml.SafeDumper, value: str) -> yaml.Node:
    style = "|" if "\n" in value else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", value, style=style)


_Dumper.add_representer(str, _text)


def write_cases(path: Path, cases: object, test: str) -> None:
    """Write cases; the head names the test that holds them."""
    whole = yaml.dump(cases, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100000)
    path.write_text(f"# See {test}.\n{whole}", "utf-8")
