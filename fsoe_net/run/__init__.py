"""Live sessions: emulated devices, the C core and a scenario, in virtual or real time."""

from fsoe_net.run.emulate import EmulateResult, SegmentSession, serve
from fsoe_net.run.result import ConnectionResult, RunEvent, RunResult, Verdict, state_text
from fsoe_net.run.session import (
    Session,
    counted_session_ids,
    random_session_ids,
    run_live,
    run_virtual,
)

__all__ = [
    "ConnectionResult",
    "EmulateResult",
    "RunEvent",
    "RunResult",
    "SegmentSession",
    "Session",
    "Verdict",
    "counted_session_ids",
    "random_session_ids",
    "run_live",
    "run_virtual",
    "serve",
    "state_text",
]
