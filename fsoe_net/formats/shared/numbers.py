"""Numbers as spelled by the user, and their interpretation by each reader.

Two readers matter. Slave YAML is parsed by yaml-cpp (leading 0 is octal). The endpoints of the
transfer YAML are parsed by a driver function that supports only a lower-case ``0x`` and otherwise
reads decimal digits up to the first other character (`stoul`), then truncates to 16 bits. Only
spellings that every reader interprets identically are accepted; the others are reported.
"""

from __future__ import annotations

import enum
import functools
import math
import re
from collections.abc import Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import Any, TypeVar

from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.yaml_tree import MapNode, Node, ScalarNode
from fsoe_net.model.bus import Located


class Reader(enum.IntEnum):  # an integer has a fast hash
    """The grammar that applies to a number: of slave, transfer or network YAML."""

    SLAVE = enum.auto()
    ENDPOINT = enum.auto()
    OWN = enum.auto()


_MOST_TO_SAY = 0xFFFF  # a larger limit is of no interest to users
_MAX_DIGITS = 40  # Python does not convert thousands of digits; 64 bits need 20

_HEX = re.compile(r"0[xX][0-9a-fA-F]+\Z")
_DECIMAL = re.compile(r"[+-]?(0|[1-9][0-9]*)\Z")
_LEADING_ZERO = re.compile(r"[+-]?0[0-9]+\Z")


def driver_endpoint_number(text: str) -> int | None:
    """Return the result of the driver's endpoint parser for a spelling, truncated to 16 bits.

    Returns:
        The number, or ``None`` if the driver throws an exception.
    """
    trimmed = text.strip(" \t")
    if trimmed.startswith("0x"):
        # strtoul with base 16 skips a second prefix only before a hex digit: `0xg` is 0.
        match = re.match(r"\s*[+-]?(?:0[xX](?=[0-9a-fA-F]))?([0-9a-fA-F]+)", trimmed)
        base = 16
    else:
        match = re.match(r"\s*[+-]?([0-9]+)", trimmed)
        base = 10
    if match is None:
        return None
    value = int(match.group(1), base)
    # stoul accepts a minus sign and wraps around: after the cut to 16 bits, -1 is 0xffff.
    if match.group().lstrip().startswith("-"):
        value = -value
    return value & 0xFFFF


def read_int(
    node: Node | None,
    out: Collector,
    *,
    what: str,
    low: int,
    high: int,
    reader: Reader,
) -> int | None:
    """Return the number in a scalar, or ``None`` with a finding.

    Args:
        node: The value; ``None`` (missing key) returns ``None``, as the schema has reported it.
        out: Takes FSN111 … FSN114.
        what: Name of the value for messages, e.g. ``"index"``.
        low: Smallest allowed value.
        high: Largest allowed value.
        reader: Grammar of the file.
    """
    if not isinstance(node, ScalarNode):
        return None
    value = _agreed(node.text, reader)
    if value is None:
        if node.is_null:
            return None
        value = _disputed(node, out, what=what, low=low, high=high, reader=reader)
    # `-0` is within the range as a number, so the minus sign is checked on its own.
    if value is not None and (not low <= value <= high or (node.text[0] == "-" and low >= 0)):
        _out_of_range(
            value, node.text, node.span, out, what=what, low=low, high=high, reader=reader
        )
        return None
    return value


def own_int(node: MapNode, key: str, high: int, out: Collector, *, low: int = 0) -> int | None:
    """Return the number under a key of a file of fsoe-net; see `read_int`."""
    return read_int(node.get(key), out, what=key, low=low, high=high, reader=Reader.OWN)


_Record = TypeVar("_Record", bound=Located)


def record_of(
    kind: type[_Record],
    node: MapNode,
    out: Collector,
    highs: Mapping[str, int] = MappingProxyType({}),
    /,
    **values: Any,
) -> _Record:
    """Return the record for a map of a file of fsoe-net, whose keys are the names of its fields.

    Args:
        kind: Its class; missing text fields are empty.
        node: The map.
        out: Takes the findings of `own_int`.
        highs: Largest value of each number; a missing number is ``None``, or 0 if the class does
            not allow ``None``.
        values: Fields of other types, and those with another key or rule.
    """
    found: dict[str, Any] = {}
    for field in fields(kind):
        key = field.name
        if key in highs:
            number = own_int(node, key, highs[key], out)
            found[key] = 0 if number is None and field.type == "int" else number
        elif field.type == "str" and key not in values:
            found[key] = node.text(key) or ""
    return kind(span=node.span, fields=node.places(), **found, **values)


