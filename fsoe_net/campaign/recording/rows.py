"""Lines of JSON whose values are validated before use."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from typing import Any, BinaryIO

from fsoe_net.errors import RecordingError

_MAX_LINE_BYTES = 1 << 20
_MAX_IMAGE_BYTES = 4096
_MAX_NUMBER = 10**15


def file_lines(file: BinaryIO) -> Iterator[str]:
    """Yield the lines of a file; only one is held at a time, and only the start of a long one.

    Raises:
        RecordingError: A line is not UTF-8 or too long.
    """
    number = 0
    while raw := file.readline(_MAX_LINE_BYTES + 1):
        number += 1
        if len(raw) > _MAX_LINE_BYTES:
            raise RecordingError(f"longer than {_MAX_LINE_BYTES} bytes", number)
        try:
            yield raw.decode("utf-8")
        except UnicodeDecodeError as exc:
            raise RecordingError(f"not UTF-8: {exc.reason}, byte {exc.start}", number) from exc


def rows(lines: Iterable[str]) -> Iterator[Row]:
    """Yield the objects of the lines that are not blank."""
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            row = json.loads(line)
        # Python raises this instead of ValueError for deep nesting.
        except RecursionError as exc:
            raise RecordingError("nested too deeply", number) from exc
        except ValueError as exc:
            raise RecordingError(
                "not valid JSON, or cut off; a recording has an object per line", number
            ) from exc
        if not isinstance(row, dict):
            raise RecordingError(f"a {type(row).__name__} instead of an object", number)
        yield Row(row, number)


_TYPE_TEXT = {str: "a string", int: "a whole number", bool: "true or false", list: "a list"}


class Row:
    """An object of the file, with its line number for messages.

    Each method raises `RecordingError` when the value does not have the requested type.
    """

    def __init__(self, row: dict[str, Any], line: int) -> None:
        self.row, self.line = row, line

    def error(self, reason: str) -> RecordingError:
        """Return an error about this line."""
        return RecordingError(reason, self.line)

    def get(self, key: str, kind: type) -> Any:
        """Return a required value of this type; a bool is not accepted as a number."""
        if key not in self.row:
            raise self.error(f"{key!r} is missing")
        value = self.row[key]
        if type(value) is not kind:
            raise self.error(f"{key!r} is {short(value)}, not {_TYPE_TEXT[kind]}")
        return value

    def given(self, key: str) -> bool:
        """Whether the key is present and not null."""
        return self.row.get(key) is not None

    def number(self, key: str, low: int = 0, high: int = _MAX_NUMBER) -> int:
        """Return an integer within these bounds."""
        value: int = self.get(key, int)
        if not low <= value <= high:
            raise self.error(f"{key!r} is {short(value)}; allowed are {low} … {high}")
        return value

    def hex(self, key: str) -> bytes:
        """Return the bytes of a string of hex digits."""
        text: str = self.get(key, str)
        return self.unhex(text, key)

    def unhex(self, text: str, what: str) -> bytes:
        """Return the bytes of a text that belongs to ``what``."""
        try:
            return bytes.fromhex(text)
        except ValueError as exc:
            odd = ": an odd number of digits" if len(text) % 2 else ""
            raise self.error(f"{what!r} is {short(text)}, no bytes in hex{odd}") from exc

    def image(self, key: str) -> bytes | None:
        """Return a frame of any length, or ``None`` for null; the key is required."""
        if key in self.row and self.row[key] is None:
            return None
        image = self.hex(key)
        if len(image) > _MAX_IMAGE_BYTES:
            raise self.error(f"{key!r} has {len(image)} bytes; at most {_MAX_IMAGE_BYTES} are read")
        return image

    def session_id(self, key: str) -> int | None:
        """Return a session id, given as a number or as ``"0x1122"``."""
        if not self.given(key):
            return None
        if isinstance(self.row[key], str):
            return self.parsed(self.row[key], key, base=16)
        return self.number(key, 0, 0xFFFF)

    def parsed(self, text: str, what: str, base: int = 0, high: int = 0xFFFF) -> int:
        """Return the number in a text that belongs to ``what``."""
        try:
            value = int(text, base)
        except ValueError as exc:
            raise self.error(f"{what!r} is {short(text)}, no number") from exc
        if not 0 <= value <= high:
            raise self.error(f"{what!r} is {short(text)}; allowed are 0 … {high}")
        return value


def short(value: object) -> str:
    """Return a short, printable form of a value for a message."""
    if isinstance(value, int) and abs(value) > _MAX_NUMBER:
        return "a huge number"
    text = ascii(value)
    return text if len(text) <= 60 else text[:57] + "..."
