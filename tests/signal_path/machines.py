"""A schedule of the compact model, run again by MainInstance and SubInstance."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from signal_path.path import NEVER, End, Link

from fsoe_net.fsoe.config import MainConfig, SubConfig
from fsoe_net.fsoe.event import State
from fsoe_net.fsoe.instance import Instance
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.sub_instance import SubInstance

START_NS = 1_000_000_000
OLD, NEW = b"\x01", b"\x00"


@dataclass(slots=True)
class _Running:
    """An instance with what was delivered to it and what it wrote."""

    instance: Instance
    plan: End  # of the compact model
    image: bytes | None = None
    written: int = 0


def watchdog_ms(link: Link) -> int:
    """Return the watchdog of both ends; machines have whole milliseconds and one for both."""
    return link.main.watchdog // 1_000_000


def _in_data(link: Link) -> tuple[MainInstance, SubInstance, bytes, bytes]:
    """Return both ends in Data, the newest frames of main and sub; main stepped at 0."""
    main = MainInstance(
        MainConfig(
            connection_id=1,
            address=1,
            watchdog_ms=watchdog_ms(link),
            safe_out_bytes=1,
            safe_in_bytes=1,
        ),
        session_ids=itertools.count(0x1234).__next__,
    )
    sub = SubInstance(
        SubConfig(address=1, safe_out_bytes=1, safe_in_bytes=1),
        session_ids=itertools.count(0x4321).__next__,
    )
    main.set_safe_data(OLD)
    sub.set_safe_data(OLD)
    before = START_NS + link.sub.starts[0]
    to_sub: bytes | None = None
    to_main: bytes | None = None
    for _ in range(100):
        to_sub = main.step(before, to_main) or to_sub
        main.enable = main.state is State.DATA
        to_main = sub.step(before, to_sub) or to_main
        sub.enable = sub.state is State.DATA
        if main.data_valid and sub.data_valid:
            break
    assert main.data_valid
    assert sub.data_valid
    assert to_main is not None
    first = main.step(START_NS, to_main)
    assert first is not None
    return main, sub, first, to_main


def run(link: Link, *, to_main: bool) -> int:
    """Return what `Link.run` returned for this link, found with the real ends.

    Every start of a cycle of the model is one step; between two of them, as often as a task whose
    cycles last at most its time must, the ends are stepped too.
    """
    main, sub, first, kept = _in_data(link)
    ends = _Running(main, link.main), _Running(sub, link.sub)
    holder, reader = (ends[1], ends[0]) if to_main else (ends[0], ends[1])
    deliveries = [(link.main.sent[0][1], ends[1], first)]
    ends[0].written = 1
    ends[0].image = kept
    ends[1].image = None
    for now, end in _steps(ends):
        for item in sorted(deliveries, key=lambda d: d[0]):
            if item[0] <= now:
                item[1].image = item[2]
        deliveries = [d for d in deliveries if d[0] > now]
        if end is holder and now >= link.ready:
            end.instance.set_safe_data(NEW)
        frame = end.instance.step(START_NS + now, end.image)
        if end is reader and end.instance.received_safe_data == NEW:
            return now - link.ready
        if frame is not None and end.written < len(end.plan.sent):
            other = ends[1] if end is ends[0] else ends[0]
            delivered = end.plan.sent[end.written][1]
            end.written += 1
            if delivered < NEVER:
                deliveries.append((delivered, other, frame))
    raise AssertionError("the reading end never acted")


def _steps(ends: tuple[_Running, _Running]) -> list[tuple[int, _Running]]:
    """Return all cycles after the first of main, those that the model names and those between."""
    found: list[tuple[int, int, _Running]] = []
    for number, end in enumerate(ends):
        plan = end.plan
        began = plan.starts[number:]  # what the sub sent before the model began is not in its plan
        written = dict(zip(began, (w for w, _ in plan.sent), strict=False))
        for last, now in itertools.pairwise(plan.starts):
            found.append((now, number, end))
            between = now - plan.task
            while between > written.get(last, last):
                found.append((between, number, end))
                between -= plan.task
    return [(now, end) for now, _, end in sorted(found, key=lambda f: f[:2])]
