"""Suggestions for a misspelt word: every known word that matches as well as the best one."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Sequence

_MOST_COMPARISONS = 200_000  # of two words; takes one or two seconds
_AS_WELL = 0.05  # difference in similarity below which two words match equally well
_MOST = 4  # suggestions; more would not help
_LONGEST = 200  # characters; no name is longer


class Guesses:
    """Suggestions for misspelt words, from a list that may contain tens of thousands.

    Each word is compared once. With many words, only the first ones get the slow comparison: the
    cause is then one repeated mistake, and the user needs no further suggestion.
    """

    def __init__(self, known: Iterable[str], *, cutoff: float = 0.6) -> None:
        self._cutoff = cutoff
        self._bare: dict[str, list[str]] = defaultdict(list)
        for word in dict.fromkeys(known):
            self._bare[_bare(word)].append(word)
        self._letters: dict[str, list[str]] = defaultdict(list)
        for bare in self._bare:
            self._letters["".join(sorted(bare))].append(bare)
        self._slow_left = max(_MOST_COMPARISONS // max(len(self._bare), 1), 3)
        self._answers: dict[str, tuple[str, ...]] = {}

    def of(self, word: str) -> tuple[str, ...]:
        """Return the words that may be meant, the most similar first; at most four."""
        if word not in self._answers:
            found = self._guess(_bare(word)) if len(word) <= _LONGEST else []
            words = [known for bare in found for known in self._bare[bare]]
            self._answers[word] = tuple(words) if len(words) <= _MOST else ()
        return self._answers[word]

    def _guess(self, word: str) -> list[str]:
        if word in self._bare:
            return [word]
        # Exchanged letters are the most frequent typing error and need no slow comparison.
        exchanged = self._letters.get("".join(sorted(word)))
        if exchanged is not None:
            return exchanged
        if self._slow_left <= 0:
            return []
        self._slow_left -= 1
        return self._similar(word)

    def _similar(self, word: str) -> list[str]:
        import difflib  # only for a misspelt word

        close = difflib.get_close_matches(word, self._bare, n=4 * _MOST, cutoff=self._cutoff)
        if not close:
            return []
        matcher = difflib.SequenceMatcher(b=word)
        ratios = {}
        for known in close:
            matcher.set_seq1(known)
            ratios[known] = matcher.ratio()
        least = max(ratios.values()) - _AS_WELL
        # for example drive_1 and drive_2, which are equally similar to drive_3
        row = _without_numbers(word)
        found = [k for k in close if ratios[k] >= least or _without_numbers(k) == row]
        found.sort(key=lambda k: (-ratios[k], k))
        found = [k for k in found if re.match(rf"{re.escape(word)}[^0-9]", k)] or found
        same = [k for k in found if _numbers(k) == _numbers(word)]
        return same or found


def guesses(word: str, known: Iterable[str], *, cutoff: float = 0.6) -> tuple[str, ...]:
    """Return known words similar to a word, the most similar first.

    Args:
        word: The word as written.
        known: The valid words.
        cutoff: Minimum similarity of two words, 0 to 1.
    """
    return Guesses(known, cutoff=cutoff).of(word)


def near_misses(word: str, known: Iterable[str], *, cutoff: float = 0.6) -> tuple[str, ...]:
    """Return `guesses` without names that have a part more or less, which are other things.

    ``value_hex`` is not a misspelt ``value``, and ``position`` not a misspelt ``position_offset``.
    """
    return tuple(w for w in guesses(word, known, cutoff=cutoff) if not extends(word, w))


def extends(one: str, other: str) -> bool:
    """Whether one of two names is the other with a part before or after it, not only a number."""
    short, long = sorted((_parts(one), _parts(other)), key=len)
    rest = [long[len(short) :]] * (long[: len(short)] == short)
    rest += [long[: -len(short)]] * (bool(short) and long[-len(short) :] == short)
    return any(not "".join(part).isdigit() for part in rest if part)


def one_of(words: Sequence[str]) -> str:
    """Return ``a``, ``a or b``, ``a, b or c``."""
    return " or ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


def _bare(word: str) -> str:
    return re.sub(r"[-_ ]", "", word.lower())


def _parts(name: str) -> list[str]:
    return [part for part in re.split(r"[-_ ./]", name.lower()) if part]


def _numbers(word: str) -> list[str]:
    return re.findall(r"[0-9]+", word)


def _without_numbers(word: str) -> str:
    """Return a word without its counting numbers; numbers of four digits are type numbers."""
    return re.sub(r"(?<![0-9])[0-9]{1,2}(?![0-9])", "0", word)
