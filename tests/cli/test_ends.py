"""What commands say at their end of what rarely happens; the work itself is stood in for."""

from __future__ import annotations

import io
import os
import signal
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace as Facts
from typing import Any

import pytest
from click.testing import CliRunner, Result
from live.made_run import OPTIONS, RESOLUTION, Process
from networks import PLAIN, example
from rich.console import Console

from fsoe_net.acceptance.verify import compare_running
from fsoe_net.cli import (
    campaign,
    campaign_output,
    console,
    emulate,
    emulate_output,
    line_editor,
    options,
    run_output,
    scan,
    test_record,
    test_record_output,
)
from fsoe_net.cli import live_bus as cli_live_bus
from fsoe_net.cli import main as cli_main
from fsoe_net.cli.acceptance_output import print_record
from fsoe_net.document.model import Document
from fsoe_net.errors import EnvironmentFault
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.live import live_bus
from fsoe_net.model.test_record import StepOutcome, StepResult
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import fingerprint_of
from fsoe_net.project.known import Known
from fsoe_net.test_record import trial
from fsoe_net.testing.fake_master import FakeMaster

NETWORK = str(PLAIN / "estop" / "network.yaml")


def call(command: Any, *words: object) -> Result:
    return CliRunner().invoke(command, [str(word) for word in words])


# -- emulate ---------------------------------------------------------------------------------------


def served(**changes: Any) -> Any:
    counts = Facts(frames=2, work_ns=3000, unsent=0, send_errno=0)
    facts = {
        "events": (), "states": {"io": Facts(state="PREOP", error=True, code=0x1E)},
        "connections": {"a": ConnectionState.RESET}, "counts": counts, "verdicts": (),
        "passed": False,
    }  # fmt: skip
    return Facts(**facts | changes)


VERDICT = Facts(held=False, place="s.yaml:4", text="x = 1", seen="was 0")


@pytest.mark.parametrize(
    ("result", "lines"),
    [
        (
            served(),
            [
                "io                       PREOP, error 0x001e",
                "a                        Reset",
                "",
                "2 frames answered, 1.5 us each",
                "not every connection is in Data: no MainDevice has brought all of them to OP",
            ],
        ),
        (
            served(
                states={"io": Facts(state="OP", error=False, code=0)},
                counts=Facts(frames=1, work_ns=1000, unsent=3, send_errno=105),
                connections={},
            ),
            [
                "io                       OP",
                "",
                "1 frame answered, 1.0 us each",
                "3 answers could not be sent: No buffer space available",
                "not every connection is in Data: no MainDevice has copied the FSoE frames between "
                "them",
            ],
        ),
        (
            served(
                states={}, connections={}, verdicts=(VERDICT, Facts(held=True)),
                counts=Facts(frames=0, unsent=0),
            ),
            [
                "",
                "0 frames answered: no MainDevice spoke on this interface",
                "s.yaml:4: not observed: x = 1; was 0",
            ],
        ),
    ],
)  # fmt: skip
def test_end_of_an_emulation_is_printed(
    result: Any, lines: list[str], capsys: pytest.CaptureFixture[str]
):
    emulate_output.print_emulation(result)
    assert capsys.readouterr().out.splitlines()[1:] == lines


@pytest.mark.parametrize("given", [None, "2s"])
def test_emulate_runs_as_long_as_its_scenario(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, given: str | None
):
    scenario = tmp_path / "s.yaml"
    scenario.write_text("version: 1\nduration_s: 7\nsteps: []\n", "utf-8")
    asked: list[int | None] = []

    def serve(
        _session: Any, _link: Any, duration_ns: int | None, *, period_ns: int, **_: Any
    ) -> Any:
        asked.extend((duration_ns, period_ns))
        return served(passed=True)

    monkeypatch.setattr(emulate, "serve", serve)
    more = () if given is None else ("--duration", given, "--device-period", "3ms")
    done = call(emulate.command, NETWORK, "--interface", "x", "--scenario", scenario, *more)
    assert done.exit_code == 0, done.output
    assert asked == ([7_000_000_000, 1_000_000] if given is None else [2_000_000_000, 3_000_000])


# -- campaign --------------------------------------------------------------------------------------


