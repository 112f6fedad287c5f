"""What HTML and SVG share: text in them is never markup."""

from __future__ import annotations

import html

from fsoe_net.diag.printable import printable


def escape(text: str) -> str:
    """Return a text for a page: no character of it is markup, or turns the reading direction."""
    return html.escape(printable(text, keep="\n\t"))


def shortened(text: str, most: int) -> str:
    """Return a text of at most so many characters; the last is … where it was longer."""
    return text if len(text) <= most else f"{text[: most - 1]}…"


def svg_text(x: float, y: float, text: str, anchor: str, cls: str = "") -> str:
    """Return a text whose start, middle or end (``anchor``) is at a place of a picture."""
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" class="{cls}">{escape(text)}</text>'
