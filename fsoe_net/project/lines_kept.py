"""A text of YAML after a change of what it says: lines that the change does not touch stay.

A writer of YAML lays a whole text out anew, and drops some comments. So it writes twice, before and
after the change. What differs between these two is put into the text of the person, with the
indents that this has there.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from difflib import SequenceMatcher
from itertools import chain

__all__ = ["with_lines_kept"]

Columns = list[tuple[int, int]]
_DASHES = re.compile(r" *(?:- +)*")


def with_lines_kept(before: str, laid_out: str, after: str) -> str:
    """Return a text after a change in which only lines that the change touched are new.

    Comments before and behind a part stay when the part goes. Where lines are laid out in an odd
    way the text may say something else: compare it.

    Args:
        before: The text as a person laid it out.
        laid_out: The same as the writer lays it out, which has other spaces in it.
        after: The changed text as the writer lays it out.
    """
    own, plain, new = (text.splitlines(keepends=True) for text in (before, laid_out, after))
    end = "\r\n" if own and own[0].endswith("\r\n") else "\n"
    if own and not own[-1].endswith("\n"):
        own[-1] += end
    chunks, tail = _chunks(own, plain)
    columns = [_columns(line, chunk) for line, chunk in zip(plain, chunks, strict=True)]
    lines: list[str] = []
    lost: list[tuple[int, list[str]]] = []
    for kind, begin, stop, first, last in SequenceMatcher(
        None, plain, new, autojunk=False
    ).get_opcodes():
        theirs = chunks[begin:stop]
        if kind == "equal":
            lines += chain.from_iterable(theirs)
            continue
        by_one = last - first == stop - begin
        pairs, place = (theirs, stop) if by_one else (theirs[:1], begin)
        before_words = {} if by_one else _comments_before(theirs[1:])
        for line in _placed(new[first:last], columns[:place], columns[place:], pairs):
            lines += before_words.pop(_words(line), ())
            lines.append(line.rstrip("\r\n") + end)
        lost.append((len(lines), _comments_behind(theirs)))
    lines = _with_comments([*lines, *tail], lost)
    if not before.endswith("\n") and lines:
        lines[-1] = lines[-1].rstrip("\r\n")
    return "".join(lines)


def _placed(
    new: list[str], above: list[Columns], below: list[Columns], pairs: list[list[str]]
) -> Iterator[str]:
    """Yield lines of the writer with the indents of the text.

    ``pairs`` are the chunks that they replace one by one, or the first of what they replace:
    comments in them that the writer has dropped come before the line.
    """
    by_one = len(pairs) == len(new)
    made: list[Columns] = []
    for number, line in enumerate(new):
        if number < len(pairs):
            yield from pairs[number][:-1]
        known = above[: len(above) - len(new) + number + 1] if by_one else above
        moved = _moved(line, [*known, *made], below)
        made.append(_columns(line, [moved]))
        yield moved
    for chunk in pairs[len(new) :]:
        yield from chunk[:-1]


def _with_comments(lines: list[str], lost: list[tuple[int, list[str]]]) -> list[str]:
    """Return the lines with comments that went with a part and are not of it.

    The writer takes the comment before a part for one behind the part above it.
    """
    for at, comments in reversed(lost):
        with_comments = [*lines[:at], *comments, *lines[at:]]
        if comments and _said(with_comments) == _said(lines):
            lines = with_comments
    return lines


def _chunks(own: list[str], plain: list[str]) -> tuple[list[list[str]], list[str]]:
    """Return the lines of a person for each line of the writer, and those behind the last one.

    The last one of a chunk says the same; before it are those that the writer has left out.
    """
    if len(own) == len(plain):
        return [[line] for line in own], []
    chunks: list[list[str]] = []
    left: list[str] = []
    mine, theirs = (["".join(line.split()) for line in lines] for lines in (own, plain))
    for _, begin, stop, first, last in SequenceMatcher(
        None, mine, theirs, autojunk=False
    ).get_opcodes():
        left += own[begin:stop]
        count = last - first
        if not count:
            continue
        # The last lines are those that say the same; what is more stands before the first.
        more = max(len(left) - count, 0)
        found = [""] * (count - len(left)) + left[more:]
        chunks.append([*left[:more], found[0]])
        chunks += [[line] for line in found[1:]]
        left = []
    return chunks, left


def _columns(line: str, chunk: Sequence[str]) -> Columns:
    """Return columns where parts of a line begin: those of the writer, with those of the person.

    None of a line without a word of YAML. Behind each dash of a list a part begins, too.
    """
    mine = chunk[-1]
    if not _is_word(line) or not _is_word(mine):
        return []
    pairs = zip(_starts(line), _starts(mine), strict=False)
    return list(pairs)


def _starts(line: str) -> list[int]:
    found = _DASHES.match(line)
    assert found is not None  # noqa: S101 - it matches nothing too
    dashes = [n for n in range(found.end()) if line[n] == "-"]
    return [*dashes, found.end()]


def _moved(line: str, above: list[Columns], below: list[Columns]) -> str:
    """Return a line of the writer with the indent that lines beside it have in the text."""
    if not line.strip():
        return line
    column = len(line) - len(line.lstrip(" "))
    beside, parent = _beside(column, reversed(above))
    if beside is None:
        beside, _ = _beside(column, below)
    if beside is None:
        beside = column if parent is None else parent[1] + column - parent[0]
    return " " * max(beside, 0) + line.lstrip(" ")


def _beside(column: int, rows: Iterable[Columns]) -> tuple[int | None, tuple[int, int] | None]:
    """Return the column of a person for one of the writer in the nearest row of the same block.

    Else where the block hangs: the columns of the part that it belongs to.
    """
    for pairs in rows:
        found = dict(pairs).get(column)
        if found is not None:
            return found, None
        smaller = [pair for pair in pairs if pair[0] < column]
        if smaller:
            return None, smaller[-1]
    return None, None


def _is_word(line: str) -> bool:
    """Whether a line has a word of YAML: more than blanks and a comment."""
    return line.strip() != "" and line.lstrip()[0] != "#"


def _comments_before(part: list[list[str]]) -> dict[str, list[str]]:
    """Return comments by the words of the line that they stand before."""
    found: dict[str, list[str]] = {}
    comments: list[str] = []
    for line in chain.from_iterable(part):
        if line.lstrip().startswith("#"):
            comments.append(line)
        elif comments:
            found[_words(line)] = comments
            comments = []
    return found


def _words(line: str) -> str:
    """Return what a line says, wherever it stands, and whether or not an item begins there."""
    return "".join(line.split()).lstrip("-")


def _comments_behind(part: list[list[str]]) -> list[str]:
    """Return the lines without a word of YAML at the end of a part that goes.

    Those before its first line were kept already.
    """
    lines = [*chain.from_iterable(part)][len(part[0]) - 1 :] if part else []
    words = [n for n, line in enumerate(lines) if _is_word(line)]
    behind = lines[words[-1] + 1 :] if words else lines
    return behind if any(line.strip() for line in behind) else []


def _said(lines: Iterable[str]) -> object:
    """Return what lines of YAML say, to be compared; a class where they are no YAML.

    One that looks like a comment may belong to a longer value.
    """
    import yaml

    try:
        return yaml.load("".join(lines), getattr(yaml, "CSafeLoader", yaml.SafeLoader))  # noqa: S506 - safe
    except yaml.YAMLError:
        return yaml.YAMLError
