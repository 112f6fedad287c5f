"""Bounded, printable texts: names of SubDevices and connections come from files and devices."""

from __future__ import annotations

from collections.abc import Iterable

from fsoe_net.diag.printable import printable
from fsoe_net.fsoe.pdu import ResetCode

LABEL_CHARS = 128
"""Longest text of a label; the path of a Unix socket always fits."""

_CODES: dict[int | None, str] = {int(code): code.name.lower() for code in ResetCode}
RESET_CODES = (*_CODES.values(), "other")
"""Names of reset codes; ``other`` for codes of a device."""


def reset_code_name(code: int | None) -> str:
    """Return one of `RESET_CODES`."""
    return _CODES.get(code, RESET_CODES[-1])


def bounded(text: str) -> str:
    """Return a printable text of at most `LABEL_CHARS` characters."""
    return printable(text[:LABEL_CHARS])[:LABEL_CHARS]


def distinct_labels(names: Iterable[str]) -> list[str]:
    """Return a label for each name; names that become equal get a number.

    Prometheus rejects all metrics of a reply in which two of them have the same labels.
    """
    labels: list[str] = []
    used: set[str] = set()
    numbers: dict[str, int] = {}
    for name in names:
        base = label = bounded(name)
        while label in used:
            numbers[base] = numbers.get(base, 1) + 1
            mark = f"~{numbers[base]}"
            label = base[: LABEL_CHARS - len(mark)] + mark
        used.add(label)
        labels.append(label)
    return labels
