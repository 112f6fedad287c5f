"""Options of ``fsoe-net acceptance record`` for the date and the circumstances."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import click

from fsoe_net.cli.options import FILE, read_by
from fsoe_net.model.written import says_something

_F = TypeVar("_F", bound=Callable[..., Any])


def day_of_signature(value: str | None) -> str:
    """Return the day (ISO 8601), or today if none is given.

    Raises:
        ValueError: It is not a day, or is in the future.
    """
    if value is None:
        return datetime.date.today().isoformat()
    try:
        day = datetime.date.fromisoformat(value)
    except ValueError as exc:
        raise ValueError(f"{value!r} is not a date; write YYYY-MM-DD") from exc
    if day > datetime.date.today():
        raise ValueError(f"{value} is in the future; write today or an earlier day")
    return day.isoformat()


def _said(values: Sequence[str]) -> Sequence[str]:
    for value in values:
        if not says_something(value):
            raise ValueError(f"{value!r} names nothing")
    return values


def circumstance_options(function: _F) -> _F:
    """Add options for competence, test equipment, place and attached files."""
    for role in ("verifier", "author"):
        function = click.option(
            f"--{role}-competence",
            default="",
            metavar="TEXT",
            help=f"What qualifies the {role}: training, certificate, experience.",
        )(function)
    function = click.option(
        "--attach",
        multiple=True,
        type=FILE,
        metavar="FILE",
        help="Photo or other file in the folder of the record. Repeatable.",
    )(function)
    function = click.option(
        "--environment",
        default="",
        metavar="TEXT",
        help="Place and conditions of the tests.",
    )(function)
    return click.option(
        "--equipment",
        multiple=True,
        callback=read_by(_said),
        metavar="TEXT",
        help="Measuring equipment: instrument, serial number, calibration. Repeatable.",
    )(function)
