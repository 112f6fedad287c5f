"""Type words of the slave YAML and how many bits each takes in the PDO."""

from __future__ import annotations

import difflib
import re

from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.type_words import DRIVER_WORD, TYPE_BITS

__all__ = ["type_bits"]


def type_bits(word: str, span: Span, out: Collector) -> int | None:
    """Return the length in bits of a type word.

    A word the driver does not know, or counts wrongly, is a finding. The length that was most
    probably meant is still returned, so that offsets behind the mistake stay right; ``None`` when
    nothing can be guessed.
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
        reads = f"; the driver counts {int(loose.group(1)[:9]) & 0xFF} bits"
    code = "FSN403" if loose and re.fullmatch(r"bit-?[0-9]+", word) else "FSN402"
    out.add(
        code,
        span,
        f"unknown data type {word!r}{reads}, so every offset behind it is in doubt",
        hint=f"write {meant}" if meant else "write bool, int8 … uint64, float, double or bitN",
    )
    return type_bits(meant, span, out) if meant else None


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


def _meant(word: str) -> str | None:
    folded = word.strip().lower()
    if folded in TYPE_BITS:
        return folded
    if folded in DRIVER_WORD:
        return DRIVER_WORD[folded]
    number = re.fullmatch(r"(?:bits?|gap|pad)?[ _-]*([1-9][0-9]{0,2})[ _-]*(?:bits?)?", folded)
    if number and int(number.group(1)) <= 255:
        return f"bit{number.group(1)}"
    close = difflib.get_close_matches(folded, TYPE_BITS, n=1, cutoff=0.7)
    return close[0] if close else None
