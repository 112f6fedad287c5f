"""Commands to a running emulation: the steps of a scenario, one per line, executed immediately."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fsoe_net.diag.diagnostic import Span
from fsoe_net.diag.guesses import guesses, one_of
from fsoe_net.model.scenario import RESET_OF_ALL, Action, ScenarioStep
from fsoe_net.model.times import TIME_UNITS_NS, time_ns

_WORD = 0xFFFFFFFF
_HOUR_NS = 3_600 * TIME_UNITS_NS["s"]


class CommandError(ValueError):
    """A line that is not a command; the text lists the valid ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EmulationCommand:
    """The request in a line: a step, or ``None`` for the current observations."""

    step: ScenarioStep | None


def parse_command(line: str, number: int) -> EmulationCommand | None:
    """Read one line; ``None`` for an empty one or a comment.

    Args:
        line: The words, as in a scenario with ``-`` for ``_`` and without units in the action.
        number: Line number, for messages.

    Raises:
        CommandError: Invalid command.
    """
    # A comment may follow a command, as in the console.
    words = line.partition("#")[0].split()
    if not words:
        return None
    if words == ["status"]:
        return EmulationCommand(step=None)
    form = _FORMS.get(words[0])
    # A typing error on a running bus needs a suggestion immediately.
    if form is None:
        near = guesses(words[0], _KNOWN)
        meant = f"did you mean {one_of(near)}? " if near else ""
        raise CommandError(f"unknown command {words[0]!r}; {meant}known: {', '.join(_KNOWN)}")
    low, high = form.count
    if not low <= len(words) - 1 <= high:
        raise CommandError(f"write: {words[0]} {form.usage}".rstrip())
    return EmulationCommand(step=form.make(words[1:], Span("command", number, 1)))


def _number(text: str, high: int) -> int:
    try:
        # Enough for 64 bits; int() takes quadratic time for a long text.
        value = int(text, 0) if len(text) <= 24 else -1
    except ValueError:
        raise CommandError(f"{text!r} is not a number; write 12 or 0x0c") from None
    if not 0 <= value <= high:
        raise CommandError(f"{text[:24]} is not in 0 … {high}")
    return value


def _time(text: str, unit: str) -> int:
    """Return a time in a unit; only 0 needs no unit."""
    ns = 0 if text == "0" else time_ns(text)
    if ns is None:
        raise CommandError(f"{text[:24]!r} is not a time; write 500us, 20ms or 1s")
    if ns > _HOUR_NS:
        raise CommandError(f"{text} is more than an hour")
    if ns % TIME_UNITS_NS[unit]:
        raise CommandError(f"{text} is not a whole number of {unit}")
    return ns // TIME_UNITS_NS[unit]


@dataclass(frozen=True, slots=True)
class _Form:
    usage: str
    make: Callable[[Sequence[str], Span], ScenarioStep]

    @property
    def count(self) -> tuple[int, int]:
        words = self.usage.split()
        return sum(not w.startswith("[") for w in words), len(words)


def _target(action: Action) -> Callable[[Sequence[str], Span], ScenarioStep]:
    return lambda words, span: ScenarioStep(span=span, at_ns=0, action=action, target=words[0])


def _button(action: Action) -> Callable[[Sequence[str], Span], ScenarioStep]:
    def make(words: Sequence[str], span: Span) -> ScenarioStep:
        return ScenarioStep(
            span=span, at_ns=0, action=action, target=words[0] if words else RESET_OF_ALL
        )

    return make


def _values(action: Action, high: int) -> Callable[[Sequence[str], Span], ScenarioStep]:
    def make(words: Sequence[str], span: Span) -> ScenarioStep:
        return ScenarioStep(
            span=span, at_ns=0, action=action, values={words[0]: _number(words[1], high)}
        )

    return make


def _times(action: Action) -> Callable[[Sequence[str], Span], ScenarioStep]:
    def make(words: Sequence[str], span: Span) -> ScenarioStep:
        return ScenarioStep(
            span=span, at_ns=0, action=action, values={words[0]: _time(words[1], "ms")}
        )

    return make