def test_an_interrupted_campaign(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    from fsoe_net.simulate import campaign as at_work

    whole = at_work.run_campaign

    def stopped(*words: Any, **more: Any) -> Any:
        return replace(whole(*words, **more), interrupted=True)

    monkeypatch.setattr(campaign, "run_campaign", stopped)
    monkeypatch.setattr(campaign_output, "save_failures", lambda *_: {("loss", 7): None})
    done = call(
        campaign.command, NETWORK, "--faults", "loss", "--cycles", 20, "--save-dir", tmp_path / "x"
    )
    assert done.exit_code == 130, done.output
    assert "incomplete: nothing wrongly accepted so far\n" in done.output
    assert "loss, trial 7: fails only after a long run, no trace\n" in done.output
    assert done.output.endswith("interrupted: the report holds what was done until then\n")


# -- test record ---------------------------------------------------------------------------------


def test_steps_that_went_wrong_are_named_at_the_end(capsys: pytest.CaptureFixture[str]):
    bad = StepResult(outcome=StepOutcome.NOT_AS_EXPECTED)
    steps = (
        Facts(id="loss io", emulated=bad, live=bad),
        Facts(id="loss io2", emulated=None, live=StepResult(outcome=StepOutcome.AS_EXPECTED)),
    )
    tried: Any = Facts(steps=steps, open_steps=(), machine_steps=steps)
    assert test_record_output.print_outcome(tried, "x.yaml") == 1
    assert capsys.readouterr().out == (
        "x.yaml: 2 steps, 0 of 2 open at the machine\n"
        "1 tried on the emulated bus, 0 not: EMULATED, not evidence for this machine\n"
        "not as expected: loss io\n"
    )


def test_a_test_record_that_breaks_off_before_its_first_step(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(trial, "Client", fake_client)
    monkeypatch.setattr(trial, "run_tests_live", broken)
    monkeypatch.setattr(trial, "write_whole", lambda *_, **__: pytest.fail("nothing was seen"))
    nothing: Any = None
    empty = trial.Trial(resolution=nothing, plan=b"", fingerprint=nothing, test_record=nothing)
    with pytest.raises(EnvironmentFault, match="it broke"):
        test_record._live(empty, "s", "x.yaml", overwrite=False)


class fake_client:  # noqa: N801 - stands for a class
    def __init__(self, _socket: str) -> None:
        pass

    def __enter__(self) -> fake_client:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def broken(*_: object, **more: Any) -> Any:
    raise EnvironmentFault("it broke")


def test_a_step_that_shows_nothing_is_not_reported(capsys: pytest.CaptureFixture[str]):
    step: Any = Facts(id="fault loss", live=None)
    test_record_output.print_step(step)
    assert capsys.readouterr() == ("", "")


# -- the others ------------------------------------------------------------------------------------


def test_an_fsn_master_that_reports_no_fingerprint():
    wanted = Known(path="a", fingerprint=fingerprint_of(compile_plan(example("estop"))))
    with FakeMaster() as fake, pytest.raises(EnvironmentFault) as refused:
        compare_running(wanted, str(fake.path))
    assert str(refused.value) == (
        f"{fake.path}: this fsn-master reports no fingerprint; install a newer one"
    )


@pytest.mark.parametrize(
    ("findings", "lines"),
    [
        ((), []),
        ((1,), ["let pass: 1 warning, 0 others, each by name and reason"]),
    ],
)
def test_a_record_that_is_written(
    findings: tuple[int, ...], lines: list[str], capsys: pytest.CaptureFixture[str]
):
    person = Facts(name="A", date="2026-11-21")
    record: Any = Facts(
        whole="a2be4767288d92e3" + 48 * "0", author=person, verifier=person, findings=findings,
        steps_left_out=(), steps=6,
    )  # fmt: skip
    print_record("x.yaml", record, None)
    assert capsys.readouterr().out.splitlines() == [
        "x.yaml: A2BE 4767 288D 92E3, author A, verifier A, 2026-11-21",
        *lines,
        "Sign the report, and `fsoe-net acceptance sign x.yaml`; keep both in version control.",
    ]


def test_parts_that_a_scan_leaves_out_are_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    found = Facts(texts={"network.yaml": "x"}, left_out=("position 3: not read",))
    monkeypatch.setattr(scan, "take_scan", lambda *_, **__: Facts(scan=None, document={}))
    monkeypatch.setattr(scan, "scan_document", lambda _: Document(title="table"))
    monkeypatch.setattr(scan, "scan_files", lambda _: found)
    done = call(scan.command, "--interface", "x", "-o", tmp_path / "bus")
    assert done.output == (
        f"table\n1 file in {tmp_path}/bus: network.yaml\nleft out: position 3: not read\n"
    )


def test_a_console_without_a_place_for_its_history(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(line_editor, "_history_file", lambda: None)
    nothing: Any = None
    with line_editor.line_editor(nothing):
        pass


def test_the_socket_of_an_interface_is_looked_for(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("fsoe_net.live.sockets.control_socket", lambda name: f"/run/{name}.sock")
    assert options.master_socket(None, "eth1") == "/run/eth1.sock"


def test_a_live_run_shows_its_connections_as_it_goes(monkeypatch: pytest.MonkeyPatch):
    shown = Console(width=120, record=True, file=io.StringIO(), force_terminal=True)
    monkeypatch.setattr(run_output, "terminal", lambda: shown)
    monkeypatch.setattr(live_bus, "_UPDATE_S", 0.01)
    wanted = {"plan_file": None, "incidents": None, "duration_ns": 50_000_000}
    with FakeMaster() as fake:
        process = Process(fake)
        process.pid = process.socket = "?"  # type: ignore[attr-defined]
        monkeypatch.setattr(live_bus, "Master", process)
        told: list[str] = []
        monkeypatch.setattr(cli_live_bus, "echo", lambda text, **_: told.append(text))
        with run_output.display("estop") as show:
            result = cli_live_bus.run_live_bus(RESOLUTION, OPTIONS, wanted, show)
    assert result.passed
    assert told == [
        "fsn-master (process ?) starts on eth1; Ctrl-C stops it; control socket ?",
    ]
    assert "el1918-ek1914" in shown.export_text()


def test_a_second_interrupt_shows_no_traceback(monkeypatch: pytest.MonkeyPatch):
    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr(cli_main, "cli", Facts(main=_interrupted))
    monkeypatch.setattr(cli_main, "echo", lambda *_, **__: os.kill(os.getpid(), signal.SIGINT))
    try:
        with pytest.raises(SystemExit) as ended:
            cli_main.main()
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended.value.code == 130


def _interrupted(**_: object) -> None:
    raise KeyboardInterrupt


def test_ctrl_c_at_the_prompt_leaves_the_line(monkeypatch: pytest.MonkeyPatch, capsys):
    keys = iter([KeyboardInterrupt, EOFError])

    def pressed(_: str) -> None:
        raise next(keys)

    monkeypatch.setattr("builtins.input", pressed)
    monkeypatch.setattr(console, "line_editor", lambda _: nullcontext())
    status = Facts(interface="eth1", backend="soem", state="running")
    context = Facts(link=Facts(call=lambda _: status), tell=lambda: None, owned=list, run_line=None)
    assert console._prompt(context) == 0
    assert capsys.readouterr().out.splitlines()[1:] == [""]
