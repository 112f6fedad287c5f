"""Compares a network, plan or running core with the accepted state."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from dataclasses import dataclass, replace

from fsoe_net.compare.diff import compare
from fsoe_net.compare.sides import Side, side_of_plan
from fsoe_net.diag.words import counted
from fsoe_net.errors import ControlRefused, EnvironmentFault
from fsoe_net.fsoe.parameters import differences
from fsoe_net.plan.model import Plan
from fsoe_net.project.known import Known

_SHOWN_LINES = 20
_OBSERVED = "observed_parameters"


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One item compared with the accepted state.

    Attributes:
        known: The item.
        note: Other facts about it; of a running core its version and bus cycle.
        sections: Sections of the fingerprint that differ; empty when it is the same.
        lines: Differences, one per line.
    """

    known: Known
    note: str
    sections: tuple[str, ...]
    lines: tuple[str, ...]

    @property
    def same(self) -> bool:
        """Whether it equals the accepted state."""
        return not self.sections


def compare_running(wanted: Known, socket: str) -> Comparison:
    """Compare what a running core has loaded with what was accepted.

    A bus cycle other than that of the plan counts as a differing section. So do parameters on the
    wire that differ from those of the plan.

    Raises:
        EnvironmentFault: No process answers on the socket, or it reports no fingerprint.
    """
    from fsoe_net.live.client import Client
    from fsoe_net.live.in_use import fingerprint_in_use

    with Client(socket) as client:
        status = client.status()
        try:
            connections = client.connections()
        # A stopped bus has a fingerprint, but no connections to observe.
        except ControlRefused as refused:
            if not refused.bus_stopped:
                raise
            connections = ()
    fingerprint = fingerprint_in_use(status)
    if fingerprint is None:
        raise EnvironmentFault(
            f"{socket}: this fsn-master reports no fingerprint; install a newer one"
        )
    found = compare_known(wanted, Known(path=socket, fingerprint=fingerprint))
    observed = sum(c.observed.watchdog_ms is not None for c in connections)
    note = (
        f"fsn-master {status.version}, cycle {status.cycle_ns / 1e6:g} ms, parameters of "
        f"{observed} of {counted(len(connections), 'connection')} observed"
    )
    lines = tuple(
        f"! {c.name}: {text}"
        for c in connections
        for text in differences(c.differs, c.configured, c.observed)
    )
    # Parameters on the wire may differ although the loaded plan is the accepted one.
    sections = (*found.sections, _OBSERVED) if lines else found.sections
    return replace(found, note=note, sections=sections, lines=(*found.lines, *lines))


def compare_known(wanted: Known, given: Known, note: str = "") -> Comparison:
    """Compare a network, plan, record or fingerprint with the accepted state."""
    sections = wanted.fingerprint.changed(given.fingerprint)
    lines = tuple(_difference(wanted, given, sections)) if sections else ()
    return Comparison(known=given, note=note, sections=sections, lines=lines)


def _difference(wanted: Known, given: Known, sections: tuple[str, ...]) -> Iterator[str]:
    """Yield the differences by meaning, then as text for sections that this does not cover."""
    by_meaning = False
    if wanted.plan is not None and given.plan is not None:
        # File names are ignored.
        sides = (_side(wanted.plan, wanted), _side(given.plan, given))
        for change in compare(*sides).changes:
            by_meaning = True
            yield str(change)
    hidden = ""
    for name in sections:
        before, after = wanted.section_text(name), given.section_text(name)
        if before is None or after is None:
            hidden = wanted.name if before is None else given.name
        elif not by_meaning or name in ("devices", "process_data"):
            yield from _changed_lines(name, before, after)
    if hidden:
        yield f"of {hidden} only hashes are known: two networks or plans show what changed"


def _side(plan: Plan, known: Known) -> Side:
    return side_of_plan(plan, "", known.functions)


def _changed_lines(name: str, before: str, after: str) -> Iterator[str]:
    a, b = before.splitlines(), after.splitlines()
    while a and b and a[0] == b[0]:  # long sections differ in a few places
        a, b = a[1:], b[1:]
    while a and b and a[-1] == b[-1]:
        a, b = a[:-1], b[:-1]
    # A line-by-line comparison of very long texts takes minutes.
    if len(a) + len(b) > 20_000:
        yield (
            f"{name}: {counted(len(a), 'line')} became {len(b)}; `fsoe-net plan --canonical "
            f"{name}` prints them"
        )
        return
    changed = [line for line in difflib.ndiff(a, b) if line[:1] in "+-"]
    for line in changed[:_SHOWN_LINES]:
        yield f"{name} {line[0]} {line[2:]}"
    if len(changed) > _SHOWN_LINES:
        yield (
            f"{name}: {counted(len(changed) - _SHOWN_LINES, 'more line')}; `fsoe-net "
            "plan --canonical` prints them"
        )
