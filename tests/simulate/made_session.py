"""A session on the emulated bus."""

from __future__ import annotations

from networks import example

from fsoe_net.model.resolve import Resolution
from fsoe_net.plan.compile import compile_plan
from fsoe_net.simulate.session import Session, counted_session_ids


def session(resolution: Resolution | None = None) -> Session:
    resolution = resolution or example("estop")
    data = compile_plan(resolution).to_bytes()
    return Session(resolution, data, None, session_ids=counted_session_ids())
