"""Runs a checked network on the emulated bus."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from fsoe_net.capture.capture import CaptureWriter
from fsoe_net.diag.diagnostic import Severity, sort_diagnostics
from fsoe_net.diag.words import summary
from fsoe_net.errors import InputError
from fsoe_net.formats.own.scenario import load_scenario
from fsoe_net.live.result import Run, RunUpdate
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.scenario import Scenario
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.model import Plan
from fsoe_net.simulate.incidents import IncidentRecorder
from fsoe_net.simulate.scenario_run import ScenarioRun
from fsoe_net.simulate.session import (
    DEVICE_PERIOD_NS,
    Session,
    counted_session_ids,
    random_session_ids,
    run_live,
    run_virtual,
)

_Run = TypeVar("_Run", bound=ScenarioRun)


def simulate(
    resolution: Resolution,
    *,
    plan_file: str | None = None,
    scenario_file: str | None = None,
    duration_ns: int | None = None,
    virtual: bool = True,
    capture: str | None = None,
    incidents: str | None = None,
    device_period_ns: int | None = None,
    on_update: Callable[[RunUpdate], None] | None = None,
) -> Run:
    """Run a checked network on the emulated bus.

    Args:
        resolution: The network.
        plan_file: A plan that must match the network.
        scenario_file: Steps and expectations.
        duration_ns: Duration; by default that of the scenario, or 3 s.
        virtual: Simulated time; otherwise the C core cycles in real time.
        capture: File for the frames of a virtual run (pcapng).
        incidents: Folder for an incident file if a connection fails.
        device_period_ns: Cycle of the emulated devices in real time; by default 1 ms.
        on_update: Called about ten times a second during a run in real time.

    Raises:
        InputError: As in `prepare`.
        CoreMissing: The compiled part is missing.
        EnvironmentFault: A file cannot be written.
    """
    session = prepare(resolution, plan_file, scenario_file, virtual=virtual)
    duration_ns = duration_ns or session.duration_ns
    recorder = None
    if incidents is not None:
        recorder = IncidentRecorder(session, Path(incidents), background=not virtual)
    if not virtual:
        return run_live(
            session,
            duration_ns,
            device_period_ns=device_period_ns or DEVICE_PERIOD_NS,
            on_update=on_update,
            incidents=recorder,
        )
    if capture is None:
        return run_virtual(session, duration_ns, incidents=recorder)
    with CaptureWriter(capture) as writer:
        return run_virtual(session, duration_ns, capture=writer, incidents=recorder)


def prepare(
    resolution: Resolution, plan_file: str | None, scenario_file: str | None, *, virtual: bool
) -> Session:
    """Build a session from a checked network.

    Raises:
        InputError: The plan is for another network, or the scenario has errors.
    """
    data = plan_bytes(resolution, plan_file)
    # Virtual runs must repeat exactly; real ones draw session ids at random, as FSoE requires.
    ids = counted_session_ids() if virtual else random_session_ids()
    return with_scenario(
        lambda scenario: Session(resolution, data, scenario, session_ids=ids), scenario_file
    )


def plan_bytes(resolution: Resolution, plan_file: str | None) -> bytes:
    """Return the compiled plan; a given plan file must be equal.

    Raises:
        InputError: The plan is for another network.
    """
    fresh = compile_plan(resolution).to_bytes()
    return fresh if plan_file is None else _plan_of(plan_file, fresh)


def _plan_of(plan_file: str, fresh: bytes) -> bytes:
    if Plan.load(plan_file).to_bytes() != fresh:
        raise InputError(
            f"{plan_file} was not compiled from these files; `fsoe-net plan … -o {plan_file}` "
            "compiles it again"
        )
    return fresh


def with_scenario(make: Callable[[Scenario | None], _Run], path: str | None) -> _Run:
    """Return a stage with the scenario of a file, or without a scenario.

    Raises:
        InputError: The scenario has errors, in itself or against the network, all reported at once.
    """
    if path is None:
        return make(None)
    scenario, found = load_scenario(path)
    found = [d for d in found if d.level is not Severity.INFO]
    if scenario is None:
        raise InputError(f"the scenario has mistakes: {summary(found)}", found)
    stage = make(scenario)
    # A place that the reader has reported is not reported again.
    named = {d.span for d in found}
    misfits = [d for d in stage.scenario_findings() if d.span not in named]
    if found or misfits:
        words = "has mistakes" if found else "does not fit this network"
        everything = sort_diagnostics([*found, *misfits])
        raise InputError(f"the scenario {words}: {summary(everything)}", everything)
    return stage