def _count(action: Action) -> Callable[[Sequence[str], Span], ScenarioStep]:
    def make(words: Sequence[str], span: Span) -> ScenarioStep:
        return ScenarioStep(span=span, at_ns=0, action=action, number=_number(words[0], 1_000_000))

    return make


def _duration(action: Action, unit: str) -> Callable[[Sequence[str], Span], ScenarioStep]:
    def make(words: Sequence[str], span: Span) -> ScenarioStep:
        return ScenarioStep(span=span, at_ns=0, action=action, number=_time(words[0], unit))

    return make


def _swap(words: Sequence[str], span: Span) -> ScenarioStep:
    if words[0] == words[1]:
        raise CommandError(f"{words[0]} is swapped with itself; name two")
    return ScenarioStep(span=span, at_ns=0, action=Action.SWAP, target=words[0], other=words[1])


def _wrong(words: Sequence[str], span: Span) -> ScenarioStep:
    names = ("vendor", "product", "revision")
    values = {n: _number(w, _WORD) for n, w in zip(names, words[1:], strict=False)}
    return ScenarioStep(span=span, at_ns=0, action=Action.WRONG, target=words[0], values=values)


def _sdo_abort(words: Sequence[str], span: Span) -> ScenarioStep:
    index, colon, sub = words[1].partition(":")
    values = {"index": _number(index, 0xFFFF), "code": _number(words[2], _WORD)}
    if colon:
        # A subindex has two digits everywhere else, as in 0x1c12:01; it is not octal.
        values["sub"] = _number(sub.lstrip("0") or "0" if sub.isdigit() else sub, 0xFF)
    return ScenarioStep(span=span, at_ns=0, action=Action.SDO_ABORT, target=words[0], values=values)


_FORMS = {
    "break": _Form("SUBDEVICE", _target(Action.BREAK)),
    "heal": _Form("SUBDEVICE", _target(Action.HEAL)),
    "plug": _Form("GROUP", _target(Action.PLUG)),
    "pull": _Form("GROUP", _target(Action.PULL)),
    "power-cycle": _Form("SUBDEVICE", _target(Action.POWER_CYCLE)),
    "local-reset": _Form("CONNECTION", _target(Action.LOCAL_RESET)),
    "press": _Form("[LOGIC]", _button(Action.PRESS)),
    "release": _Form("[LOGIC]", _button(Action.RELEASE)),
    "set": _Form("SIGNAL VALUE", _values(Action.SET, 2**64 - 1)),
    "fsoe-address": _Form("SUBDEVICE ADDRESS", _values(Action.FSOE_ADDRESS, 0xFFFF)),
    "drive-fault": _Form("DRIVE CODE", _values(Action.DRIVE_FAULT, 0xFFFF)),
    "cut": _Form("SUBDEVICE|main", _target(Action.CUT)),
    "splice": _Form("SUBDEVICE|main", _target(Action.SPLICE)),
    "swap": _Form("SUBDEVICE SUBDEVICE", _swap),
    "wrong": _Form("SUBDEVICE VENDOR PRODUCT [REVISION]", _wrong),
    "right": _Form("SUBDEVICE", _target(Action.RIGHT)),
    "narrow-clock": _Form("SUBDEVICE", _target(Action.NARROW_CLOCK)),
    "sdo-abort": _Form("SUBDEVICE INDEX[:SUB] CODE", _sdo_abort),
    "mailbox-delay": _Form("SUBDEVICE TIME", _times(Action.MAILBOX_DELAY)),
    "al-delay": _Form("SUBDEVICE TIME", _times(Action.AL_DELAY)),
    "rx-errors": _Form("SUBDEVICE ERRORS", _values(Action.RX_ERRORS, 255)),
    "lose": _Form("FRAMES", _count(Action.LOSE)),
    "lose-every": _Form("FRAMES", _count(Action.LOSE_EVERY)),
    "repeat": _Form("FRAMES", _count(Action.REPEAT)),
    "delay": _Form("TIME", _duration(Action.DELAY, "us")),
    "stall": _Form("TIME", _duration(Action.STALL, "ms")),
}
_KNOWN = [*_FORMS, "status"]
