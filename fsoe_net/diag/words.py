"""Words of messages."""

from __future__ import annotations

__all__ = ["counted"]


def counted(number: int, word: str) -> str:
    """Return ``1 copy`` or ``2 copies``."""
    if number == 1:
        return f"1 {word}"
    stem = word[:-1]
    is_ies = word.endswith("y") and stem[-1:] not in "aeiou"
    return f"{number} {stem}ies" if is_ies else f"{number} {word}s"
