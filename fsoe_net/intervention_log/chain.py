"""Reads the intervention log of ``fsn-master`` and follows its chain, line by line.

The log is untrusted. A line may be long, invalid UTF-8 or JSON, or foreign; memory stays bounded by
the longest entry.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Protocol

from fsoe_net.core.json_object import clean

_LINE_BYTES = 1 << 20  # the limit of fsn-master
_VERSION = 1
_MOST_NUMBER = (1 << 64) - 1
_MOST_ID = (1 << 32) - 1
_MOST_FINDINGS = 50
_MOST_DEPTH = 16
_BACK_S = 1.0  # clocks are often set back by less
_SHA256 = re.compile(r"[0-9a-f]{64}")
_UTC = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,6})?Z")
_ABOUT_THE_LOG = ("file", "torn")  # may precede the entry about torn bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class LogLine:
    """One line of a file.

    Attributes:
        at: Number in the file, from 1.
        data: Without its newline; ``None`` if it is too long for an entry.
        size_bytes: With its newline.
        sha256: Of the line without its newline.
        ends: Whether it ends with a newline.
    """

    at: int
    data: bytes | None
    size_bytes: int
    sha256: str
    ends: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class LogEntry:
    """One entry. Texts are printable.

    Attributes:
        number: From 1, continuous over all files.
        event: Kind of event.
        utc: Time as written; empty if it is invalid.
        level: info, warning, error or detail.
        text: Text for people.
        who: User and program, if the entry names them.
        file: Name of its file.
        line: Line in it, from 1.
        sha256: Hash of the line, as the next entry should contain it.
        size_bytes: Size of the line, with its newline.
        row: The whole entry.
    """

    number: int
    event: str
    utc: str
    level: str
    text: str
    who: str
    file: str
    line: int
    sha256: str
    size_bytes: int
    row: Mapping[str, Any] = field(repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainFinding:
    """An error in a chain, and its place; ``line`` 0: the file as a whole."""

    file: str
    line: int
    text: str


@dataclass(slots=True)
class LogFile:
    """One file of a log: its name, length, SHA-256, and the numbers of its entries (0 for none)."""

    name: str
    size_bytes: int = 0
    sha256: str = ""
    first: int = 0
    last: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class LogCheck:
    """Result of checking the chain.

    Attributes:
        files: Files in the order in which they were read.
        entries: Number of entries.
        first: Number of the first one; 0 if there are none.
        last: The last entry.
        holds: Whether the chain is valid, without findings.
        findings: At most 50: changed, removed, inserted or moved entries.
        more: Number of further findings.
        remarks: Remarks for readers, even if the chain is valid.
        since_last: Entries after the one named by ``last``; ``None`` if none was named.
    """

    files: tuple[LogFile, ...]
    entries: int
    first: int
    last: LogEntry | None
    findings: tuple[ChainFinding, ...]
    more: int
    remarks: tuple[str, ...]
    since_last: int | None

    @property
    def holds(self) -> bool:
        """Whether there are no findings."""
        return not self.findings


class Readable(Protocol):
    """A source of lines."""

    def readline(self, most: int, /) -> bytes:
        """Return bytes up to a newline, at most the given number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LogFilter:
    """Selects the newest entries by time, event, and user or program.

    Attributes:
        since: Earliest time; entries without a time never match.
        until: Time before which entries match.
        events: Names of events; empty for all.
        who: Part of `LogEntry.who`; empty for any.
        most: Maximum number of entries, the newest ones.
    """

    since: datetime | None = None
    until: datetime | None = None
    events: tuple[str, ...] = ()
    who: str = ""
    most: int = 200

    def fits(self, entry: LogEntry) -> bool:
        """Whether an entry matches."""
        at = utc_of(entry.utc)
        return (
            (self.since is None or (at is not None and at >= self.since))
            and (self.until is None or (at is not None and at < self.until))
            and (not self.events or entry.event in self.events)
            and self.who in entry.who
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class LogSelection:
    """Selected entries, the result of the chain check, and the number of omitted entries."""

    check: LogCheck
    entries: tuple[LogEntry, ...]
    left_out: int


def log_lines(stream: Readable) -> Iterator[LogLine]:
    """Yield the lines of a file; for one that is too long, only its length and hash."""
    at = 0
    # One byte more than the longest entry: the newline.
    while data := stream.readline(_LINE_BYTES + 1):
        at += 1
        size = len(data)
        digest = hashlib.sha256(data.removesuffix(b"\n"))
        whole: bytes | None = data.removesuffix(b"\n")
        while not data.endswith(b"\n") and (data := stream.readline(_LINE_BYTES)):
            whole = None
            size += len(data)
            digest.update(data.removesuffix(b"\n"))
            if data.endswith(b"\n"):
                break
        ends = data.endswith(b"\n")
        yield LogLine(at=at, data=whole, size_bytes=size, sha256=digest.hexdigest(), ends=ends)


def utc_of(text: str) -> datetime | None:
    """Return the time of an entry, or ``None`` if the text is not a time."""
    try:
        return datetime.fromisoformat(text) if _UTC.fullmatch(text) else None
    except ValueError:
        return None


class LogChain:
    """Follows the chain over the lines of all files.

    Args:
        after: SHA-256 of the entry before the first one, kept elsewhere; empty if the log begins at
            entry 1.
        last: SHA-256 of an entry that was once the last one, kept elsewhere; empty if unknown.
    """

    def __init__(self, *, after: str = "", last: str = "") -> None:
        self._after = after
        self._wanted = last
        self._wanted_at = 0
        self._files: list[LogFile] = []
        self._findings: list[ChainFinding] = []
        self._more = 0
        self._remarks: list[str] = []
        self._entry: LogEntry | None = None
        self._first = 0
        self._entries = 0
        self._counts: dict[str, int] = {}
        self._back = 0
        self._is_newer = False
        self._latest: datetime | None = None
        self._torn = _Torn()

    def begin(self, name: str) -> LogFile:
        """Begin a file; the caller sets its length and hash."""
        self._files.append(LogFile(name))
        return self._files[-1]

    def take(self, line: LogLine) -> LogEntry | None:
        """Process the next line of the file; return its entry, or ``None`` if it has none."""
        file = self._files[-1]
        entry = _entry_of(line, file.name)
        if entry is None:
            # Decided with the next entry: fsn-master describes torn bytes in an entry `torn`.
            self._torn.add(file.name, line)
            return None
        self._compare(entry)
        self._compare_torn(entry)
        self._look_at_clock(entry)
        if entry.event == "file" and entry.row.get("log", _VERSION) != _VERSION:
            self._is_newer = True
        self._entry = entry
        self._entries += 1
        self._first = self._first or entry.number
        self._counts[entry.event] = self._counts.get(entry.event, 0) + 1
        file.first = file.first or entry.number
        file.last = entry.number
        if entry.sha256 == self._wanted:
            self._wanted_at = self._entries
        return entry

    def end(self) -> LogCheck:
        """Return the result after the last line."""
        torn = self._torn
        # Only the end of the last file may be incomplete: fsn-master may be writing it.
        if torn.size_bytes and not torn.ends and torn.file == self._files[-1].name:
            self._remarks.append(
                f"{torn.file}:{torn.line}: the last line is incomplete: it is being written, or "
                "the program was stopped in the middle of it; the next start marks it"
            )
        elif torn.size_bytes and not torn.marked:
            self._add(torn.file, torn.line, torn.text)
        if self._entry is None:
            name = self._files[-1].name if self._files else ""
            self._add(name, 0, "no entry: not an intervention log, or all entries were removed")
        elif self._wanted and not self._wanted_at:
            self._add(
                self._entry.file,
                self._entry.line,
                f"no entry has the SHA-256 {self._wanted}: the end was cut off, or entries up to "
                "there were rewritten",
            )
        return LogCheck(
            files=tuple(self._files),
            entries=self._entries,
            first=self._first,
            last=self._entry,
            findings=tuple(self._findings),
            more=self._more,
            remarks=(*self._remarks, *self._counted()),
            since_last=self._entries - self._wanted_at if self._wanted_at else None,
        )

    def _counted(self) -> Iterator[str]:
        for event, one, many in (
            ("unfinished", "1 run has no stop", "{} runs have no stop"),
            ("torn", "1 entry was not written whole", "{} entries were not written whole"),
            ("entries_lost", "entries were lost once", "entries were lost {} times"),
        ):
            if count := self._counts.get(event, 0):
                yield one if count == 1 else many.format(count)
        if self._is_newer:
            yield "a file has a newer form than this version reads: entries may contain more"
        if self._back:
            yield f"times go back by more than 1 s: {self._back} (the clock was set)"

    def _add(self, file: str, line: int, text: str) -> None:
        if len(self._findings) >= _MOST_FINDINGS:
            self._more += 1
        else:
            self._findings.append(ChainFinding(file=file, line=line, text=text))

    def _compare(self, entry: LogEntry) -> None:
        """Compare number and hash with those of the previous entry."""
        before, stated = self._entry, entry.row["previous"]
        if before is None:
            text = self._wrong_begin(entry.number, stated)
        elif entry.number > before.number + 1:
            text = f"{_numbers(before.number + 1, entry.number - 1)} missing before entry "
            text += str(entry.number)
        # A new log without a predecessor is not a moved line, although its number decreases.
        elif entry.number == 1 and stated is None:
            text = f"another log begins here, after entry {before.number}"
        elif entry.number <= before.number:
            text = f"entry {entry.number} comes after entry {before.number}: lines were moved, "
            text += "repeated or put in"
        elif stated != before.sha256:
            text = f"entry {before.number} was changed, or entry {entry.number} is not the one "
            text += "that was written after it: its SHA-256 does not match"
        else:
            return
        if text:
            self._add(entry.file, entry.line, text)

    def _wrong_begin(self, number: int, stated: str | None) -> str:
        """Return the error of the first entry; empty if there is none."""
        if self._after:
            return "" if stated == self._after else f"entry {number} does not follow --after"
        if number == 1:
            return "" if stated is None else "entry 1 holds the hash of an entry before it"
        return (
            f"{_numbers(1, number - 1)} missing: name the files before, or their last SHA-256 with "
            "--after"
        )

    def _compare_torn(self, entry: LogEntry) -> None:
        """Compare lines without an entry with the entry that describes them."""
        torn = self._torn
        if entry.event == "torn":
            if not torn.size_bytes:
                self._add(entry.file, entry.line, "the bytes that this entry names were removed")
            elif torn.sha256 != entry.row.get("sha256"):
                self._add(torn.file, torn.line, "bytes of an entry that is not whole were changed")
            self._torn = _Torn()
        elif torn.size_bytes and entry.event not in _ABOUT_THE_LOG:
            self._add(torn.file, torn.line, torn.text)
            self._torn = _Torn()

    def _look_at_clock(self, entry: LogEntry) -> None:
        now = utc_of(entry.utc)
        if now is None:
            return
        if self._latest is not None and (self._latest - now).total_seconds() > _BACK_S:
            self._back += 1
        # Also after a decrease: entries are compared with their predecessor, so it counts once.
        self._latest = now


class _Torn:
    """Consecutive lines without an entry."""

    def __init__(self) -> None:
        self.file, self.line, self.lines, self.size_bytes = "", 0, 0, 0
        self.ends, self.marked = True, False  # of the last line
        self._hash = hashlib.sha256()

    def add(self, file: str, line: LogLine) -> None:
        if not self.size_bytes:
            self.file, self.line = file, line.at
        self.lines += 1
        self.size_bytes += line.size_bytes
        self.ends = line.ends
        self.marked = line.data is not None and line.data.endswith(b" torn")
        if line.data is not None:
            self._hash.update(line.data + b"\n" * line.ends)
        else:
            self._hash.update(line.sha256.encode())  # no entry describes a line of this length

    @property
    def sha256(self) -> str:
        return self._hash.hexdigest()

    @property
    def text(self) -> str:
        what = f"{self.lines} lines are not entries"
        if self.lines == 1:
            what = "a line is not an entry"
        return f"{what}, and no entry explains it: inserted, or changed"


def _numbers(first: int, last: int) -> str:
    return f"entry {first} is" if first == last else f"entries {first} to {last} are"


def _entry_of(line: LogLine, file: str) -> LogEntry | None:
    """Return the entry of a line, or ``None`` if it is not an entry."""
    row = _object(line.data) if line.data is not None and line.ends else None
    if row is None:
        return None
    # `previous` is null in entry 1 and must be present: a missing one becomes 0, which is invalid.
    number, event, previous = row.get("number"), row.get("event"), row.get("previous", 0)
    if (
        not isinstance(number, int)
        # JSON true is an int in Python.
        or isinstance(number, bool)
        or not 0 < number <= _MOST_NUMBER
        or not isinstance(event, str)
        or not (previous is None or (isinstance(previous, str) and _SHA256.fullmatch(previous)))
    ):
        return None
    utc = _text(row, "utc")
    return LogEntry(
        number=number,
        event=clean(event, 40),
        utc=utc if utc_of(utc) is not None else "",
        level=_text(row, "level", 10),
        text=_text(row, "text"),
        who=_who(row),
        file=file,
        line=line.at,
        sha256=line.sha256,
        size_bytes=line.size_bytes,
        row=row,
    )


def _text(row: Mapping[str, Any], key: str, most: int = 2000) -> str:
    value = row.get(key)
    return clean(value, most) if isinstance(value, str) else ""


def _who(row: Mapping[str, Any]) -> str:
    """Return user and program of an entry: ``anna, fsoe-net 4711``."""
    uid, pid = row.get("uid"), row.get("pid")
    user = _text(row, "user", 40) or (f"uid {uid}" if _is_id(uid) else "")
    program = _text(row, "program", 40)
    process = f"{program} {pid}".strip() if _is_id(pid) else program
    return ", ".join(text for text in (user, process) if text)


def _is_id(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= _MOST_ID


def _object(data: bytes) -> dict[str, Any] | None:
    """Return the JSON object of a line with unique keys, or ``None`` if it is not one."""
    try:
        # fsn-master writes no NaN, no 1e999 and no key twice; readers of JSON differ on all three.
        row = json.loads(
            data.decode("utf-8"),
            parse_constant=_finite,
            parse_float=_finite,
            object_pairs_hook=_once,
        )
    except (ValueError, RecursionError):
        return None
    return row if isinstance(row, dict) and _is_flat(row, _MOST_DEPTH) else None


def _is_flat(value: object, depth: int) -> bool:
    """Whether the nesting of objects and lists is limited to this depth."""
    if not isinstance(value, dict | list):
        return True
    inner = value.values() if isinstance(value, dict) else value
    return depth > 0 and all(_is_flat(part, depth - 1) for part in inner)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    row = dict(pairs)
    if len(row) != len(pairs):
        raise ValueError("a key is there twice")
    return row


def _finite(text: str) -> float:
    if not math.isfinite(number := float(text)):
        raise ValueError(f"{text} is not a number")
    return number