def _disputed(
    node: ScalarNode, out: Collector, *, what: str, low: int, high: int, reader: Reader
) -> int | None:
    """Report errors of a spelling; return the number if it is still unambiguous."""
    text = node.text
    if len(text) > _MAX_DIGITS:
        out.add("FSN113", node.span, f"{what} has {len(text)} digits", hint="correct the number")
    elif _LEADING_ZERO.match(text):
        return _leading_zero(text, node.span, out, what=what, reader=reader)
    elif _HEX.match(text):  # with 0X: readers agree on all others
        _misread(text, node.span, out, what=what, meant="0x" + text[2:])
    elif reader is Reader.ENDPOINT:
        _misread(text, node.span, out, what=what, meant=_meant(text))
    # The schema has already reported a value of a wrong type.
    elif node.span not in out.mistyped:
        out.add(
            "FSN112" if re.search(r"[0-9]", text) else "FSN111",
            node.span,
            f"{what} {text!r} is not an integer",
            hint=_hint_of(text, what, low, high),
        )
    return None


@functools.lru_cache(maxsize=8192)
def _agreed(text: str, reader: Reader) -> int | None:
    """Return a number whose spelling needs no remark, the usual case; otherwise ``None``."""
    if len(text) > _MAX_DIGITS:
        return None
    if _DECIMAL.match(text):
        return int(text)
    if _HEX.match(text) and not (reader is Reader.ENDPOINT and text.startswith("0X")):
        return int(text, 16)
    # yaml-cpp reads a sign before 0x; the endpoint reader would read `+0x10` as 0.
    if reader is Reader.SLAVE and text[:1] in ("+", "-") and _HEX.match(text, 1):
        return int(text, 16)
    return None


def _leading_zero(
    text: str, span: Span, out: Collector, *, what: str, reader: Reader
) -> int | None:
    decimal = int(text)
    try:
        octal = int(text, 8)
    except ValueError:
        octal = None
    # 00 … 07 are the same number in both readers.
    if octal == decimal:
        return decimal
    other = "refuses it" if octal is None else f"reads {octal}"
    slave = f"slave YAML {other}" + (" (octal)" if octal is not None else "")
    out.add(
        "FSN114",
        span,
        f"{what} {text!r} has a leading zero: {slave}, the endpoint reader of the transfer YAML "
        f"reads {decimal}",
        hint=f"write {decimal}"
        + (f" or {octal}" if octal is not None else "")
        + ", whichever is meant",
    )
    return octal if reader is Reader.SLAVE else decimal


def _misread(text: str, span: Span, out: Collector, *, what: str, meant: str) -> None:
    value = driver_endpoint_number(text)
    read = "throws an exception" if value is None else f"takes it for 0x{value:04x} ({value})"
    out.add(
        "FSN112",
        span,
        f"{what} {text!r} is misread by the driver, which {read}",
        hint=f"write {meant}" if meant else "write it as 0x6000",
    )


def _hint_of(text: str, what: str, low: int, high: int) -> str:
    """Return how to write a value that is not a number: the probable one, or the allowed ones."""
    if re.fullmatch(r"[+-]?[0-9]{1,3},[0-9]{3}", text):
        return f"write {text.replace(',', '')} if the comma separates thousands"
    if unit := re.fullmatch(r"([0-9]{1,18})\s*([µa-zA-Z]+)", text):
        return _without_unit(int(unit[1]), unit[2], what)
    if meant := _meant(text):
        return f"write {meant}"
    if re.match(r"\s*0[xX]", text):
        return "hexadecimal digits are 0 … 9 and a … f"
    if what == "index":
        return "write it as 0x6000"
    span = f", {low} … {high}" if 0 <= low < high <= _MOST_TO_SAY else ""
    return f"write a whole number{span}"


_OF_A_SECOND = {"ns": 10**9, "us": 10**6, "µs": 10**6, "ms": 10**3, "s": 1}


def _without_unit(number: int, unit: str, what: str) -> str:
    """Return how to write a number without its unit, converted if both are times."""
    own = what.rpartition("_")[2]
    if own in _OF_A_SECOND and unit in _OF_A_SECOND:
        value, rest = divmod(number * _OF_A_SECOND[own], _OF_A_SECOND[unit])
        return f"write a whole number of {own}" if rest else f"write {value}"
    if what == "size" and unit.lower() in ("b", "byte", "bytes"):
        return f"write {number}"
    if unit in ("h", "H"):
        return f"write 0x{number}"
    return "write the number alone"


def _meant(text: str) -> str:
    """Guess the number that was meant."""
    text = re.sub(r"(?<=[0-9a-fA-F])_(?=[0-9a-fA-F])", "", text)
    for pattern, base in (
        (r"\s*0[xX]\s*([0-9a-fA-F]+)(?![0-9a-zA-Z])", 16),
        (r"\s*#[xX]([0-9a-fA-F]+)", 16),
        (r"\s*([0-9a-fA-F]+)[hH]\Z", 16),
        (r"\s*0b([01]+)\Z", 2),
        (r"\s*0o([0-7]+)\Z", 8),
        (r"\s*\+?([0-9]{1,3}(?:[_'][0-9]{3})+)\Z", 10),
        (r"\s*\+?([0-9]+)(?:\.0*)?\s*\Z", 10),
    ):
        match = re.match(pattern, text)
        if match:
            value = int(re.sub("[_']", "", match.group(1)), base)
            return f"0x{value:04x}" if base == 16 else str(value)
    return ""


