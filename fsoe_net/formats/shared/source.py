"""Helpers for readers of other tools' files: content, text, numbers."""

from __future__ import annotations

import os

from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.limits import MAX_FILE_BYTES
from fsoe_net.formats.shared.xml_tree import Element

Source = str | os.PathLike[str] | bytes

_MOST_FINDINGS = 500


def source_bytes(
    source: Source, out: Collector, name: str, *, most: int = MAX_FILE_BYTES
) -> tuple[bytes | None, str]:
    """Return the content and the name to show for it.

    Args:
        source: A path, or the bytes themselves.
        out: Takes FSN101 if a path cannot be read.
        name: Name shown for bytes without a file.
        most: Largest size of a file in bytes.
    """
    if isinstance(source, bytes):
        return source, name
    return read_bytes(source, out, most=most), os.fspath(source)


def text_of(data: bytes) -> str:
    """Return text from a terminal, a mail or an editor; never fails."""
    for mark, encoding in ((b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
        if data.startswith(mark):
            return data.decode(encoding, "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def esi_number(text: str) -> int | None:
    """Return the number of a ``HexDecValue``: ``#x1a00``, ``0x1A00``, ``6656`` or ``0006656``."""
    word = text.strip()
    # Python refuses to convert thousands of digits.
    if len(word) > 40:
        return None
    sign = -1 if word[:1] == "-" else 1
    word = word.removeprefix("-") if sign < 0 else word.removeprefix("+")
    digits = word[2:] if word[:2].lower() in ("#x", "0x") else word
    base = 10 if digits is word else 16
    # int() also takes underscores, blanks and digits of other scripts.
    if not digits.isascii() or not digits.isalnum():
        return None
    try:
        return sign * int(digits, base)
    except ValueError:
        return None


def xml_number(
    element: Element | None, out: Collector, *, high: int = 0xFFFFFFFF, low: int = 0
) -> int | None:
    """Return the number in an element: decimal, ``#x1a00`` or ``0x1a00``.

    Leading zeros are decimal, as in the tools that write them.

    Args:
        element: The element; ``None`` returns ``None``.
        out: Takes FSN141.
        high: Largest allowed value.
        low: Smallest allowed value.
    """
    if element is None:
        return None
    text = element.text.strip()
    value = esi_number(text)
    if value is None or not low <= value <= high:
        if len(out.diagnostics) >= _MOST_FINDINGS:
            return None
        shown = text if len(text) <= 40 else text[:37] + "..."
        why = "is not a number" if value is None else f"is outside {low} ... {high}"
        out.add(
            "FSN141",
            element.value_span,
            f"<{element.name}> {shown!r} {why}",
            hint="write 5632 or #x1600" if value is None else "correct the number",
        )
        return None
    return value
