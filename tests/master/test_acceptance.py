"""`fsn-master --acceptance`: the bus opens for a plan that two persons signed, and for no other."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from cli.signed_folder import RECORD, make_signed
from cli.tool import fsn
from master.rig import PATIENCE_S, killed_at_the_end, program, when_it_listens
from tied import tied

pytestmark = pytest.mark.skipif(
    shutil.which("ssh-keygen") is None, reason="signatures are made by ssh-keygen of OpenSSH"
)
SIGNED = ("--acceptance", RECORD, "--signers", "signers")


@pytest.fixture(scope="module")
def master(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a signed folder with its plan, another one, and a program that stands by itself."""
    folder = make_signed(tmp_path_factory.mktemp("signed"))
    for name in ("timed", "other"):
        made = fsn("plan", f"{name}.yaml", "-o", f"{name}.fsnplan", cwd=folder)
        assert made.returncode == 0, made.stderr
        text = (folder / "timed.yaml").read_text("utf-8")
        (folder / "other.yaml").write_text(text.replace("connection_id: 11", "connection_id: 12"))
    (folder / "bin").mkdir()
    shutil.copy(program(), folder / "bin" / "fsn-master")
    return folder


@pytest.fixture
def folder(master: Path, tmp_path: Path) -> Path:
    shutil.copytree(master, tmp_path / "f")
    return tmp_path / "f"


def run(
    folder: Path, *more: str, plan: str = "timed.fsnplan", path: str | None = None
) -> subprocess.CompletedProcess[str]:
    """Run the program for 10 ms on its emulated bus, with `fsoe-net` on PATH unless told."""
    tools = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    given = ["--bus", "emulated", "--policy", "other", "--socket", "s", "--duration", "10ms"]
    return subprocess.run(
        [folder / "bin" / "fsn-master", plan, *given, *more],
        cwd=folder,
        env={**os.environ, "PATH": tools if path is None else path},
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )


def tool(folder: Path, text: str) -> None:
    """Put a program of this name beside `fsn-master`."""
    path = folder / "bin" / "fsoe-net"
    path.write_text(text)
    path.chmod(0o755)


@pytest.mark.shows("R4")
def test_the_signed_plan_runs(folder: Path) -> None:
    done = run(folder, *SIGNED)
    assert done.returncode == 0, done.stderr
    assert "author A. Meier <a.meier@example.org>, 2021-11-21: signed, ED25519" in done.stderr
    assert ": the same" in done.stderr
    (folder / "revoked").write_text((folder / "bert.pub").read_text("utf-8"))
    done = run(folder, *SIGNED, "--revoked", "revoked")
    assert done.returncode == 1
    assert "verifier.sig is not a signature" in done.stderr


def test_the_status_names_who_signed(folder: Path) -> None:
    tools = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    with tempfile.TemporaryDirectory(prefix="fsn-") as short:  # a path of a socket has 107 bytes
        path = Path(short) / "s"
        given = ["--bus", "emulated", "--policy", "other", "--socket", str(path), *SIGNED]
        process = subprocess.Popen(
            tied(folder / "bin" / "fsn-master", "timed.fsnplan", *given),
            cwd=folder,
            env={**os.environ, "PATH": tools},
            stderr=subprocess.DEVNULL,
        )
        with killed_at_the_end(process), when_it_listens(path, process) as client:
            found = client.good("status")["acceptance"]
            assert found["record"] == RECORD
            assert "A. Meier <a.meier@example.org>, 2021-11-21: signed, ED25519" in found["said"]
            client.good("shutdown")
            assert process.wait(PATIENCE_S) == 0


