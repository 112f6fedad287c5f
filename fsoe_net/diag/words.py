"""Helpers for the wording of messages."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.diag.diagnostic import Diagnostic, Severity


def counted(number: int, word: str) -> str:
    """Return ``1 copy`` or ``2 copies``."""
    return f"{number} {noun(number, word)}"


def noun(number: float, word: str) -> str:
    """Return the word in the form required by the number: ``copy`` or ``copies``."""
    if number == 1:
        return word
    stem = word[:-1]
    is_ies = word.endswith("y") and stem[-1:] not in "aeiou"
    return f"{stem}ies" if is_ies else f"{word}s"


def listed(names: Sequence[str], most: int = 12) -> str:
    """Return names separated by commas; of many, the first ones and the number of further ones."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(names[:most])}{more}"


def summary(diagnostics: Sequence[Diagnostic]) -> str:
    """Return ``2 errors, 1 warning, 3 notes``; empty if there are none."""
    parts = []
    for level, word in (
        (Severity.ERROR, "error"),
        (Severity.WARNING, "warning"),
        (Severity.INFO, "note"),
    ):
        count = sum(d.level is level for d in diagnostics)
        if count:
            parts.append(counted(count, word))
    return ", ".join(parts)


def identity_text(vendor_id: int, product_code: int) -> str:
    """Return ``vendor 0x00000002, product 0x07703052``."""
    return f"vendor 0x{vendor_id:08x}, product 0x{product_code:08x}"
