"""XML as saved by tools and people: UTF-16 declared as UTF-8, national encodings.

Expat supports UTF-8, UTF-16 and ISO-8859-1, trusts the declaration, and requires it in the very
first bytes. Other text is converted to UTF-8 here; lines and columns are unchanged.
"""

from __future__ import annotations

import codecs
import re

from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.formats.shared.files import Collector

_UTF16 = (
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
    (b"<\0", "utf-16-le"),
    (b"\0<", "utf-16-be"),
)
_DECLARATION = re.compile(r"\s*<\?xml[^>]*\?>")
_DECLARED = re.compile(rb"(\s*)<\?xml(?=\s)([^>]{0,300})\?>")
_ENCODING = re.compile(rb"""\sencoding\s*=\s*["']([\w.:-]{1,40})["']""")
_OF_EXPAT = {"utf-8", "utf-16", "iso8859-1", "ascii"}


def plain_xml(data: bytes) -> bytes:
    """Return the document in an ASCII-compatible encoding that expat supports.

    UTF-16, multi-byte encodings and a document after blanks are converted to UTF-8; the declaration
    is then replaced by blanks. Everything else is returned unchanged.
    """
    for mark, encoding in _UTF16:
        if data.startswith(mark):
            return _as_utf8(data.decode(encoding, "replace"))
    match = _DECLARED.match(data[:1000])
    if match is None:
        return data
    encoding = _python_name(_declared(match[2]))
    known = encoding in _OF_EXPAT
    # expat reads it unchanged, unless blanks precede the declaration.
    if not encoding or (known and not match[1]):
        return data
    try:
        return _as_utf8(data.decode(encoding))
    except (UnicodeError, LookupError):
        return data


def _declared(inside: bytes) -> bytes:
    match = _ENCODING.search(inside)
    return match[1] if match else b"utf-8"


def _python_name(declared: bytes) -> str:
    """Return Python's name of a text encoding, or an empty string if it has none."""
    try:
        known = codecs.lookup(declared.decode("ascii"))
        "".encode(known.name)  # not rot13 and the like
    except (LookupError, UnicodeError):
        return ""
    return known.name


def _as_utf8(text: str) -> bytes:
    head = _DECLARATION.match(text)
    if head:
        blanks = "".join(c if c in "\r\n" else " " for c in head[0])
        text = blanks + text[head.end() :]
    return text.encode("utf-8", "replace")


def readable_xml(data: bytes, shown: str, out: Collector) -> bytes:
    """Return the document like `plain_xml`; if it is not valid in its encoding, read ISO-8859-1.

    Args:
        data: The bytes of the file.
        shown: Its name.
        out: Takes a warning FSN118 if the text is not in the declared encoding.
    """
    data = plain_xml(data)
    match = _DECLARED.match(data[:1000])
    if match is not None and _python_name(_declared(match[2])) != "utf-8":
        return data
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as exc:
        line = data.count(b"\n", 0, exc.start) + 1
        column = exc.start - (data.rfind(b"\n", 0, exc.start) + 1) + 1
        out.add(
            "FSN118",
            Span(shown, line, column),
            "not UTF-8 text here; the file is read as ISO-8859-1",
            hint='declare it: <?xml version="1.0" encoding="ISO-8859-1"?>',
            severity=Severity.WARNING,
        )
        return _as_utf8(data.removeprefix(codecs.BOM_UTF8).decode("iso-8859-1"))
    return data
