"""Whether words name where a figure comes from: a word that holds its place is no answer."""

from __future__ import annotations

import re
import unicodedata

from fsoe_net.model.written import holds_a_place

# Wherever one stands, nobody answers yet: "tbd by the maker", "manual 3.0?", "to be checked".
_OPEN = re.compile(
    r"\?|\b(?:tb[acd]|todo|fixme|guess\w*|na|unknown|unclear|unverified|placeholder|pending"
    r"|x{3,}|no (?:source|idea)"
    r"|to be (?:\w+ )?(?:added|agreed|announced|asked|checked|clarified|confirmed|defined"
    r"|determined|done|looked|measured|provided|read|stated|verified)"
    r"|not (?:\w+ )?(?:applicable|available|checked|clear|confirmed|defined|known|stated"
    r"|verified))\b"
)
# Of a source that says nothing else nobody can look anything up: "my own estimate", "as assumed".
_NO_SOURCE = re.compile(
    r"approx\w*|assum\w*|author|best|conservative|custom\w*|dummy|engineering|estimat\w*|experience|figure"
    r"|good|judg\w*|later|me|missing|myself|no|none|nothing|open|own|rough|rule|safe|self|source"
    r"|standard|thumb|typical|usual|value|worst|yet|zero"
    r"|an?|and|are|as|at|be|by|case|for|from|i|is|it|just|my|not|of|on|only|or|our|still|that|the"
    r"|this|to|very|we"
)


def names_a_source(text: str) -> bool:
    """Whether somebody can look up where a figure, or a reason, comes from.

    Case, punctuation and other words around a word that holds a place do not count; figures alone
    are no source either. It is no proof: whether the source says so is for people to read.
    """
    plain = _plain(text)
    if _OPEN.search(plain):
        return False
    words = re.findall(r"[^\W_]+", plain)
    said = "".join(w for w in words if not _NO_SOURCE.fullmatch(w))
    return sum(map(str.isalpha, said)) >= 2 and not holds_a_place(said)


def names_a_revision(text: str) -> bool:
    """Whether a manual is named, by its revision alone: ``3.0`` is one, ``0`` is none."""
    return _OPEN.search(_plain(text)) is None and not holds_a_place(text)


def _plain(text: str) -> str:
    """Return a text in one spelling: ``T.B.D.`` is ``tbd``, ``n/a`` is ``na``."""
    folded = unicodedata.normalize("NFKC", text).casefold()
    return re.sub(r"\b([^\W\d_])[ ./\-]+(?=[^\W\d_]\b)", r"\1", folded)