def _out_of_range(
    value: int,
    text: str,
    span: Span,
    out: Collector,
    *,
    what: str,
    low: int,
    high: int,
    reader: Reader,
) -> None:
    note = ""
    if reader is Reader.ENDPOINT:
        note = f"; the driver would cut it to 0x{value & 0xFFFF:04x}"
        if what == "subindex":
            note = "; the driver would never find it"
    limits = f"0x{low:x} … 0x{high:x}" if text.lower().startswith("0x") else f"{low} … {high}"
    out.add("FSN113", span, f"{what} {text} is outside {limits}{note}", hint="correct the number")


def read_float(node: Node | None, out: Collector, *, what: str) -> float | None:
    """Return a floating point number as yaml-cpp reads it, including ``nan``, or ``None``."""
    if not isinstance(node, ScalarNode) or node.is_null:
        return None
    text = node.text
    if text in _SPECIAL:
        return _SPECIAL[text]
    if re.match(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\Z", text):
        # 1e999 is infinity to Python.
        if math.isfinite(value := float(text)):
            return value
        out.add("FSN113", node.span, f"{what} is too large", hint="correct the number")
    elif node.span not in out.mistyped:
        hint = _float_hint(text, what)
        out.add("FSN111", node.span, f"{what} {text!r} is not a number", hint=hint)
    return None


def _float_hint(text: str, what: str) -> str:
    bare = text.lower().lstrip("+-")
    if bare in ("nan", "inf", ".nan"):
        sign = "-" if text[0] == "-" and bare == "inf" else ""
        return f"write {sign}.{bare.lstrip('.')}"
    if re.fullmatch(r"[+-]?[0-9]+,[0-9]+([eE][+-]?[0-9]+)?", text):
        return decimal_comma(text)
    if re.match(r"[0-9.]+\s*[µa-zA-Z]+\Z", text) and re.search(r"_(us|ms|s)\Z", what):
        return f"write the number alone; the unit is in the name {what}"
    return "write a number, such as 1000 or 1.5"


def decimal_comma(text: str) -> str:
    """Return the hint for a number with one comma: decimal point or thousands separator."""
    with_point, without = text.replace(",", "."), text.replace(",", "")
    if re.search(r",[0-9]{3}\Z", text):
        return f"write {with_point} or {without}; a comma is not part of a number"
    return f"write {with_point}; a comma is not part of a number"


def read_flag(node: Node | None, out: Collector, *, what: str, absent: bool = False) -> bool:
    """Return a boolean as yaml-cpp reads it: 1 and 0 are invalid, other words stop the driver.

    Args:
        node: The value; ``None`` (missing key) and an empty one, which the schema reports, return
            ``absent``.
        out: Takes FSN111.
        what: Name of the value for messages.
        absent: The driver's default if the key is missing.
    """
    if not isinstance(node, ScalarNode) or node.is_null:
        return absent
    for words, value in ((_TRUE, True), (_FALSE, False)):
        if node.text in words:
            return value
    out.add(
        "FSN111",
        node.span,
        f"{what} is {node.text[:60]!r}, not true or false",
        hint="write true or false",
    )
    return absent


def _spellings(*words: str) -> frozenset[str]:
    return frozenset(s for word in words for s in (word, word.capitalize(), word.upper()))


# yaml-cpp accepts lower, capitalised and upper case, but no mixture such as `tRue`.
_TRUE = _spellings("true", "yes", "on", "y")
_FALSE = _spellings("false", "no", "off", "n")

# yaml-cpp reads NaN and infinity only with the point; a bare `nan` is a text.
_SPECIAL = {
    ".nan": math.nan,
    ".NaN": math.nan,
    ".NAN": math.nan,
    ".inf": math.inf,
    ".Inf": math.inf,
    ".INF": math.inf,
    **{f"+{word}": math.inf for word in (".inf", ".Inf", ".INF")},
    **{f"-{word}": -math.inf for word in (".inf", ".Inf", ".INF")},
}


def warn_decimal_index(node: Node | None, out: Collector, value: int | None) -> None:
    """FSN115 for an object index written in decimal: nearly always a forgotten 0x."""
    if value is None or not isinstance(node, ScalarNode) or node.text[:2].lower() == "0x":
        return
    # Indices have four hex digits, so `6000` is nearly certainly one; other lengths are a remark.
    likely = len(node.text) == 4
    if value == 0 or (node.file in out.decimal_files and not likely):
        return  # one remark per file is enough
    out.decimal_files.add(node.file)
    out.add(
        "FSN115",
        node.span,
        f"index {node.text} is decimal and means 0x{value:04x}",
        severity=Severity.WARNING if likely else Severity.INFO,
        hint=f"write 0x{node.text}" if likely else f"write 0x{value:04x}",
    )
