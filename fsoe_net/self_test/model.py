"""A part of the self-test, and its result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple


class TriedValue(NamedTuple):
    """One value of this installation with the expected value."""

    what: str
    expected: object
    got: object


class NotTried(Exception):
    """A part does not apply to this installation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SelfTestPart:
    """A part of the self-test.

    Attributes:
        name: Stable name.
        compare: Yields its comparisons.
        next_step: Action in case of a difference.
    """

    name: str
    compare: Callable[[], Iterator[TriedValue]]
    next_step: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PartResult:
    """Result of a part.

    Attributes:
        name: Name of the part.
        compared: Number of compared values.
        different: Values that differ.
        not_tried: Why it does not apply here; empty if it was run.
        next_step: Required action; empty unless something differs.
    """

    name: str
    compared: int
    different: tuple[TriedValue, ...]
    not_tried: str
    next_step: str

    @property
    def result(self) -> str:
        """The word for the result: ``pass``, ``fail`` or ``not tried``."""
        if self.not_tried:
            return "not tried"
        return "fail" if self.different else "pass"


def tried(part: SelfTestPart) -> PartResult:
    """Run a part; any exception in it becomes its result."""
    compared, different, not_tried = 0, list[TriedValue](), ""
    try:
        for row in part.compare():
            compared += 1
            if row.expected != row.got:
                different.append(row)
        # A part that makes no comparison must not pass.
        if compared == 0:
            different.append(TriedValue("values to compare", "at least 1", 0))
    except NotTried as exc:
        not_tried = str(exc)
    except Exception as exc:  # a damaged installation may fail in any way
        what = f"after {compared} values"
        different.append(TriedValue(what, "the next value", f"{type(exc).__name__}: {exc}"))
    return PartResult(
        name=part.name,
        compared=compared,
        different=tuple(different),
        not_tried=not_tried,
        next_step=part.next_step if different else "",
    )


def reference_file(name: str) -> str:
    """Return the text of a file next to this module."""
    return (Path(__file__).parent / name).read_text("utf-8")


@cache
def reference() -> Mapping[str, Any]:
    """Return the known values.

    Raises:
        TypeError: The file is damaged.
    """
    import yaml

    found = yaml.safe_load(reference_file("reference.yaml"))
    if not isinstance(found, dict):
        raise TypeError("reference.yaml is damaged")
    return found
