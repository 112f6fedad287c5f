"""Values as words and lines of YAML that YAML 1.1 and 1.2 read in the same way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import yaml

from fsoe_net.formats.shared.yaml_parts import plain_value

_LONGEST = 100
_NO_LIMIT = 2**31 - 1
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


class Hex(int):
    """A number written with eight hexadecimal digits, like vendor IDs and revisions."""


def scalar(value: Any, *, like: str = "", is_in_brackets: bool = False) -> str:
    """Return a scalar on one line.

    Args:
        value: The scalar.
        like: The previous text: the new one keeps its quotes or hexadecimal digits.
        is_in_brackets: Whether it is in a list or map in brackets.

    Raises:
        yaml.YAMLError: The value cannot be represented in YAML.
    """
    if isinstance(value, Hex):
        return f"0x{value:08x}"
    if like.startswith("0x") and type(value) is int and value >= 0:
        digits = like[2:]
        return f"0x{value:0{len(digits)}{'X' if digits.isupper() else 'x'}}"
    quote = like[:1] if isinstance(value, str) and like[:1] in ("'", '"') else None
    if isinstance(value, str) and ("\n" in value or not (quote or _is_text(value))):
        quote = '"'
    # In brackets, more words need quotes, so the value is dumped in a list and extracted from it.
    text = yaml.dump(
        [value] if is_in_brackets else value,
        Dumper=_DUMPER,
        default_style=quote,
        default_flow_style=True,
        allow_unicode=True,
        width=_NO_LIMIT,
    ).removesuffix("\n")
    # PyYAML ends a bare scalar with the mark of the document end.
    return text[1:-1] if is_in_brackets else text.removesuffix("\n...")


def _is_text(value: str) -> bool:
    """Whether a reader of YAML 1.2 also takes the word for a text."""
    return isinstance(plain_value(value), str)


def in_brackets(value: Any) -> str:
    """Return any value on one line.

    Raises:
        yaml.YAMLError: The value cannot be represented in YAML.
    """
    if isinstance(value, dict):
        pairs = (f"{in_brackets(key)}: {in_brackets(each)}" for key, each in value.items())
        return f"{{{', '.join(pairs)}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(in_brackets(each) for each in value)}]"
    return scalar(value, is_in_brackets=True)


def in_lines(
    value: Any, column: int, under_key: Mapping[type, int], *, has_short: bool = True
) -> list[str]:
    """Return a non-empty map or list, one line for each key and item.

    Args:
        value: The map or list.
        column: Column of its keys or dashes.
        under_key: Indentation of a `dict` and of a `list` under a key.
        has_short: Whether an item of this list that is a short map of scalars is written on one
            line.

    Raises:
        yaml.YAMLError: The value cannot be represented in YAML.
    """
    pad, lines = " " * column, []
    if isinstance(value, dict):
        for key, each in value.items():
            word = f"{pad}{scalar(key)}:"
            if isinstance(each, dict | list | tuple) and each:
                kind = dict if isinstance(each, dict) else list
                lines += [word, *in_lines(each, column + under_key[kind], under_key)]
            else:
                lines.append(f"{word} {in_brackets(each) if is_empty(each) else scalar(each)}")
        return lines
    for each in value:
        if is_empty(each) or (has_short and _is_short_map(each)):
            lines.append(f"{pad}- {in_brackets(each)}")
        elif isinstance(each, dict | list | tuple):
            inner = in_lines(each, column + 2, under_key)
            lines += [f"{pad}- {inner[0].lstrip(' ')}", *inner[1:]]
        else:
            lines.append(f"{pad}- {scalar(each)}")
    return lines


def is_empty(value: Any) -> bool:
    """Whether a value is an empty map or list."""
    return isinstance(value, dict | list | tuple) and not value


def _is_short_map(value: Any) -> bool:
    """Whether a value is a map of scalars that fits on one line."""
    if not isinstance(value, dict) or any(
        isinstance(v, dict | list | tuple) for v in value.values()
    ):
        return False
    return sum(len(str(key)) + len(str(each)) + 4 for key, each in value.items()) <= _LONGEST
