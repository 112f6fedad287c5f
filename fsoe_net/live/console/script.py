"""The language of the console: words, commands, macros, arguments.

    # comment                        to the end of the line
    set drive_1.0x6040:00 6; get all commands of a line are parted by semicolons
    echo "a b" 'c # d'               quotes keep blanks, semicolons and # together
    let enable = set $1 0x6040:00 6; wait 100ms; set $1 0x6040:00 7
    enable drive_1                   $1 … $9 are the arguments, $* all of them
    let speed = 0x60ff:00            $speed stands for one word or more

The rest of a ``let`` line belongs to it, semicolons too.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fsoe_net.diag.words import counted
from fsoe_net.errors import ConsoleError

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
_VARIABLE = re.compile(r"\$(\$|\*|[0-9]|[A-Za-z_][A-Za-z0-9_]*)")
_BLANK = " \t\r"


class ScriptError(ConsoleError):
    """Text that is no command.

    Args:
        message: What is wrong.
        line: From 1.
        column: From 1.
    """

    def __init__(self, message: str, line: int, column: int) -> None:
        super().__init__(message, is_usage=True)
        self.line = line
        self.column = column


@dataclass(frozen=True, slots=True)
class Word:
    """One word; ``literal`` was in single quotes: nothing in it is replaced."""

    text: str
    column: int
    literal: bool = False
    quoted: bool = False


@dataclass(frozen=True, slots=True)
class ConsoleCommand:
    """The words of one command; at least one."""

    words: tuple[Word, ...]
    line: int

    @property
    def name(self) -> str:
        """Its first word."""
        return self.words[0].text

    @property
    def column(self) -> int:
        """Where it begins, from 1."""
        return self.words[0].column


def parse(text: str) -> list[ConsoleCommand]:
    """Return the commands of a text of one line or more.

    Raises:
        ScriptError: A quote without an end, a control character, a ``let`` without its text.
    """
    found: list[ConsoleCommand] = []
    for number, line in enumerate(text.split("\n"), 1):
        found += _line(line, number)
    return found


def _line(text: str, number: int, *, inside_let: bool = False) -> list[ConsoleCommand]:
    found: list[ConsoleCommand] = []
    words: list[Word] = []
    at = 0
    while at < len(text):
        if text[at] in _BLANK:
            at += 1
        elif text[at] == "#":
            break
        elif text[at] == ";":
            found += [ConsoleCommand(tuple(words), number)] if words else []
            words = []
            at += 1
        else:
            word, at = _word(text, at, number)
            words.append(word)
            rest = text[at:].strip(_BLANK)
            if len(words) == 1 and word.text == "let" and rest and rest[0] not in "#;":
                if inside_let:
                    raise ScriptError("a let inside a let", number, word.column)
                words += _let(text, at, number)
                break
    return found + ([ConsoleCommand(tuple(words), number)] if words else [])


def _word(text: str, start: int, line: int) -> tuple[Word, int]:
    """Return the word that begins there, and where it ends."""
    parts: list[str] = []
    at, quoted, literal = start, False, False
    while at < len(text) and text[at] not in _BLANK + ";":
        if text[at] in "\"'":
            quote = text[at]
            end = text.find(quote, at + 1)
            if end < 0:
                raise ScriptError(f"this quote {quote} has no end", line, at + 1)
            parts.append(text[at + 1 : end])
            at, quoted, literal = end + 1, True, literal or quote == "'"
        else:
            parts.append(text[at])
            at += 1
    word = "".join(parts)
    if not word.isprintable():
        raise ScriptError("a control character", line, start + 1)
    return Word(word, start + 1, literal, quoted), at


def _let(text: str, at: int, line: int) -> list[Word]:
    """Return NAME and TEXT of ``let NAME = TEXT``."""
    rest = text[at:].strip(_BLANK)
    column = at + 1 + len(text[at:]) - len(text[at:].lstrip(_BLANK))
    name, equals, body = rest.partition("=")
    name = name.strip(_BLANK)
    if not _NAME.fullmatch(name):
        raise ScriptError(f"{name!r} is no name; let NAME = COMMANDS", line, column)
    body = body.strip(_BLANK)
    if len(body) > 1 and body[0] in "\"'" and body.find(body[0], 1) == len(body) - 1:
        body = body[1:-1]
    if not equals or not body:
        raise ScriptError(f"let {name} = COMMANDS", line, column)
    _line(body, line, inside_let=True)  # a mistake in it is reported here, not at its first use
    place = column + rest.index("=") + 1
    return [Word(name, column, literal=True), Word(body, place, literal=True)]


def expand(
    command: ConsoleCommand, arguments: Sequence[str], macros: Mapping[str, str], *, inside: bool
) -> tuple[Word, ...]:
    """Return the words of a command with ``$1``, ``$*`` and ``$NAME`` replaced.

    Args:
        command: What is going to be done.
        arguments: Those of the script or macro it stands in.
        macros: What ``let`` has defined.
        inside: Whether it stands in a script or macro: only there are arguments.

    Raises:
        ScriptError: There is no such argument or name.
    """
    found: list[Word] = []
    for word in command.words:
        if word.literal or "$" not in word.text:
            found.append(word)
            continue

        def value(match: re.Match[str], at: Word = word) -> str:
            return _value(match[1], arguments, macros, (inside, command.line, at.column))

        text = _VARIABLE.sub(value, word.text)
        pieces = [text] if word.quoted else text.split()
        if not all(piece.isprintable() for piece in pieces):
            raise ScriptError("a control character", command.line, word.column)
        found += [Word(piece, word.column, quoted=word.quoted) for piece in pieces]
    if not found:
        raise ScriptError("nothing is left of this command", command.line, command.column)
    return tuple(found)


def _value(
    name: str,
    arguments: Sequence[str],
    macros: Mapping[str, str],
    place: tuple[bool, int, int],
) -> str:
    inside, line, column = place
    if name == "$":
        return "$"
    if name == "*":
        return " ".join(arguments)
    if name.isdigit():
        if 1 <= int(name) <= len(arguments):
            return arguments[int(name) - 1]
        where = (
            f"only {counted(len(arguments), 'argument')}"
            if inside
            else "no arguments at the prompt"
        )
        raise ScriptError(f"${name}: there are {where}", line, column)
    if name in macros:
        return macros[name]
    raise ScriptError(f"${name}: nothing is called so; let {name} = … defines it", line, column)
