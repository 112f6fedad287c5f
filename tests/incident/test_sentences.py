"""What an incident's page says first: one sentence for each way in which one begins."""

from __future__ import annotations

from types import SimpleNamespace as Facts

import pytest

from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.incident.evidence import TriggerKind
from fsoe_net.incident.incident_facts import _sentence


def evidence(kind: TriggerKind, *, link: object = None, **more: object) -> Facts:
    told = {"text": "", "before": None, "after": None, "kind": kind}
    trigger = Facts(**told | {k: v for k, v in more.items() if k in told})
    rest = {"name": "c1", "code": None, "by": "", "plan": Facts(main="logic", sub="drive")}
    rest |= {k: v for k, v in more.items() if k in rest}
    head = Facts(utc=more.get("utc", "2026-11-21T10:00:00Z"), trigger=trigger)
    return Facts(head=head, link=link, **rest)


RESETS = Facts(
    resets=[Facts(code=0, by="main"), Facts(code=3, by="main"), Facts(code=5, by="sub")],
    state_at_moment=ConnectionState.SESSION,
)


@pytest.mark.parametrize(
    ("facts", "sentence"),
    [
        (
            evidence(TriggerKind.BUS_FAILED, text="no reply"),
            "At 2026-11-21 10:00:00 UTC the bus did not open: no reply.",
        ),
        (
            evidence(TriggerKind.BUS_FAILED, utc=""),
            "At unknown time the bus did not open: no reason was reported.",
        ),
        (
            evidence(TriggerKind.REFUSED, text="0x1C12: refused"),
            "At 2026-11-21 10:00:00 UTC the bus reported: 0x1C12: refused.",
        ),
        (
            evidence(TriggerKind.REQUEST, text="by hand", after=ConnectionState.DATA_PROCESS),
            "At 2026-11-21 10:00:00 UTC this was recorded on request (by hand). c1 was in "
            "Data · ProcessData.",
        ),
        (
            evidence(TriggerKind.REQUEST, name=""),
            "At 2026-11-21 10:00:00 UTC this was recorded on request.",
        ),
        (
            evidence(TriggerKind.NOT_CONNECTED),
            "Connection c1 did not reach Data; at 2026-11-21 10:00:00 UTC it was in an unknown "
            "state, and it was not reset with an error.",
        ),
        (
            evidence(TriggerKind.NOT_CONNECTED, link=RESETS),
            "Connection c1 did not reach Data; at 2026-11-21 10:00:00 UTC it was in Session; "
            "2 resets with an error, the last by the SubInstance in drive with code 5, "
            "watchdog expired.",
        ),
        (
            evidence(
                TriggerKind.LEFT_DATA,
                before=ConnectionState.DATA_PROCESS,
                after=ConnectionState.RESET,
            ),
            "Connection c1 left Data · ProcessData for Reset at 2026-11-21 10:00:00 UTC; "
            "no reset was seen.",
        ),
        (
            evidence(TriggerKind.LEFT_DATA, code=5, by="main", plan=None),
            "Connection c1 left Data for another state at 2026-11-21 10:00:00 UTC: the "
            "MainInstance reset it with code 5, watchdog expired.",
        ),
    ],
)
def test_incident_is_described_in_one_sentence(facts: Facts, sentence: str):
    assert _sentence(facts) == sentence
