"""Every wrong option is named, with the exit code that says whose fault it is."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest
from master.rig import NOBODY, program, run_to_end, running, write_plan

from fsoe_net.plan.codec import decode_plan
from fsoe_net.plan.fingerprint import fingerprint_of

USAGE = [
    (["--bus", "emulated"], "PLAN: the plan is missing"),
    (["PLAN"], "--interface: is missing"),
    (["PLAN", "--bus", "ethercat"], "--bus ethercat: soem, igh or emulated"),
    (["PLAN", "PLAN", "--bus", "emulated"], "one plan only"),
    (["PLAN", "--bus", "emulated", "--cycle", "1"], "--cycle 1: a time from 50us to 1s"),
    (["PLAN", "--bus", "emulated", "--cycle", "1us"], "--cycle 1us: a time from 50us to 1s"),
    (["PLAN", "--bus", "emulated", "--cycle", "5s"], "--cycle 5s: a time"),
    (["PLAN", "--bus", "emulated", "--cycle", "-1ms"], "--cycle -1ms: a time"),
    (["PLAN", "--bus", "emulated", "--cycle", "1 ms"], "--cycle 1 ms: a time"),
    (["PLAN", "--bus", "emulated", "--policy", "rr"], "--policy rr: fifo, deadline or other"),
    (["PLAN", "--bus", "emulated", "--priority", "0"], "--priority 0: 1 to 99"),
    (["PLAN", "--bus", "emulated", "--priority", "x"], "--priority x: 1 to 99"),
    (["PLAN", "--bus", "emulated", "--policy", "other", "--priority", "5"], "only with --policy"),
    (["PLAN", "--bus", "emulated", "--cpu", "-1"], "--cpu -1: a CPU number"),
    (["PLAN", "--bus", "emulated", "--policy", "deadline", "--cpu", "0"], "cannot be pinned"),
    (["PLAN", "--bus", "emulated", "--policy", "deadline", "--free-run"], "has a period"),
    (["PLAN", "--bus", "emulated", "--dc-every", "1.5"], "--dc-every 1.5"),
    (["PLAN", "--bus", "emulated", "--dc-clock", "me"], "--dc-clock me: bus or host"),
    (["PLAN", "--bus", "emulated", "--dc-shift", "0us"], "--dc-shift 0us: a time up to"),
    (["PLAN", "--bus", "emulated", "--dc-shift", "2s"], "--dc-shift 2s: a time up to"),
    (["PLAN", "--bus", "emulated", "--dc-window", "99ns"], "--dc-window 99ns: a time from 100ns"),
    (["PLAN", "--bus", "emulated", "--dc-window", "1"], "--dc-window 1: a time from 100ns"),
    (["PLAN", "--bus", "emulated", "--duration", "0"], "--duration 0: a time above 0"),
    (["PLAN", "--bus", "emulated", "--wait", "soon"], "--wait soon: a time"),
    (["PLAN", "--bus", "emulated", "--record", "-1s"], "--record -1s: a time"),
    (["PLAN", "--bus", "emulated", "--accepted", "12"], "--accepted 12: a SHA-256 has 64"),
    (["PLAN", "--bus", "emulated", "--acceptance", "a"], "belongs together with --signers FILE"),
    (["PLAN", "--bus", "emulated", "--signers", "a"], "belongs together with --signers FILE"),
    (["PLAN", "--bus", "emulated", "--revoked", "a"], "--revoked a: goes with --signers FILE"),
    (["PLAN", "--bus", "emulated", "--allow-user", "no such"], "unknown user"),
    (["PLAN", "--bus", "emulated", "--allow-group", "no such"], "unknown group"),
    (["PLAN", "--bus", "emulated", "--allow-user", "root:all"], "observer, operator or maintainer"),
    (["PLAN", "--bus", "emulated", "--allow-user", "x" * 300], "unknown user"),
    (["PLAN", "--bus", "emulated", "--log", "xml"], "--log xml: text or json"),
    (["PLAN", "--bus", "emulated", "--redundant", "b"], "takes no second interface"),
    (["PLAN", "--bus", "soem", "--interface", "a", "--redundant", "a"], "same interface twice"),
    (["PLAN", "--bus", "emulated", "--xdp"], "--xdp: this bus has no AF_XDP"),
    (["PLAN", "--interface", "a", "--xdp", "--take-over"], "--xdp: is for a bus that"),
    (["PLAN", "--interface", "a", "--xdp", "--standby"], "--xdp: is for a bus that"),
    (["--scan", "--interface", "a", "--xdp"], "--xdp: is for a bus that"),
    (["--scan", "--interface", "a", "--take-over"], "--take-over: goes with a plan"),
    (["--scan", "--interface", "a", "--standby"], "--standby: goes with a plan"),
    (["PLAN", "--bus", "emulated", "--standby", "--take-over"], "--standby: either at once"),
    (["PLAN", "--bus", "emulated", "--sockets", "x"], "unrecognized option '--sockets'"),
    (["PLAN", "--bus"], "requires an argument"),
]


@pytest.mark.parametrize(("arguments", "text"), USAGE, ids=[" ".join(a) for a, _ in USAGE])
def test_invalid_options_are_reported(tmp_path: Path, arguments: list[str], text: str) -> None:
    plan = str(write_plan(tmp_path))
    done = run_to_end(*[plan if a == "PLAN" else a for a in arguments])
    assert done.returncode == 2
    assert text in done.stderr
    assert done.stdout == ""


def test_help_and_version() -> None:
    done = run_to_end("--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert "example: fsn-master" in done.stdout
    done = run_to_end("--version")
    assert done.returncode == 0
    for text in ("bus soem:", "bus igh:", "bus emulated:", "not a safety function"):
        assert text in " ".join(done.stdout.replace("It is\nno", "no").split())


def test_every_option_is_in_the_reference() -> None:
    page = Path(__file__).parents[2] / "docs" / "reference" / "cli.md"
    if not page.is_file():
        pytest.skip("needs the source tree")
    words = run_to_end("--help").stdout.split()
    options = {w for w in words if w.startswith("--")}
    assert len(options) > 15
    missing = [option for option in options if f"`{option}" not in page.read_text()]
    assert not missing


def test_a_plan_that_cannot_be_read_or_is_none(tmp_path: Path) -> None:
    done = run_to_end(tmp_path / "none", "--bus", "emulated")
    assert done.returncode == 2
    assert "No such file or directory; fsoe-net plan" in done.stderr
    done = run_to_end(tmp_path, "--bus", "emulated")
    assert done.returncode == 2
    assert "Is a directory" in done.stderr
    (tmp_path / "text").write_text("x" * 1000)
    done = run_to_end(tmp_path / "text", "--bus", "emulated")
    assert done.returncode == 1
    assert "FSN_E_PLAN_MAGIC" in done.stderr
    plan = write_plan(tmp_path)
    plan.write_bytes(plan.read_bytes()[:-1])
    done = run_to_end(plan, "--bus", "emulated")
    assert done.returncode == 1
    assert "FSN_E_PLAN_LENGTH" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.shows("R4")
def test_only_the_accepted_plan(tmp_path: Path) -> None:
    plan = write_plan(tmp_path)
    digest = hashlib.sha256(plan.read_bytes()).hexdigest()
    common = [plan, "--bus", "emulated", "--policy", "other", "--socket", tmp_path / "s"]
    done = run_to_end(*common, "--accepted", digest.upper(), "--duration", "10ms")
    assert done.returncode == 0
    assert f"SHA-256 {digest}" in done.stderr
    whole = fingerprint_of(decode_plan(plan.read_bytes())).whole
    done = run_to_end(*common, "--accepted", whole, "--duration", "10ms")
    assert done.returncode == 0
    assert whole in done.stderr
    assert "as in the plan" in done.stderr
    done = run_to_end(*common, "--accepted", digest[:-1] + ("0" if digest[-1] != "0" else "1"))
    assert done.returncode == 1
    assert "not the accepted plan" in done.stderr


@pytest.mark.shows("R4")
def test_the_hash_is_that_of_the_file() -> None:
    for name in ("estop", "el6910"):
        with running(name=name) as master, master.client() as client:
            data = (master.directory / f"{name}.fsnplan").read_bytes()
            assert client.good("status")["plan_sha256"] == hashlib.sha256(data).hexdigest()


def test_an_absent_bus_is_said_to_be_absent(tmp_path: Path) -> None:
    if "bus igh: not in this build" not in run_to_end("--version").stdout:
        pytest.skip("this build has IgH")
    done = run_to_end(write_plan(tmp_path), "--bus", "igh", "--interface", "0")
    assert done.returncode == 1
    assert "FSN_E_ABSENT: this build has no bus igh" in done.stderr


def test_a_socket_that_cannot_be(tmp_path: Path) -> None:
    plan = write_plan(tmp_path)
    common = [plan, "--bus", "emulated", "--policy", "other", "--socket"]
    done = run_to_end(*common, tmp_path / "none" / "s")
    assert done.returncode == 3
    assert "No such file or directory; --socket" in done.stderr
    done = run_to_end(*common, plan)
    assert done.returncode == 3
    assert "is not a socket" in done.stderr
    assert plan.exists()
    done = run_to_end(*common, "/" + "x" * 200)
    assert done.returncode == 3
    assert "1 to 107 bytes" in done.stderr


@pytest.mark.skipif(os.geteuid() != 0, reason="becomes another user, which takes root")
def test_without_permission_it_names_the_capabilities() -> None:
    with tempfile.TemporaryDirectory(prefix="fsn-") as text:
        directory = Path(text)
        directory.chmod(0o777)
        copy = directory / "fsn-master"
        shutil.copy(program(), copy)
        copy.chmod(0o755)
        plan = write_plan(directory)
        plan.chmod(0o644)
        command = [copy, plan, "--bus", "emulated", "--socket", directory / "s"]

        def run(*more: str) -> subprocess.CompletedProcess[str]:
            return subprocess.run(
                [*map(str, command), *more],
                capture_output=True,
                text=True,
                check=False,
                user=NOBODY,
                group=NOBODY,
                extra_groups=[],
            )

        for policy in ("fifo", "deadline"):
            done = run("--policy", policy)
            assert done.returncode == 3, done.stderr
            assert "setcap cap_net_raw,cap_sys_nice,cap_ipc_lock=ep" in done.stderr
        done = run("--duration", "10ms")  # nothing was asked for: it goes on with a warning
        assert done.returncode == 0, done.stderr
        assert "no real-time scheduling" in done.stderr


def test_the_default_socket(tmp_path: Path) -> None:
    plan = write_plan(tmp_path)
    run, user = tmp_path / "run", tmp_path / "user"
    run.mkdir()
    user.mkdir()
    base = {k: v for k, v in os.environ.items() if k != "RUNTIME_DIRECTORY"}
    common = [plan, "--bus", "emulated", "--policy", "other", "--duration", "1ms"]
    for env, directory in (
        (base | {"XDG_RUNTIME_DIR": str(user)}, user),
        (base | {"XDG_RUNTIME_DIR": str(user), "RUNTIME_DIRECTORY": f"{run}:/x"}, run),
    ):
        (directory / "fsn-master-em_0.sock").write_text("")  # in the way: the refusal names it
        done = run_to_end(*common, "--interface", "em/0", env=env)
        assert done.returncode == 3
        assert f"{directory}/fsn-master-em_0.sock exists" in done.stderr


@pytest.mark.shows("R24")
def test_names_do_nothing_to_a_terminal(tmp_path: Path) -> None:
    bad = "a\x1b]0;owned\x07\x9b2J\u202e\nb"
    for arguments in ([tmp_path / bad, "--bus", "emulated"], [tmp_path / "x", "--bus", bad]):
        done = run_to_end(*arguments)
        assert done.returncode == 2
        assert "a\\u001b]0;owned\\u0007\\u009b2J\\u202e\\u000ab" in done.stderr
        assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("option", ["--take-over", "--standby"])
def test_a_bus_in_memory_has_no_second_process(tmp_path: Path, option: str) -> None:
    done = run_to_end(write_plan(tmp_path), "--bus", "emulated", option)
    assert done.returncode == 1
    assert "a bus of emulated cannot be handed over" in done.stderr
