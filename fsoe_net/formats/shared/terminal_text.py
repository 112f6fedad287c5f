"""Text pasted from a terminal: prompts, indentation and noise around it, and truncation.

A truncated paste must never look like a complete, shorter map. Two signs show truncation: a last
line that is only the beginning of a known line, and a structure that declares more items than
follow.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.limits import MAX_PASTED_BYTES
from fsoe_net.formats.shared.source import text_of
from fsoe_net.model.bus import Direction, Entry, Pdo, SyncManager, Watchdog
from fsoe_net.model.description import DescribedSubDevice, Description

_MAX_LINE = 600  # a name has at most 255 characters
_ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b[@-_]|\r")
_QUOTES = re.compile(r"^(?:[ \t]*>)+[ \t]?")
_PROMPT = re.compile(
    r"(?:\[?[\w.-]{1,60}@[\w.-]{1,60}[^$#%]{0,200}[$#%](?:\s.*)?$|[$#%](?:\s+.*)?$"
    r"|\S{0,60}>? ?(?:sudo )?(?:\S{0,60}/)?(?:ethercat|slaveinfo)\s)"
)
_LEFT_OUT = re.compile(r"^\s*[\[(<]?\s*(?:\.\.\.+|\u2026|--More--|truncated|snip)", re.IGNORECASE)
_FENCE = re.compile(r"^\s*(```|~~~)")


@dataclass(frozen=True, slots=True)
class Line:
    """One line without the additions of a terminal or a mail."""

    text: str
    span: Span
    last: bool = False

    @property
    def stripped(self) -> str:
        """The text without blanks at both ends."""
        return self.text.strip()


@dataclass(slots=True)
class Pasted:
    """The lines of a paste, and its findings."""

    lines: tuple[Line, ...]
    shown: str
    out: Collector
    truncated: bool = False
    last_good: Line | None = None
    taken: int = 0  # rows that its tables refer to
    _strange: int = 0

    def __iter__(self) -> Iterator[Line]:
        return iter(self.lines)

    def read(
        self,
        take: Callable[[Line], bool | None],
        what: str,
        starts: tuple[str, ...],
        *,
        part: re.Pattern[str] | None = None,
    ) -> None:
        """Process each line; an unknown line is reported as a truncation or as FSN147.

        Lines before the first known one are output of the shell, not findings. The same applies to
        lines that resemble no known one.

        Args:
            take: Returns whether a line is known; ``None`` for one without content.
            what: The expected command.
            starts: How lines of that output begin.
            part: Matches a truncated line with none of these beginnings.
        """
        for line in self.lines:
            is_good = take(line)
            if is_good:
                self.last_good = line
            elif is_good is not None:
                text = line.stripped
                known = any(text.startswith(s) or s.startswith(text) for s in starts)
                self._strange_line(line, what, known or bool(part and part.match(text)))

    def _strange_line(self, line: Line, what: str, known: bool) -> None:
        text = line.stripped
        if _LEFT_OUT.match(text):
            self.cut(line, f"{text[:20]!r} replaces lines that were left out")
        elif known and line.last:
            self.cut(line, f"{text[:60]!r} is not a whole line")
        # Only the first one, because an edited paste has many.
        elif known and self.last_good is not None and self._strange == 0:
            self._strange += 1
            shown = text if len(text) <= 60 else text[:57] + "..."
            self.out.add(
                "FSN147",
                line.span,
                f"{shown!r} is not a line of {what}",
                hint="paste the output again, unchanged; this line was left out",
            )

    def cut(self, line: Line | None, why: str) -> None:
        """Report once that the text is truncated, with its last good line."""
        if self.truncated:
            return
        self.truncated = True
        good = self.last_good
        where = (
            "no line of it is complete"
            if good is None
            else f"line {good.span.line} is the last good one"
        )
        self.out.add(
            "FSN146",
            line.span if line is not None else Span(self.shown, 1, 1),
            f"the text is cut off: {why}; {where}",
            hint="paste the whole output; what is missing cannot be guessed",
        )

    def described(self, kind: str, rows: Iterable[DescribedSubDevice]) -> Description:
        """Return the SubDevices in a text of this kind."""
        subdevices = tuple(rows)
        return Description(
            span=Span(self.shown, 1, 1),
            format=kind,
            path=self.shown,
            subdevices=subdevices,
            truncated=self.truncated,
        )


@dataclass(slots=True)
class PrintedManager:
    """A sync manager while its lines are read.

    Attributes:
        pdos: Index, place and entries of each PDO.
    """

    span: Span
    index: int
    direction: Direction
    watchdog: Watchdog = Watchdog.DEFAULT
    start_byte: int | None = None
    pdos: list[tuple[int, Span, list[Entry]]] = field(default_factory=list)

    @property
    def bits(self) -> int:
        """Bits of all its entries."""
        return sum(entry.bits for _, _, entries in self.pdos for entry in entries)

    def add(self, entry: Entry) -> bool:
        """Add an entry to the last PDO; ``False`` if there is none."""
        if self.pdos:
            self.pdos[-1][2].append(entry)
        return bool(self.pdos)

    def built(self) -> SyncManager:
        """Return the sync manager with the PDOs read so far."""
        return SyncManager(
            span=self.span,
            index=self.index,
            direction=self.direction,
            watchdog=self.watchdog,
            pdos=tuple(
                Pdo(span=span, index=index, entries=tuple(entries))
                for index, span, entries in self.pdos
            ),
            start_byte=self.start_byte,
        )


def pasted(data: bytes, shown: str, out: Collector) -> Pasted:
    """Return the lines of a paste.

    Quote marks of mails, colour codes, carriage returns, code fences and prompts with the command
    are removed. So is indentation that all lines share.
    """
    if len(data) > MAX_PASTED_BYTES:
        out.add(
            "FSN103",
            Span(shown, 1, 1),
            f"a text of {len(data)} bytes, more than the {MAX_PASTED_BYTES} allowed",
            hint="is this really the output of one command?",
        )
        data = b""
    rows: list[tuple[int, str]] = []
    for number, raw in enumerate(text_of(data).split("\n"), 1):
        raw = _ESCAPES.sub("", raw[:_MAX_LINE])
        text = _QUOTES.sub("", raw).expandtabs(8).rstrip()
        if text and not _FENCE.match(text) and not _PROMPT.match(text.lstrip()):
            rows.append((number, text))
    end = len(rows) - 1
    return Pasted(
        tuple(
            Line(text, Span(shown, number, len(text) - len(text.lstrip()) + 1), n == end)
            for n, (number, text) in enumerate(rows)
        ),
        shown,
        out,
    )
