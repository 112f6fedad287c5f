"""Type words of the slave YAML, and the number of bits of each in the PDO."""

from __future__ import annotations

import re

from fsoe_net.diag.diagnostic import Span
from fsoe_net.diag.guesses import extends, guesses, one_of
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.type_words import DRIVER_WORD, TYPE_BITS


def type_bits(word: str, span: Span, out: Collector) -> int | None:
    """Return the length in bits of a type word.

    A word that the driver does not support, or measures wrongly, is a finding. The probable length
    is still returned, so that later offsets stay correct; ``None`` if there is no guess or several.
    """
    exact = TYPE_BITS.get(word)
    if exact is not None:
        return exact
    match = re.fullmatch(r"bit([0-9]+)", word)
    if match and not match.group(1).startswith("0"):
        return _bit_length(word, match.group(1), span, out)
    meant = _meant(word)
    reads = ""
    loose = re.search(r"bit\s*(-?[0-9]+)", word)
    if loose:
        # The driver keeps the number of bits in one byte.
        reads = f"; the driver counts {int(loose.group(1)[:9]) & 0xFF} bits"
    code = "FSN403" if loose and re.fullmatch(r"bit-?[0-9]+", word) else "FSN402"
    out.add(
        code,
        span,
        f"unknown data type {word!r}{reads}, so the offsets of all entries after it are in doubt",
        hint=_hint(word.strip().lower(), meant),
    )
    # Several words are possible; the offsets are safe only if all have one length.
    lengths = {type_bits(w, span, out) for w in meant}
    return lengths.pop() if len(lengths) == 1 else None


def _hint(word: str, meant: tuple[str, ...]) -> str:
    if meant and _BIG_ENDIAN.fullmatch(word):
        return (
            "only forks of ethercat_driver_ros2 read big-endian values; with "
            f"{one_of(meant)}, exchange the bytes where the value is used"
        )
    is_plain = word in _OF_C or _LITTLE_ENDIAN.fullmatch(word) is not None
    # An added part may mean another coding of the bytes.
    if not is_plain and any(extends(word, known) for known in (*TYPE_BITS, *DRIVER_WORD)):
        return f"look up the coding of its bytes in the manual of the device, then write {_TYPES}"
    return f"write {one_of(meant)}" if meant else f"write {_TYPES}"


def _bit_length(word: str, digits: str, span: Span, out: Collector) -> int | None:
    if len(digits) <= 3 and int(digits) <= 255:
        return int(digits)
    value = int(digits[:9])
    out.add(
        "FSN403",
        span,
        f"{word} does not fit: the driver counts only {value & 0xFF} bits",
        hint="split the gap into several channels of at most bit255",
    )
    return value if value <= 11888 else None


_TYPES = "bool, int8 … uint64, float, double or bitN"
_OF_C = frozenset(f"{word}_t" for word in TYPE_BITS)
_OF_C_AND_IEC = {"int": ("int16", "int32"), "uint": ("uint16", "uint32")}
_ORDERED = r"(u?int(?:16|32|64)|float|double|real32|real64)[ _-]?"
_BIG_ENDIAN = re.compile(_ORDERED + r"(?:be|big|big[ _-]?endian|msb|motorola|network|swap(?:ped)?)")
_LITTLE_ENDIAN = re.compile(_ORDERED + r"(?:le|little|little[ _-]?endian|lsb|intel)")


def _meant(word: str) -> tuple[str, ...]:
    """Return the type words that a word may be meant for; all have its number of bits."""
    folded = word.strip().lower()
    if folded in TYPE_BITS:
        return (folded,)
    if word in _OF_C_AND_IEC:
        return _OF_C_AND_IEC[word]
    if folded in DRIVER_WORD:
        return (DRIVER_WORD[folded],)
    number = re.fullmatch(r"(?:bits?|gap|pad)?[ _-]*([1-9][0-9]{0,2})[ _-]*(?:bits?)?", folded)
    if number and int(number.group(1)) <= 255:
        return (f"bit{number.group(1)}",)
    if ordered := _BIG_ENDIAN.fullmatch(folded) or _LITTLE_ENDIAN.fullmatch(folded):
        return (ordered[1],)
    bits = sorted(re.sub("[^0-9]", "", folded))
    close = guesses(folded, TYPE_BITS, cutoff=0.7)
    return tuple(w for w in close if sorted(re.sub("[^0-9]", "", w)) == bits)
