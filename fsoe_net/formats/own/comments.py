"""Comments for a network file, and connections in the form that a person reads and completes."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.formats.shared.writers import plain_text, quoted
from fsoe_net.model.description import DescribedConnection

_WIDTH = 100
_TODO = {
    "address": "FSoE address of the SubInstance, from the safety project",
    "connection_id": "from the safety project; each only once",
    "watchdog_ms": "FSoE watchdog, from the safety project",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Remarks:
    """Content of comments.

    Attributes:
        head: At the top of the network file.
        subdevices: Above the rows of SubDevices, by number.
        devices: At the top of the slave YAML of SubDevices, by number.
        connections: Above each connection.
    """

    head: tuple[str, ...] = ()
    subdevices: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    devices: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    connections: tuple[tuple[str, ...], ...] = ()


def comment(texts: Iterable[str], indent: int = 0) -> list[str]:
    """Return comment lines; long text continues, indented, on the next line.

    Args:
        texts: One for each comment; an empty one is an empty line.
        indent: Columns before the ``#``.
    """
    lines = []
    for text in texts:
        inner = len(text) - len(text.lstrip())
        begin = " " * indent + "# " + " " * inner
        if not text:
            lines.append("")
            continue
        rows = textwrap.wrap(
            plain_text(text),
            _WIDTH,
            initial_indent=begin,
            subsequent_indent=begin + "  ",
            break_long_words=False,
            break_on_hyphens=False,
        )
        lines += rows
    return lines


def connection_lines(
    row: DescribedConnection, names: Sequence[str], reasons: Sequence[str]
) -> Iterator[str]:
    """Yield a connection with a comment above it and a TODO for each unknown value.

    Args:
        row: Connection whose SubDevices are both known.
        names: Names of the SubDevices.
        reasons: The comment.
    """
    yield from comment(reasons, 6)
    assert row.main is not None and row.sub is not None  # noqa: S101, PT018 - the caller looks
    yield f"      - main: {quoted(names[row.main])}"
    if row.slot is not None:
        yield f"        slot: {row.slot}"
    yield f"        sub: {quoted(names[row.sub])}"
    if row.sub_slot is not None:
        yield f"        sub_slot: {row.sub_slot}"
    for key, text in _TODO.items():
        value = getattr(row, key)
        yield f"        # {key}: TODO   {text}" if value is None else f"        {key}: {value}"
    if row.app_parameters:
        yield f'        app_parameters: "{row.app_parameters.hex(" ")}"'
    if row.unconfirmed:
        yield f"        unconfirmed: {quoted(row.unconfirmed)}"
