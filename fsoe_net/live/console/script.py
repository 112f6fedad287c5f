"""The language of the console: words and commands.

    # comment                        to the end of the line
    set drive_1.0x6040:00 6; get all commands of a line are separated by semicolons
    echo "a b" 'c # d'               quotes keep blanks, semicolons and # together

Variables, conditions and loops are not supported: a program uses `fsoe_net.connect`.
"""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.errors import ConsoleError

_BLANK = " \t\r"


class ScriptError(ConsoleError):
    """Text that is not a valid command.

    Args:
        message: The error.
        line: From 1.
        column: From 1.
    """

    def __init__(self, message: str, line: int, column: int) -> None:
        super().__init__(message, is_usage=True)
        self.line = line
        self.column = column


@dataclass(frozen=True, slots=True)
class ConsoleCommand:
    """The words of one command, at least one, and its start; line and column from 1."""

    words: tuple[str, ...]
    line: int
    column: int

    @property
    def name(self) -> str:
        """Its first word."""
        return self.words[0]


def parse(text: str) -> list[ConsoleCommand]:
    """Return the commands of a text with one or more lines.

    Raises:
        ScriptError: A quote without an end, or a control character.
    """
    found: list[ConsoleCommand] = []
    for number, line in enumerate(text.split("\n"), 1):
        found += _line(line, number)
    return found


def _line(text: str, number: int) -> list[ConsoleCommand]:
    found: list[ConsoleCommand] = []
    words: list[str] = []
    at = first = 0
    while at < len(text) and text[at] != "#":
        if text[at] in _BLANK:
            at += 1
        elif text[at] == ";":
            if words:
                found.append(ConsoleCommand(tuple(words), number, first + 1))
            words = []
            at += 1
        else:
            if not words:
                first = at
            word, at = _word(text, at, number)
            words.append(word)
    if words:
        found.append(ConsoleCommand(tuple(words), number, first + 1))
    return found


def _word(text: str, start: int, line: int) -> tuple[str, int]:
    """Return the word that begins there, and its end."""
    parts: list[str] = []
    at = start
    while at < len(text) and text[at] not in _BLANK + ";":
        end = at
        if text[at] in "\"'":
            # A quote may begin within a word, as in a shell; it must end in the same line.
            end = text.find(text[at], at + 1)
            if end < 0:
                raise ScriptError(f"this quote {text[at]} has no end", line, at + 1)
            parts.append(text[at + 1 : end])
        else:
            parts.append(text[at])
        at = end + 1
    word = "".join(parts)
    # A control character would reach the log and the terminals of other users.
    if not word.isprintable():
        raise ScriptError("a control character", line, start + 1)
    return word, at