def test_signers_are_in_the_intervention_log(folder: Path) -> None:
    (folder / "log").mkdir()
    assert run(folder, *SIGNED, "--intervention-log", "log").returncode == 0
    assert run(folder, *SIGNED, "--intervention-log", "log", plan="other.fsnplan").returncode == 1
    lines = (folder / "log" / "interventions-000001.jsonl").read_text("utf-8").splitlines()
    good, bad = (row for row in map(json.loads, lines) if row["event"] == "acceptance")
    assert (good["record"], good["signers"], good["revoked"]) == (RECORD, "signers", None)
    assert (good["as_signed"], bad["as_signed"]) == (True, False)
    assert "A. Meier <a.meier@example.org>, 2021-11-21: signed, ED25519" in good["text"]


@pytest.mark.shows("R4")
def test_another_plan_or_other_files_do_not(folder: Path) -> None:
    done = run(folder, *SIGNED, plan="other.fsnplan")
    assert done.returncode == 1
    assert "standard input: DIFFERS in connections" in done.stderr
    done = run(folder, "--acceptance", "-x", "--signers", "signers")
    assert done.returncode == 1
    assert "-x cannot be read" in done.stderr
    with (folder / "report.html").open("ab") as file:
        file.write(b" ")
    done = run(folder, *SIGNED, "--log", "json")
    assert done.returncode == 1
    rows = [json.loads(line) for line in done.stderr.splitlines()]
    assert [row["level"] for row in rows] == [*(["info"] * (len(rows) - 1)), "error"]
    assert "NOT as signed: report.html: not the file" in done.stderr
    assert f"plan timed.fsnplan is not as signed in {RECORD}" in rows[-1]["text"]
    advice = rows[-1]["text"].split("`")[1].split()
    assert advice == ["fsoe-net", "acceptance", "verify", "timed.fsnplan", *SIGNED]
    again = fsn(*advice[1:], cwd=folder)
    assert again.returncode == 1
    assert "NOT as signed: report.html: not the file" in again.stdout
    assert not (folder / "s").exists()


@pytest.mark.shows("R4")
def test_it_is_refused_where_nothing_can_check_it(folder: Path) -> None:
    (folder / "fsoe-net").symlink_to("/bin/true")  # PATH holds folders of its user only
    for path in ("", ".", ":", "bin", "/none"):
        done = run(folder, *SIGNED, path=path)
        assert done.returncode == 3
        assert "fsoe-net is neither next to fsn-master nor on PATH" in done.stderr
        assert "--accepted HASH" in done.stderr
    (folder / "bin" / "fsoe-net").symlink_to(Path(sys.executable).parent / "fsoe-net")
    done = run(folder, *SIGNED, path="/none")
    assert done.returncode == 3
    assert "ssh-keygen is not installed" in done.stderr


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        ("#!/bin/sh\nexit 0\n", 0, "as in the plan"),
        ("#!/bin/sh\nexit 2\n", 1, "ended with code 2"),
        ("#!/bin/sh\nkill -9 $$\n", 3, "ended with code 127"),
        ("no program", 3, "ended with code 127"),
        ("#!/bin/sh\nhead -c 3000000 /dev/zero | tr '\\0' x\nexit 1\n", 1, "ended with code 1"),
        ("#!/bin/sh\nprintf 'a\\033[31m\\n'\nexit 1\n", 1, "a\\u001b[31m"),
        ('#!/bin/sh\nwc -c\necho "$@"\nexit 1\n', 1, f"verify - {' '.join(SIGNED)}"),
    ],
)
def test_however_the_program_ends(folder: Path, text: str, code: int, words: str) -> None:
    tool(folder, text)
    done = run(folder, *SIGNED)
    assert done.returncode == code, done.stderr
    assert words in done.stderr


def test_it_gets_the_bytes_that_were_loaded(folder: Path) -> None:
    tool(folder, "#!/bin/sh\nmv other.fsnplan timed.fsnplan\ncat > seen\nexit 0\n")
    wanted = (folder / "timed.fsnplan").read_bytes()
    assert run(folder, *SIGNED).returncode == 0
    assert (folder / "seen").read_bytes() == wanted
