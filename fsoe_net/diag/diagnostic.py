"""Data types of a finding: code, severity, message, place, related places, hint."""

from __future__ import annotations

import enum
from dataclasses import field
from typing import TYPE_CHECKING, NamedTuple

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.catalogue import code_info
from fsoe_net.diag.printable import printable

if TYPE_CHECKING:
    from collections.abc import Iterable


class Severity(enum.Enum):
    """Severity of a finding. `check` exits with 1 for errors and warnings, not for ``info``."""

    ERROR = "error"
    WARNING = "warning"
    INFO = "info"

    @property
    def rank(self) -> int:
        """0 for the most severe, increasing."""
        return _RANK[self]


_RANK = {Severity.ERROR: 0, Severity.WARNING: 1, Severity.INFO: 2}


class Span(NamedTuple):
    """A place in a file. Lines and columns count from 1; a column counts characters, not bytes.

    ``line`` 0 means the file as a whole (missing, unreadable, empty).
    """

    file: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file


# A message contains values from files, which may have any length.
_MOST_CHARACTERS = 2000
_LAST_CHARACTERS = 500


def _shortened(text: str) -> str:
    if len(text) <= _MOST_CHARACTERS:
        return text
    left_out = len(text) - _MOST_CHARACTERS
    begin = text[: _MOST_CHARACTERS - _LAST_CHARACTERS]
    return f"{begin} … ({left_out} characters) … {text[-_LAST_CHARACTERS:]}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Related:
    """A second place that explains a finding, e.g. the declaration a name collides with."""

    span: Span
    message: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "message", _shortened(self.message))


@dataclass(frozen=True, slots=True, kw_only=True)
class Edit:
    """A replacement for one scalar of a YAML file, or for its key.

    Args:
        span: Place of the value.
        key: Its key, as written in the file.
        text: The new value; with ``renames`` the new key.
        renames: Whether the key changes and the value stays.
    """

    span: Span
    key: str
    text: str
    renames: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Fix:
    """The fix of a finding: text for people, and edits if there is exactly one solution."""

    hint: str
    edits: tuple[Edit, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnostic:
    """One finding.

    Args:
        code: ``FSNxyz`` from the catalogue; never renumbered.
        message: One sentence that names the values involved; a long message or hint is shortened in
            the middle.
        span: The place to look at.
        severity: From the catalogue if omitted.
        hint: The concrete fix if one can be computed, otherwise the next step; may be empty.
        related: Further places.
        edits: The hint as changes of the file, if there is exactly one solution.

    Raises:
        KeyError: The code is not in the catalogue.
    """

    code: str
    message: str
    span: Span
    severity: Severity | None = None
    hint: str = ""
    related: tuple[Related, ...] = ()
    edits: tuple[Edit, ...] = ()

    def __post_init__(self) -> None:
        default = Severity(code_info(self.code).severity)
        if self.severity is None:
            object.__setattr__(self, "severity", default)
        for name in ("message", "hint"):
            object.__setattr__(self, name, _shortened(getattr(self, name)))

    def __str__(self) -> str:
        return "\n".join(filter(None, [self.headline, self.next_step]))

    @property
    def headline(self) -> str:
        """Place, code and message in one line."""
        return printable(f"{self.span}: {self.code}: {self.message}")

    @property
    def next_step(self) -> str:
        """The hint in one line; empty without a hint."""
        return f"next step: {printable(self.hint)}" if self.hint else ""

    @property
    def level(self) -> Severity:
        """The severity; never ``None``."""
        return self.severity or Severity.ERROR

    def to_json(self) -> dict[str, object]:
        """Return the stable JSON form (see ``docs/reference/json-output.md``)."""
        return {
            "code": self.code,
            "severity": self.level.value,
            "title": code_info(self.code).title,
            "message": self.message,
            "file": self.span.file,
            "line": self.span.line,
            "column": self.span.column,
            "hint": self.hint,
            "related": [
                {
                    "file": r.span.file,
                    "line": r.span.line,
                    "column": r.span.column,
                    "message": r.message,
                }
                for r in self.related
            ],
        }


@dataclass(slots=True)
class FindingList:
    """Collects findings while loaders and rules continue after a mistake."""

    diagnostics: list[Diagnostic] = field(default_factory=list)

    def add(
        self,
        code: str,
        span: Span,
        message: str,
        *,
        hint: str | Fix = "",
        severity: Severity | None = None,
        related: tuple[Related, ...] = (),
    ) -> None:
        """Add one finding; see `Diagnostic` for the arguments."""
        fix = Fix(hint=hint) if isinstance(hint, str) else hint
        self.diagnostics.append(
            Diagnostic(
                code=code,
                span=span,
                message=message,
                hint=fix.hint,
                severity=severity,
                related=related,
                edits=fix.edits,
            )
        )


def sort_diagnostics(found: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return the findings without duplicates, by file, line, column, severity and code."""
    unique = {(d.code, d.span, d.message): d for d in found}
    return sorted(unique.values(), key=lambda d: (d.span, d.level.rank, d.code, d.message))
