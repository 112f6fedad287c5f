"""What a user sees: outputs, exit codes, no traceback for anything."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import pytest
from cli.tool import fsn
from networks import PLAIN

from fsoe_net.cli.output import print_diagnostics
from fsoe_net.core.core import CorePlan
from fsoe_net.diag.diagnostic import Diagnostic, Span
from fsoe_net.errors import CoreMissing, EnvironmentFault, PlanFormatError
from fsoe_net.formats.shared.write_files import write_whole

ESTOP = str(PLAIN / "estop" / "network.yaml")


@pytest.fixture
def built() -> None:
    try:
        CorePlan.load(b"")
    except CoreMissing as exc:
        pytest.skip(str(exc))
    except PlanFormatError:
        pass


def test_clean_network_has_no_findings():
    done = fsn("check", ESTOP)
    assert (done.returncode, done.stderr) == (0, "")
    assert "estop: no findings, 2 SubDevices" in done.stdout


def test_mistake_is_printed_as_the_design_states(tmp_path: Path):
    text = Path(ESTOP).read_text("utf-8").replace("devices/", f"{PLAIN}/estop/devices/")
    text = text.replace(
        "in: {ec_module: ek1914, index: 0x6000, subindex: 1}\n"
        "        out: {ec_module: el1918, index: 0x7080, subindex: 1}",
        "out: {ec_module: ek1914, index: 0x6000, subindex: 1}\n"
        "        in: {ec_module: el1918, index: 0x7080, subindex: 1}",
    )
    (tmp_path / "estop.yaml").write_text(text, "utf-8")
    done = fsn("check", "estop.yaml", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stdout.startswith(
        "estop.yaml:16:40: error[FSN203]: transfer reads an output: el1918 0x7080:01 is in RxPDO "
        "0x1600 (SM2, MainDevice to SubDevice)\n"
        "   16 |         in: {ec_module: el1918, index: 0x7080, subindex: 1}\n"
        "      |                                        ^^^^^^\n"
        "  hint: in and out look exchanged; the opposite copy ek1914 0x6000:01 -> el1918 0x7080:01 "
        "would fit (6 bytes)\n"
    )
    today = fsn("check", "estop.yaml", "--runtime", "ros2-newest", cwd=tmp_path).stdout
    assert "  today: ros2-newest starts and copies; the connection never reaches Data" in today


def test_json_sarif_and_github_formats_have_the_findings(tmp_path: Path):
    (tmp_path / "a.yaml").write_text("nets:\n  - transfers: []\n", "utf-8")
    rows = json.loads(fsn("check", "a.yaml", "--format", "json", cwd=tmp_path).stdout)
    assert rows["errors"] == len([d for d in rows["diagnostics"] if d["severity"] == "error"])
    assert {"code", "message", "file", "line", "column", "hint"} <= set(rows["diagnostics"][0])
    sarif = json.loads(fsn("check", "a.yaml", "--format", "sarif", cwd=tmp_path).stdout)
    result = sarif["runs"][0]["results"][0]
    assert "properties" not in result
    today = ("check", "a.yaml", "--format", "sarif", "--runtime", "ros2-2025")
    result = json.loads(fsn(*today, cwd=tmp_path).stdout)["runs"][0]["results"][0]
    assert result["properties"]["runtime"] == "ros2-2025"
    assert result["properties"]["today"]
    assert result["locations"][0]["physicalLocation"]["region"]["startLine"] >= 1
    github = fsn("check", "a.yaml", "--format", "github", cwd=tmp_path).stdout
    assert github.startswith("::error file=a.yaml,line=2,col=5,title=FSN")


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ((), 2, "Usage"),
        (("chek", "x"), 2, "Did you mean 'check'"),
        ((ESTOP,), 2, "fsoe-net check"),
        (("check",), 2, "name a network"),
        (("check", "nowhere.yaml"), 1, "no such file"),
        (("explain", "FSN999"), 2, "no code"),
        (("check", ESTOP, "--runtime", "ros2-2026"), 2, "'ros2-2026-06', 'ros2-2026-08'"),
        (("plan", "--show", ESTOP), 1, "not a .fsnplan file"),
        (("plan", "--show", "nowhere"), 1, "no such file"),
        (("plan", ESTOP, "-o", "/nonexistent/x.fsnplan"), 3, "missing folder /nonexistent"),
        (("run", "nowhere.yaml"), 1, "no such file"),
        (("run", ESTOP, "--scenario", "nowhere.yaml"), 1, "no such file"),
        (("run", ESTOP, "--duration", "0"), 2, "duration"),
        (("check", ESTOP, "--package", "x"), 2, "NAME=DIR"),
        (("report", ESTOP), 2, "-o"),
    ],
)
def test_usage_error_is_reported_with_its_exit_code(
    arguments: tuple[str, ...], code: int, words: str
):
    done = fsn(*arguments)
    assert done.returncode == code, done.stderr
    assert words in done.stdout + done.stderr


def test_explain_shows_one_code_or_lists_all():
    assert "FSN203" in fsn("explain", "203").stdout
    assert "FSN601" in fsn("explain").stdout
    optional = fsn("explain", "FSN230").stdout
    assert "- `ros2-2025`, `ros2-2026-06`, `ros2-2026-08`: ignores required: false" in optional
    assert "- `ros2-newest`: leaves the module out" in optional
    assert "Other programs" not in fsn("explain", "FSN501").stdout
    shown = fsn("--version").stdout
    assert shown.startswith("fsoe-net, version ")
    assert "no safety function, not certified" in shown


def test_plan_round_trip(tmp_path: Path):
    plan = tmp_path / "estop.fsnplan"
    assert fsn("plan", ESTOP, "-o", str(plan)).returncode == 0
    shown = fsn("plan", "--show", str(plan)).stdout
    assert "el1918 SM2 byte 0 (0x7080:01)" in shown
    document = json.loads(fsn("plan", "--show", str(plan), "--format", "json").stdout)
    assert document["copies"][0]["source"]["subdevice"] == "el1918"
    assert document["igh_image"]["size_bytes"] == 33
    image = fsn("plan", "--show", str(plan), "--image", "igh").stdout
    assert "WorkingCounter 6/6" in image


def test_a_network_with_an_error_gets_no_plan_and_keeps_the_old_one(tmp_path: Path):
    plan = tmp_path / "x.fsnplan"
    plan.write_text("precious", "utf-8")
    text = Path(ESTOP).read_text("utf-8").replace("devices/", f"{PLAIN}/estop/devices/")
    (tmp_path / "bad.yaml").write_text(text.replace("size: 6", "size: 5", 1), "utf-8")
    done = fsn("plan", str(tmp_path / "bad.yaml"), "-o", str(plan), "--overwrite")
    assert done.returncode == 1
    assert "FSN208" in done.stderr
    assert plan.read_text("utf-8") == "precious"


@pytest.mark.usefixtures("built")
def test_run_prints_one_json_document():
    scenario = str(PLAIN / "estop" / "scenario.yaml")
    done = fsn("run", ESTOP, "--scenario", scenario, "--virtual-time", "--format", "json")
    assert done.returncode == 0
    document = json.loads(done.stdout)
    assert document["result"] == "pass"
    (connection,) = document["connections"]
    assert connection["name"] == "el1918-ek1914"
    assert connection["state"] == "data_failsafe"
    assert document["statistics"]["cycles"] == 3000


@pytest.mark.usefixtures("built")
def test_report_is_one_file_and_repeatable(tmp_path: Path):
    pages = []
    for name in ("a.html", "b.html"):
        scenario = str(PLAIN / "estop" / "scenario.yaml")
        done = fsn("report", ESTOP, "--scenario", scenario, "-o", str(tmp_path / name))
        assert done.returncode == 0, done.stderr
        pages.append((tmp_path / name).read_text("utf-8"))
    assert pages[0] == pages[1]
    for words in ("FSoE network estop", "not certified", "el1918-ek1914", "0x7080:01", "passed"):
        assert words in pages[0]
    for outside in ("<script", "http://", "src=", "@import"):
        assert outside not in pages[0]


def test_thousands_of_findings_of_one_kind_are_counted_not_printed(capsys):
    found = [
        Diagnostic(code="FSN202", span=Span("n.yaml", n, 1), message=f"m{n}") for n in range(1, 251)
    ]
    print_diagnostics([*found, Diagnostic(code="FSN304", span=Span("n.yaml", 9), message="other")])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 102
    assert lines[-1].startswith("FSN202: 150 more")
    assert "other" in lines[-2]


def test_a_folder_that_takes_nothing_is_said_of_the_file_that_was_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def closed(path: Path, *_: object, **__: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system", str(path))

    monkeypatch.setattr(Path, "write_bytes", closed)
    monkeypatch.setattr(Path, "unlink", closed)
    with pytest.raises(EnvironmentFault) as told:
        write_whole(str(tmp_path / "a.html"), b"x", overwrite=True)
    assert str(told.value) == f"cannot write {tmp_path}/a.html: Read-only file system"


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("check", "test-record.yaml"), "FSN117", "a test record, not a network"),
        (("check", "scenario.yaml"), "FSN117", "a scenario, not a network"),
        (("check", "device.yaml"), "FSN117", "a device file, not a network"),
        (("check", "answers.yaml"), "FSN117", "`fsoe-net init --answers answers.yaml` takes it"),
        (("check", "x.fsnplan"), "FSN117", "this is a compiled plan, not a network"),
        (("check", str(PLAIN)), "FSN101", "it is a directory"),
        (("run", ESTOP, "--scenario", ESTOP), "FSN140", "a network, not a scenario"),
        (
            ("acceptance", "verify", ESTOP, "--accepted", "test-record.yaml"),
            "FSN117",
            "a test record, not",
        ),
        (
            ("report", ESTOP, "--test-record", ESTOP, "-o", "r.md"),
            "FSN140",
            "a network, not a test record",
        ),
        (
            ("report", ESTOP, "--accepted", "test-record.yaml", "-o", "r.md"),
            "FSN140",
            "a test record, not an acceptance record",
        ),
    ],
)
def test_a_file_of_another_kind_is_named_once(
    arguments: tuple[str, ...], code: str, words: str, tmp_path: Path
):
    for name, text in (
        ("test-record.yaml", "version: 1\nnetwork: x\nplan_sha256: ''\nsteps: []\n"),
        ("scenario.yaml", "version: 1\nduration_s: 2\n"),
        ("device.yaml", "name: X\nabout: y\nidentities: []\nmappings: []\n"),
        ("answers.yaml", "subdevices:\n  - {type: EL6910}\n"),
    ):
        (tmp_path / name).write_text(text, "utf-8")
    (tmp_path / "x.fsnplan").write_bytes(b"FSNPLAN\0\1\0\0\0\xb2")
    done = fsn(*arguments, cwd=tmp_path)
    said = done.stdout + done.stderr
    assert done.returncode in (1, 2)
    assert words in said
    assert said.count("FSN") - said.count("explain FSN") == 1
    assert f"error[{code}]" in said


def test_a_cycle_written_in_milliseconds_is_reported(tmp_path: Path):
    text = Path(ESTOP).read_text("utf-8").replace("devices/", f"{PLAIN}/estop/devices/")
    assert "cycle_us: 1000" in text
    (tmp_path / "n.yaml").write_text(text.replace("cycle_us: 1000", "cycle_us: 1"), "utf-8")
    done = fsn("check", "n.yaml", cwd=tmp_path)
    assert done.returncode == 1
    assert "error[FSN130]: cycle_us 1 is not a possible bus cycle" in done.stdout
    assert "1 ms is cycle_us: 1000" in done.stdout


def test_a_network_under_another_key_is_one_finding(tmp_path: Path):
    text = Path(ESTOP).read_text("utf-8").replace("subdevices:", "slaves:")
    (tmp_path / "n.yaml").write_text(text, "utf-8")
    done = fsn("check", "n.yaml", cwd=tmp_path)
    assert done.stdout.count("error[") == 1, done.stdout
    assert "error[FSN109]: unknown key 'slaves' at the top level\n" in done.stdout
    assert "\n  hint: write 'subdevices'\n" in done.stdout
