"""Helpers for HTML and SVG: text never becomes markup."""

from __future__ import annotations

import html

from fsoe_net.diag.printable import printable


def escape(text: str) -> str:
    """Return a text escaped for a page: no markup, no change of the reading direction."""
    return html.escape(printable(text, keep="\n\t"))


def shortened(text: str, most: int) -> str:
    """Return at most this number of characters; a longer text ends in …."""
    return text if len(text) <= most else f"{text[: most - 1]}…"


def svg_text(x: float, y: float, text: str, anchor: str, cls: str = "") -> str:
    """Return a text whose start, middle or end (``anchor``) is at this position of a picture."""
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" class="{cls}">{escape(text)}</text>'
