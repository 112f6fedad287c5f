"""Text entered by people in a form: whether it is an answer, whether two names are one person."""

from __future__ import annotations

import re
import unicodedata

_PLACE_HOLDERS = r"fixme|later|na|none|open|tb[acd]|todo|unknown|x+|0x?0*"
_WITH_PRINCIPAL = re.compile(r"([^<>]*)<([A-Za-z0-9][A-Za-z0-9._%+@-]{0,253})>\s*")


def says_something(text: str) -> bool:
    """Whether a text contains a letter or a digit; spaces and invisible characters do not count."""
    return any(map(str.isalnum, text))


def holds_a_place(text: str, words: str = "") -> bool:
    """Whether a text lacks an answer: empty, ``0``, ``TBD`` and similar, by letters and digits.

    Args:
        text: Text entered by a person.
        words: Other words without an answer, as a regular expression, separated by ``|``.
    """
    return re.fullmatch(rf"(?:{_PLACE_HOLDERS}|{words})?", _plain(text)) is not None


def names_a_person(text: str) -> bool:
    """Whether a text can be the name of a person: it has two letters before any principal."""
    return sum(map(str.isalpha, without_principal(text))) >= 2


def principal_of(name: str) -> str:
    """Return the principal after a name, ``NAME <PRINCIPAL>``; empty if there is none."""
    found = _WITH_PRINCIPAL.fullmatch(name)
    return "" if found is None else found[2]


def without_principal(name: str) -> str:
    """Return the name of a person without the principal after it."""
    found = _WITH_PRINCIPAL.fullmatch(name)
    return name if found is None else found[1]


def same_person(one: str, other: str) -> bool:
    """Whether two names are equal, ignoring case, spaces, dots and the encoding of letters.

    Equal principals are one person; different principals do not prove different persons.
    """
    principal = principal_of(one).casefold()
    if principal and principal == principal_of(other).casefold():
        return True
    return _plain(without_principal(one)) == _plain(without_principal(other))


def _plain(name: str) -> str:
    text = unicodedata.normalize("NFKC", name).casefold()
    return "".join(c for c in text if c.isalnum())
