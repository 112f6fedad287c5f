"""Files that are often given and hold no description as they are: what they are, and what to do."""

from __future__ import annotations

import re

__all__ = ["NEXT_STEPS", "unreadable_kind"]

_UNPACK = "unpack it, then name the files in it"
_CAPTURE = "give captures without --from; `fsoe-net decode` shows the frames in them"
_AGAIN = "fetch the file itself; this is what came instead of it"

# How a file begins, what it is, and the next step. No kind of description begins like one of these.
_MAGIC: tuple[tuple[bytes, str, str], ...] = (
    (rb"PK\x03\x04|PK\x05\x06", "a ZIP archive", _UNPACK),
    (rb"\x1f\x8b", "a file packed with gzip", "unpack it with `gunzip`"),
    (rb"BZh[1-9]1AY", "a file packed with bzip2", "unpack it with `bunzip2`"),
    (rb"\xfd7zXZ\x00", "a file packed with xz", "unpack it with `unxz`"),
    (rb"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", _UNPACK),
    (rb"Rar!\x1a\x07", "a RAR archive", _UNPACK),
    (rb"\x0a\x0d\x0d\x0a", "a packet capture (pcapng)", _CAPTURE),
    (
        rb"\xd4\xc3\xb2\xa1|\xa1\xb2\xc3\xd4|\x4d\x3c\xb2\xa1|\xa1\xb2\x3c\x4d",
        "a packet capture (pcap)",
        _CAPTURE,
    ),
    (rb"%PDF-", "a PDF document", "give the file that it describes"),
    (
        rb"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
        "a compound document, as older editors save projects",
        "export the project as XML in its editor, and give that",
    ),
    (rb"\x7fELF|MZ[\x00-\xff]\x00", "a program", "give a file of the bus instead"),
    (rb"version https://git-lfs", "a pointer of git-lfs, not the file", "run `git lfs pull`"),
    (rb"\s*(?:<!--[\s\S]{0,500}?-->\s*)?<(?:!doctype\s+html|html)\b", "a web page (HTML)", _AGAIN),
)
_PATTERNS = tuple((re.compile(p, re.IGNORECASE if b"html" in p else 0), w) for p, w, _ in _MAGIC)
NEXT_STEPS = {words: step for _, words, step in _MAGIC}


def unreadable_kind(head: bytes) -> str:
    """Return in words which of these kinds it is, a key of `NEXT_STEPS`; empty when it is none.

    Args:
        head: The first bytes, 64 at least where the file has so many.
    """
    return next((words for pattern, words in _PATTERNS if pattern.match(head)), "")
