"""Live sessions: emulated devices, the C core and a scenario, in virtual or real time."""

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
    "RunEvent",
    "RunResult",
    "Session",
    "Verdict",
    "counted_session_ids",
    "random_session_ids",
    "run_live",
    "run_virtual",
    "state_text",
]
