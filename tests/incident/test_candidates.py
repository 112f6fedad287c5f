"""What one rule makes of facts that no run on the emulated bus brings about."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

import pytest

from fsoe_net.core.bus_documents import (
    Found,
    Layout,
    LayoutCopy,
    PlannedConnection,
    SubDeviceSnapshot,
)
from fsoe_net.core.snapshot import ConnectionSnapshot, DirectionSnapshot, Statistics
from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict
from fsoe_net.fsoe.parameters import FsoeParameters
from fsoe_net.fsoe.pdu import Command, ResetCode
from fsoe_net.incident import causes_bus, causes_fsoe_ends, causes_places, incident_facts
from fsoe_net.incident.candidate import Candidate
from fsoe_net.incident.evidence import IncidentEvidence
from fsoe_net.incident.evidence_cycles import BadCycles, BusWatch, SlowCycle
from fsoe_net.incident.evidence_frames import (
    LinkFacts,
    LinkWatch,
    ResetSeen,
    WireSide,
)
from fsoe_net.incident.incident import (
    CycleRecord,
    IncidentHead,
    Trigger,
    TriggerKind,
)

MS = 1_000_000
MOMENT = 1000 * MS
WATCHDOG = "the watchdog is 100 ms"
AREA = LayoutCopy(source_byte=0, destination_byte=0, size_bytes=6)
PLACES = PlannedConnection(
    name="a", to_sub=AREA, to_main=replace(AREA, source_byte=6, destination_byte=6)
)


def planned(name: str, main: str = "logic") -> PlannedConnection:
    return PlannedConnection(
        name=name,
        main=main,
        sub=f"sub_{name}",
        connection_id=None,
        address=None,
        watchdog_ms=100,
        safe_bytes=(1, 1),
    )


def link(name: str = "a", **changes: Any) -> LinkFacts:
    facts = LinkFacts(
        name=name,
        sides=(WireSide(right=40), WireSide(right=40)),
        resets=(),
        frames=(),
        state=ConnectionState.DATA_PROCESS,
        state_at_moment=ConnectionState.DATA_PROCESS,
        states=frozenset({ConnectionState.DATA_PROCESS}),
        sent_address=None,
        sent_watchdog_ms=None,
        sent_app_bytes=None,
        shifts=(None, None),
        begun=(1, 0),
        time_in_failsafe_ns=(0, 0),
    )
    return replace(facts, **changes)


def reset(**changes: Any) -> ResetSeen:
    facts = ResetSeen(
        now_ns=MOMENT,
        cycle=1000,
        by="sub",
        code=ResetCode.COMMAND,
        state=ConnectionState.DATA_PROCESS,
        silent_ns=(MS, MS),
        waiting_for="sub",
        last_verdict=CrcVerdict.WRONG,
        last_command=Command.PROCESS_DATA,
        last_right=False,
    )
    return replace(facts, **changes)


def device(name: str, position: int, **changes: Any) -> SubDeviceSnapshot:
    facts = SubDeviceSnapshot(
        name=name,
        position=position,
        known=True,
        al="OP",
        al_code=0,
        found=Found.RIGHT,
        detail="",
        returns=0,
        stale_cycles=0,
        bus=0,
        alias=0,
        vendor_id=0,
        product_code=0,
        revision=0,
        link=(),
        link_lost=(),
        rx_errors=(),
    )
    return replace(facts, **changes)


def late(*extra_ms: int) -> dict[str, Any]:
    """Return what the bus says of cycles that came late, the last one 1 ms before the moment."""
    rows = (
        SlowCycle(
            extra_ns=ms * MS, now_ns=MOMENT - n * MS, cycle=n, late_ns=0, work_ns=0, round_ns=0
        )
        for n, ms in enumerate(extra_ms, 1)
    )
    return {"slow": tuple(rows)}


def bad(cycles: int, *, expected: int = 0) -> tuple[BadCycles, ...]:
    """Return a run of cycles without data, 20 ms before the moment."""
    start = MOMENT - 20 * MS
    end = start + cycles * MS
    return (BadCycles(start_ns=start, end_ns=end, cycles=cycles, expected=expected),)


def statistics(**changes: int) -> Statistics:
    rows: dict[str, Any] = dict.fromkeys((f.name for f in fields(Statistics)), 0)
    return Statistics(**rows | changes)


def evidence(
    *links: LinkFacts,
    code: int | None = None,
    by: str = "",
    kind: TriggerKind = TriggerKind.LEFT_DATA,
    subdevices: tuple[SubDeviceSnapshot, ...] = (),
    bus: dict[str, Any] | None = None,
    crossed: dict[str, int] | None = None,
    counters: Statistics | None = None,
    backend: str = "emulated",
) -> IncidentEvidence:
    links = links or (link(),)
    head = IncidentHead(
        utc="",
        version="",
        interface="",
        backend=backend,
        plan_file="",
        plan_sha256="",
        plan=None,
        cycle_ns=MS,
        trigger=Trigger(kind=kind, connection="a", reset_by=by, reset_code=code, now_ns=MOMENT),
        counters=counters,
        connections=(),
        subdevices=subdevices,
        events=(),
        layout=Layout(image_bytes=12, sms=(), datagrams=(), copies=(), connections=(PLACES,)),
        fsoe=(),
    )
    facts = replace(BusWatch(MS).facts(), cycles=1000, last_ns=MOMENT, **(bus or {}))
    return IncidentEvidence(
        head=head,
        bus=facts,
        planned={one.name: planned(one.name) for one in links},
        links={one.name: one for one in links},
        crossed=crossed or {},
        name="a",
        cut="",
    )


def failsafe(*ns: int) -> Iterator[Candidate]:
    one = link(state=ConnectionState.DATA_FAILSAFE, time_in_failsafe_ns=ns)
    return causes_fsoe_ends._failsafe(evidence(one, kind=TriggerKind.REQUEST), one)


GONE = {"al": "none"}
BOTH_DAMAGED = link(
    resets=tuple(
        reset(by=by, code=ResetCode.CRC, now_ns=MOMENT - n * MS)
        for n in (1, 2)
        for by in ["sub", "main"]
    )
)


@pytest.mark.parametrize(
    ("found", "said"),
    [
        pytest.param(
            causes_bus._gone(
                evidence(
                    subdevices=(
                        device("x", 0, **GONE, detail="link after 3 is down", link_down=True),
                    )
                )
            ),
            [
                (
                    "cable_cut",
                    49,
                    "The line is interrupted before x: it and all following devices are gone.",
                    "does not answer: x",
                    "the bus reports for x: link after 3 is down",
                )
            ],
            id="one device is gone and its link too",
        ),
        pytest.param(
            causes_bus._gone(
                evidence(
                    subdevices=(device("x", 0, **GONE), device("sub_a", 1, **GONE), device("y", 2))
                )
            ),
            [
                (
                    "device_lost",
                    92,
                    "sub_a no longer answers on the bus: unplugged, without power, or broken.",
                    "does not answer: x, sub_a",
                )
            ],
            id="of several that are gone, an end of the connection is named",
        ),
        pytest.param(
            causes_bus._cycle(evidence(bus=late(2, 1), code=ResetCode.WATCHDOG)),
            [
                (
                    "cycle_overruns",
                    35,
                    "Many cycles came late: the MainDevice does not keep its cycle.",
                    "cycle 1 came 2 ms late, 1 ms before the moment; the bus cycle is 1 ms",
                    "2 late cycles in the 150 ms before the moment, 3 ms in all; the "
                    "watchdog is 100 ms",
                )
            ],
            id="a watchdog, and two late cycles",
        ),
        pytest.param(
            causes_bus._cycle(evidence(bus=late(2, 1), code=ResetCode.CRC)),
            [],
            id="another reset, and two late cycles",
        ),
        pytest.param(
            causes_bus._cycle(
                evidence(
                    link(),
                    link("b", state_at_moment=ConnectionState.RESET),
                    bus=late(50),
                    counters=statistics(overruns=1),
                    backend="soem",
                )
            ),
            [
                (
                    "stalled_main_device",
                    93,
                    "The MainDevice stalled: no cycle ran for longer than a connection tolerates.",
                    "cycle 1 came 50 ms late, 1 ms before the moment; the bus cycle is 1 ms",
                    "1 late cycle in the 150 ms before the moment, 50 ms in all; the watchdog "
                    "is 100 ms",
                    "1 overrun since the start",
                    "no real-time policy",
                    "2 connections are affected",
                )
            ],
            id="one very late cycle without a real-time policy, counted as an overrun",
        ),
        pytest.param(
            causes_bus._lost_frames(
                evidence(
                    bus={"short": bad(5, expected=3)},
                    counters=statistics(unsent_frames=1, send_errno=100),
                )
            ),
            [
                (
                    "lost_frames",
                    60,
                    "EtherCAT frames were lost in bursts: for a while no data came back.",
                    "around the moment 1 burst, 5 ms without data, the watchdog is 100 ms",
                    "in the whole file 1 burst, the longest 5 ms",
                    "1 frame could not be sent: Network is down",
                )
            ],
            id="a burst of lost frames, one of which was not sent",
        ),
        pytest.param(
            causes_bus._lost_frames(
                evidence(
                    bus={"lost": bad(60), "lost_frames": 60},
                    subdevices=(device("x", 0, rx_errors=(0, 4)),),
                    counters=statistics(),
                )
            ),
            [
                (
                    "lost_frames",
                    90,
                    "EtherCAT frames were lost in bursts: for a while no data came back.",
                    "around the moment 1 burst, 60 ms without data, the watchdog is 100 ms",
                    "60 frames counted as lost",
                    "receive errors are counted first at x (4)",
                )
            ],
            id="many lost frames without a burst, and receive errors",
        ),
        pytest.param(
            causes_bus._lost_frames(evidence(bus={"lost": bad(1), "lost_frames": 1})),
            [
                (
                    "lost_frames",
                    30,
                    "EtherCAT frames were lost in bursts: for a while no data came back.",
                    "around the moment 1 burst, 1 ms without data, the watchdog is 100 ms",
                    "1 frame counted as lost",
                )
            ],
            id="one lost frame",
        ),
        pytest.param(
            causes_bus._lost_frames(
                evidence(
                    bus={
                        "lost": bad(30),
                        "lost_frames": 30,
                        "short": bad(80, expected=3),
                        "old_replies": 20,
                        "old": ((MOMENT - 10 * MS, 20),),
                    }
                )
            ),
            [
                (
                    "late_replies",
                    94,
                    "Replies came back after their cycle was over: the cycle is too short, or "
                    "the machine is too busy.",
                    "30 cycles without frames around the moment, replies that came later: 20; "
                    "in the whole file 30 and 20",
                    "around the moment 1 burst, 80 ms without data, the watchdog is 100 ms",
                    "in the whole file 1 burst, the longest 80 ms",
                ),
                (
                    "lost_frames",
                    84,
                    "EtherCAT frames were lost in bursts: for a while no data came back.",
                    "around the moment 1 burst, 80 ms without data, the watchdog is 100 ms",
                    "in the whole file 1 burst, the longest 80 ms",
                    "30 frames counted as lost",
                ),
            ],
            id="late replies in a longer burst",
        ),
        pytest.param(
            causes_bus._lost_frames(
                evidence(
                    bus={
                        "lost": bad(2),
                        "lost_frames": 2,
                        "old_replies": 1,
                        "old": ((MOMENT - 19 * MS, 1),),
                    }
                )
            ),
            [
                (
                    "late_replies",
                    62,
                    "Replies came back after their cycle was over: the cycle is too short, or "
                    "the machine is too busy.",
                    "2 cycles without frames around the moment, replies that came later: 1; in "
                    "the whole file 2 and 1",
                    "around the moment 1 burst, 2 ms without data, the watchdog is 100 ms",
                )
            ],
            id="two replies that came later",
        ),
        pytest.param(
            causes_fsoe_ends._local(evidence(code=ResetCode.LOCAL, by="main")),
            [
                (
                    "local_reset",
                    78,
                    "logic has reset a itself (code 0): it reported no fault in a frame.",
                    "logic reset with code 0, all frames before were right",
                ),
                (
                    "main_restarted",
                    60,
                    "logic has restarted or its safety program was stopped: it reset all "
                    "its connections.",
                    "logic reset with code 0, all frames before were right",
                ),
            ],
            id="the only connection of a main",
        ),
        pytest.param(
            causes_fsoe_ends._forgot(evidence(link(resets=(reset(),)))),
            [],
            id="a wrong frame is refused, which is no restart",
        ),
        pytest.param(
            failsafe(0, 300 * MS),
            [
                (
                    "failsafe",
                    84,
                    "The connection is up, but sub_a sends FailSafeData.",
                    "sub_a has sent FailSafeData for 300 ms of 1000 ms",
                    "the other end sends ProcessData",
                    "all frames of both directions have right CRCs",
                )
            ],
            id="the sub alone sends FailSafeData",
        ),
        pytest.param(
            failsafe(MS, MS),
            [],
            id="FailSafeData for a moment",
        ),
        pytest.param(
            causes_places._crossed(
                evidence(link(), link("b"), crossed={"b": 9}),
                planned("a"),
                link(),
            ),
            [
                (
                    "copies_crossed",
                    97,
                    "The copies of a and b are crossed: each end talks to the wrong peer.",
                    "9 frames fit a partner in b, 0 the planned one",
                )
            ],
            id="frames that fit another connection",
        ),
        pytest.param(
            causes_places._altered(
                evidence(BOTH_DAMAGED, kind=TriggerKind.NOT_CONNECTED), planned("a"), BOTH_DAMAGED
            ),
            [
                (
                    "second_writer",
                    70,
                    "Something else writes into the frames of a: good frames do not arrive "
                    "as sent.",
                    "sub_a refused frames 2 times as damaged",
                    "the frames of logic were right where they came in: 40, wrong 0",
                ),
                (
                    "second_writer",
                    70,
                    "Something else writes into the frames of a: good frames do not arrive "
                    "as sent.",
                    "logic refused frames 2 times as damaged",
                    "the frames of sub_a were right where they came in: 40, wrong 0",
                ),
            ],
            id="both ends refuse right frames",
        ),
    ],
)
def test_candidates_have_key_score_title_and_evidence(found, said):
    assert [(c.key, c.score, c.title, *c.evidence) for c in found] == said


def test_other_parameters_than_the_plan_are_a_remark():
    way = DirectionSnapshot(**dict.fromkeys((f.name for f in fields(DirectionSnapshot)), 0))
    seen = ConnectionSnapshot(
        state=ConnectionState.DATA_PROCESS,
        to_sub=way,
        to_main=way,
        gaps=0,
        configured=FsoeParameters(connection_id=4, address=202, watchdog_ms=100),
        observed=FsoeParameters(connection_id=2099, address=202, watchdog_ms=4000),
        differs=("connection_id", "watchdog_ms"),
    )
    rows = [
        replace(one, name=name, net="n", main="logic", sub=f"sub_{name}")
        for name, one in (("a", seen), ("b", replace(seen, differs=())))
    ]
    e = evidence()
    assert incident_facts._remarks(replace(e, head=replace(e.head, connections=tuple(rows)))) == (
        "a ran with other parameters than the plan: connection ID 2099, 4 in the plan; watchdog "
        "4000 ms, 100 ms in the plan",
    )


def test_addresses_that_go_round_without_the_first():
    owner = {2: "b", 3: "c"}
    assert causes_places._round("a", {"a": 2, "b": 3, "c": 2}, owner) == []


def test_facts_of_cycles_are_bounded(monkeypatch):
    """Runs that are not kept still count."""
    monkeypatch.setattr("fsoe_net.incident.evidence_cycles._MOST_RUNS", 2)
    watch = BusWatch(MS)
    for n in range(20):
        bad = n % 2
        now = n * 10 * MS
        watch.cycle(CycleRecord(cycle=n, now_ns=now, lost=bad, wkc=(3, 2) if bad else None))
    facts = watch.facts()
    assert [(r.start_ns // MS, r.cycles) for r in facts.short] == [(10, 1), (30, 1)]
    assert [(r.start_ns // MS, r.cycles) for r in facts.lost] == [(10, 1), (30, 1)]
    assert [s.cycle for s in facts.slow] == [1, 2]
    assert (facts.lost_frames, facts.late_cycles) == (10, 19)


def watch() -> LinkWatch:
    return LinkWatch(PLACES, MOMENT, bounds=((0, 6), (6, 12)), taken=frozenset())


def test_facts_of_frames_are_bounded(monkeypatch):
    monkeypatch.setattr("fsoe_net.incident.evidence_frames._MOST_RESETS", 2)
    monkeypatch.setattr("fsoe_net.incident.evidence_frames._SEARCHES", 2)
    one = watch()
    for n in range(9):
        frame = bytes([Command.RESET, n, 0, 0, 0, 0]) if n % 2 else bytes([0xFF, n, 0, 0, 0, 0])
        one.cycle(n, n * MS, frame + bytes(6))
    facts = one.facts()
    assert [r.code for r in facts.resets] == [1, 3]
    assert one._searched == [2, 0]
    assert (facts.sides[0].frames, facts.sides[1].frames) == (9, 0)


def test_an_emptied_image_is_not_a_frame():
    one = watch()
    for n, frame in enumerate((bytes([Command.RESET, 5, 0, 0, 0, 0]), bytes(6))):
        one.cycle(n, n * MS, frame + bytes(6))
    assert [f.data[:2].hex() for f in one.facts().frames] == ["2a05"]


@pytest.mark.parametrize(("cycle_ns", "count"), [(0, 1), (9 * MS, 1), (10 * MS, 0)])
def test_a_slow_bus_is_not_a_slow_device(cycle_ns: int, count: int) -> None:
    """The sub answers after 38 ms: four cycles of 10 ms of its own bus, far more of the first."""
    sides = (
        WireSide(right=40, waits=10, waits_sum_ns=30 * MS, waits_most_ns=4 * MS),
        WireSide(right=40, waits=10, waits_sum_ns=380 * MS, waits_most_ns=40 * MS),
    )
    one = link(sides=sides)
    e = replace(evidence(one), planned={"a": replace(planned("a"), cycle_ns=cycle_ns)})
    codes = Counter({("sub", int(ResetCode.WATCHDOG)): 1})
    keys = [c.key for c in causes_fsoe_ends._watchdog(e, one, codes)]
    assert keys.count("slow_device") == count
