"""A file that cannot be used: one exit code in every command, and its name in the message."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from cli.tool import commands, fsn
from networks import EXAMPLES

from fsoe_net.cli.main import main
from fsoe_net.cli.options import FILE, NETWORK_FILE

ESTOP = str(EXAMPLES / "estop" / "network.yaml")
SIGNED = "--author A --verifier B -o made.yaml"
REPORTS = "--report {reports}/r.json --report {reports}/r.html"

# Arguments that read a file, by command and parameter; WRONG is that file.
READERS = {
    ("check", "files"): "WRONG",
    ("check", "scan_file"): f"{ESTOP} --scan WRONG",
    ("init", "files"): "WRONG -o made --no-input",
    ("init", "answers_file"): f"{ESTOP} -o made --answers WRONG",
    ("convert", "files"): "WRONG -o made.yaml",
    ("graph", "files"): "WRONG -o made.svg",
    ("plan", "files"): "WRONG -o made.fsnplan",
    ("diff", "a"): f"WRONG {ESTOP}",
    ("diff", "b"): f"{ESTOP} WRONG",
    ("acceptance verify", "files"): f"WRONG --accepted {ESTOP}",
    ("acceptance verify", "accepted"): f"{ESTOP} --accepted WRONG",
    ("acceptance verify", "acceptance"): f"{ESTOP} --acceptance WRONG --signers {{reports}}/r.json",
    ("init", "own"): "--list --device-file WRONG",
    ("run", "files"): "WRONG --virtual-time",
    ("run", "plan_file"): f"{ESTOP} --virtual-time --plan WRONG",
    ("run", "scenario_file"): f"{ESTOP} --virtual-time --scenario WRONG",
    ("log incident", "file"): "WRONG",
    ("acceptance sign", "file"): "WRONG --key k --as author",
    ("timing", "files"): "WRONG",
    ("timing", "measured"): f"{ESTOP} --measured WRONG",
    ("test-record", "files"): "WRONG -o made.yaml",
    ("test-record", "given"): f"{ESTOP} -o made.yaml --test-record WRONG",
    ("report", "files"): "WRONG -o made.md",
    ("report", "plan_file"): f"{ESTOP} -o made.md --plan WRONG",
    ("report", "evidence_files"): f"{ESTOP} -o made.md --evidence WRONG",
    ("report", "scenario_file"): f"{ESTOP} -o made.md --scenario WRONG",
    ("report", "against"): f"{ESTOP} -o made.md --against WRONG",
    ("report", "accepted"): f"{ESTOP} -o made.md --accepted WRONG",
    ("report", "test_record"): f"{ESTOP} -o made.md --test-record WRONG",
    ("report", "self_test"): f"{ESTOP} -o made.md --self-test-result WRONG",
    ("acceptance record", "files"): f"WRONG {SIGNED} {REPORTS} --test-record p",
    ("acceptance record", "reports"): f"{ESTOP} {SIGNED} --report WRONG --test-record p",
    ("acceptance record", "test_record"): f"{ESTOP} {SIGNED} {REPORTS} --test-record WRONG",
    (
        "acceptance record",
        "replaces",
    ): f"{ESTOP} {SIGNED} {REPORTS} --test-record p --replaces WRONG",
    ("emulate", "files"): "WRONG --interface none0",
    ("emulate", "scenario_file"): f"{ESTOP} --interface none0 --scenario WRONG",
    ("campaign", "files"): "WRONG",
    ("decode", "inputs"): "WRONG",
    ("decode", "network"): "2a0400a6340000 --network WRONG",
    ("decode", "lua"): "--lua WRONG -o made.lua",
}
# Parameters of the same type that are no document: what is written, and control sockets.
NOT_READ = {
    "output",
    "parquet",
    "socket",
    "sockets",
    "capture",
    "stats",
    "plot",
    "snapshot",
    "record",
    "undo",
}
# A script is read when fsn-master answers; tests of the console and of signatures have these.
ELSEWHERE = {
    ("log show", "files"),
    ("log verify", "files"),
    ("log export", "files"),
    ("log incident-table", "files"),
    ("bench", "compare"),
    ("campaign", "resume"),
    ("console", "script"),
    ("acceptance sign", "key"),
    ("acceptance verify", "signers"),
    ("acceptance verify", "revoked"),
    ("report", "signers"),
    ("report", "revoked"),
    ("acceptance record", "attach"),
    ("studio", "path"),  # tests of studio; it opens what can be edited, whatever is wrong in it
    ("studio", "tls_cert"),
    ("studio", "tls_key"),
    ("studio", "password_file"),
}


@pytest.fixture(scope="session")
def reports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reports")
    for name in ("r.json", "r.html"):
        assert fsn("report", ESTOP, "-o", str(folder / name)).returncode == 0
    return folder


def test_every_parameter_that_is_a_file_is_tried_here():
    found = {
        (name, parameter.name)
        for name, command in commands()
        for parameter in command.params
        if parameter.type in (FILE, NETWORK_FILE) and parameter.name not in NOT_READ
    }
    assert found == set(READERS) | ELSEWHERE


@pytest.mark.parametrize("wrong", ["missing", "folder", "loop", "empty", "garbage"])
@pytest.mark.parametrize(("command", "parameter"), READERS)
def test_a_file_that_cannot_be_used_is_exit_code_1(
    command: str,
    parameter: str,
    wrong: str,
    tmp_path: Path,
    reports: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    path = tmp_path / wrong
    if wrong == "folder":
        path.mkdir()
    elif wrong == "loop":
        path.symlink_to(path)  # unreadable for everybody, root too
    elif wrong == "empty":
        path.touch()
    elif wrong == "garbage":
        path.write_bytes(bytes(range(255, 0, -1)) * 3)
    words = READERS[command, parameter].format(reports=reports).replace("WRONG", wrong).split()
    before = sorted(p.name for p in tmp_path.iterdir())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["fsoe-net", *command.split(), *words])
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO()))
    with pytest.raises(SystemExit) as ended:
        main()
    said = "".join(capsys.readouterr())
    assert ended.value.code == 1, said
    assert wrong in said
    assert sorted(p.name for p in tmp_path.iterdir()) == before
