"""The standard program of an emulated run: when axes turn, and when they do not."""

from __future__ import annotations

from networks import example

from fsoe_net.project.simulate import prepare
from fsoe_net.simulate.axis_program import AxisProgram
from fsoe_net.simulate.session import Session

STOP = ("el1904.0x6001:01", "el1904.0x6001:02")


def run(session: Session, program: AxisProgram, begin_ms: int, end_ms: int) -> None:
    for ms in range(begin_ms, end_ms):
        session.core.cycle(ms * 1_000_000)
        session.step_devices(ms * 1_000_000)
        program.step()


def speeds(session: Session) -> list[float]:
    """Return the speeds of all axes in revolutions per second."""
    axes = session.network.axes.values()
    return [round(wired.axis.context.servo.plant.speed / 6.2832, 2) for wired in axes]


def test_axes_turn_after_a_start_until_the_e_stop_and_not_by_a_reset_alone() -> None:
    session = prepare(example("robot-cell"), None, None, virtual=True)
    program = AxisProgram(session)
    assert program.can_run
    run(session, program, 1, 500)
    assert speeds(session) == [0, 0]
    program.start()
    run(session, program, 500, 1500)
    assert speeds(session) == [0.5, 0.5]
    for name in STOP:
        session.network.set_safe_input(name, 0)
    run(session, program, 1500, 3000)
    assert (speeds(session), program.runs) == ([0, 0], False)
    for name in STOP:
        session.network.set_safe_input(name, 1)
    run(session, program, 3000, 3050)  # a reset counts after the inputs have reached the logic
    session.do_command("press", 1, 0)
    run(session, program, 3050, 3100)
    session.do_command("release", 2, 0)
    run(session, program, 3100, 4000)
    assert session.network.masters[0].logic.on
    assert speeds(session) == [0, 0]
    program.start()
    run(session, program, 4000, 5000)
    assert speeds(session) == [0.5, 0.5]
    program.stop()
    run(session, program, 5000, 8000)
    assert speeds(session) == [0, 0]


def test_a_network_without_drives_has_nothing_to_turn() -> None:
    session = prepare(example("estop"), None, None, virtual=True)
    assert not AxisProgram(session).can_run
