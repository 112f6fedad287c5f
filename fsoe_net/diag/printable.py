"""Makes text of unknown origin printable: no character can control a terminal or a page."""

from __future__ import annotations

import contextlib
import unicodedata

# Unicode general categories: control, format (also bidi), surrogate, line and paragraph separator.
_HIDDEN = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
_BIDI = frozenset("\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def printable(text: str, *, keep: str = "") -> str:
    r"""Return a text in which each unprintable character is escaped, such as ``\u001b``.

    The escapes are those of JSON, so a JSON document keeps its meaning.

    Args:
        text: Text of any origin.
        keep: Characters that stay unchanged, such as line breaks in a text of several lines.
    """
    if text.isprintable():
        return text
    # A name from the machine, if the locale of the process has no UTF-8.
    with contextlib.suppress(UnicodeError):
        text = text.encode("utf-8", "surrogateescape").decode("utf-8")
    return "".join(c if c in keep or not _is_hidden(c) else _escape(c) for c in text)


def first_control(text: str) -> str:
    """Return the first character that controls a terminal or reorders a line, or an empty string.

    Line breaks and tabs are allowed. So are marks that some scripts need, such as the zero-width
    non-joiner.
    """
    if text.isprintable():
        return ""
    return next((c for c in text if c in _BIDI or _is_control(c)), "")


def _is_hidden(c: str) -> bool:
    return unicodedata.category(c) in _HIDDEN


def _is_control(c: str) -> bool:
    return c not in "\n\t" and unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp")


def _escape(c: str) -> str:
    units = c.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[i : i + 2].hex()}" for i in range(0, len(units), 2))
