"""`fsoe-net acceptance record`, what uses its record, and its usage errors."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
import yaml
from cli.tool import fsn

BASE = Path(__file__).parents[1] / "diagnostics" / "base"
STATED = (
    *("--author-competence", "maker of the cell", "--verifier-competence", "safety engineer"),
    *("--equipment", "oscilloscope 4711", "--environment", "hall 3"),
)
PEOPLE = ("--author", "A. Meier", "--verifier", "B. Kaya", *STATED, "--date", "2021-11-21")
NOT_SEEN = ("--justify", "bus evidence=no access to the bus by B. Kaya")
SOLDERED = ("--justify", "loss *=soldered in by B. Kaya", *NOT_SEEN)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copy(BASE / "timed.yaml", tmp_path)
    shutil.copytree(BASE / "devices", tmp_path / "devices")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _prepared(folder: Path, number: int = 1) -> list[str]:
    """Write test record and report, do the steps at the machine, and return the options."""
    test_record, report = f"test record{number}.yaml", f"report{number}"
    assert fsn("test-record", "timed.yaml", "-o", test_record).returncode == 0
    document = yaml.safe_load((folder / test_record).read_text("utf-8"))
    for step in document["steps"]:
        if step["kind"] in ("start_up", "trigger") or step["id"] == "loss io2":
            done = {"result": "as expected", "measured_ms": 60, "remark": ""}
            step["machine"] = {**done, "by": "A. Meier", "date": "2021-11-20"}
    document["made"] = "2021-11-20"
    for device in document["devices"]:
        device.update(dict.fromkeys(device.keys() - {"subdevice"}, "not applicable: emulated"))
    (folder / test_record).write_text(yaml.safe_dump(document), "utf-8")
    for form in ("html", "json"):
        done = fsn("report", "timed.yaml", "--test-record", test_record, "-o", f"{report}.{form}")
        assert done.returncode == 0, done.stderr
    pages = ["--report", f"{report}.html", "--report", f"{report}.json"]
    return ["timed.yaml", "--test-record", test_record, *pages]


@pytest.mark.shows("R27")
def test_from_the_test_record_to_a_change_and_its_record(folder: Path) -> None:
    given = _prepared(folder)
    done = fsn(
        "acceptance",
        "record",
        *given,
        *PEOPLE,
        *SOLDERED,
        "--date",
        "2021-11-21",
        "-o",
        "first.yaml",
    )
    assert done.returncode == 0, done.stderr
    assert "author A. Meier, verifier B. Kaya, 2021-11-21" in done.stdout
    assert "let pass: 0 warnings, 3 others, each by name and reason" in done.stdout
    assert fsn("acceptance", "verify", "timed.yaml", "--accepted", "first.yaml").returncode == 0
    assert fsn("diff", "first.yaml", "timed.yaml").returncode == 0

    done = fsn("report", "timed.yaml", "--accepted", "first.yaml", "-o", "same.md")
    assert done.returncode == 0
    page = (folder / "same.md").read_text("utf-8")
    assert "first.yaml is a record of this configuration" in page
    assert "| Verifier, who is not the author | B. Kaya | 2021-11-21 | ____ |" in page
    assert "soldered in" in page
    assert "not signed" not in page
    assert "changed since the record" not in page
    text = (folder / "timed.yaml").read_text("utf-8")
    (folder / "timed.yaml").write_text(text + "# looked at again\n", "utf-8")
    done = fsn("report", "timed.yaml", "--accepted", "first.yaml", "-o", "same.md", "--overwrite")
    page = (folder / "same.md").read_text("utf-8")
    assert "a record of this configuration" in page
    assert "within the same fingerprint: timed.yaml; look what was changed" in page
    (folder / "timed.yaml").write_text(text, "utf-8")

    text = (folder / "timed.yaml").read_text("utf-8")
    text = text.replace("connection_id: 11", "connection_id: 12").replace(
        "time_ms: 20", "time_ms: 21"
    )
    (folder / "timed.yaml").write_text(text, "utf-8")
    done = fsn("acceptance", "verify", "timed.yaml", "--accepted", "first.yaml")
    assert done.returncode == 1
    assert "connection_id 11 -> 12" in done.stdout
    assert "actuator K1: time_ms 20 -> 21" in done.stdout
    done = fsn("report", "timed.yaml", "--accepted", "first.yaml", "-o", "now.md")
    assert done.returncode == 0
    assert re.search(
        r"^now\.md: \d verdicts? against it · machine: .* · signed for another configuration$",
        done.stdout,
        re.MULTILINE,
    )
    assert "against it: Sign-off: first.yaml is the record of ANOTHER" in done.stdout
    page = (folder / "now.md").read_text("utf-8")
    assert "ANOTHER configuration" in page
    for step in ("start-up logic-io2", "trigger estop", "loss io2"):
        assert f"- `{step}`" in page
    assert "- `loss io`" not in page

    given = _prepared(folder, 2)
    second = [
        "acceptance",
        "record",
        *given,
        *PEOPLE,
        *SOLDERED,
        "--replaces",
        "first.yaml",
        "-o",
        "second.yaml",
    ]
    done = fsn(*second)
    assert done.returncode == 1
    assert "the change is not stated" in done.stderr
    assert not (folder / "second.yaml").exists()
    done = fsn(*second, "--intervention", "io2 has a new ID after its exchange by C. Okoro")
    assert done.returncode == 0, done.stderr
    assert "replaces first.yaml" in done.stdout
    record = yaml.safe_load((folder / "second.yaml").read_text("utf-8"))
    assert record["replaces"]["file"] == "first.yaml"
    assert record["interventions"][0]["by"] == "C. Okoro"
    assert fsn("report", "timed.yaml", "--accepted", "second.yaml", "-o", "new.md").returncode == 0
    assert "io2 has a new ID after its exchange" in (folder / "new.md").read_text("utf-8")


@pytest.mark.shows("R14")
@pytest.mark.uncounted
def test_every_reason_is_reported_at_once_and_nothing_is_written(folder: Path) -> None:
    assert (
        fsn("test-record", "timed.yaml", "--virtual", "--cycles", "5", "-o", "p.yaml").returncode
        == 0
    )
    assert fsn("report", "timed.yaml", "-o", "r.json").returncode == 0
    people = ("--author", "A. Meier", "--verifier", "A. MEIER")
    given = ("--test-record", "p.yaml", "--report", "r.json")
    done = fsn("acceptance", "record", "timed.yaml", *given, *people, "-o", "a.yaml")
    assert done.returncode == 1
    assert "author and verifier are one person" in done.stderr
    assert done.stderr.count("open at the machine") == 6
    # No page, no test record in it, no evidence, seven things to read at three devices,
    # nothing of competence, equipment and environment.
    assert "no record written: 21 reasons" in done.stderr
    assert not (folder / "a.yaml").exists()


def test_a_justification_is_shown_wherever_the_warning_is(folder: Path) -> None:
    text = (folder / "timed.yaml").read_text("utf-8")
    (folder / "timed.yaml").write_text(text.replace("time_ms: 2, ", "", 1), "utf-8")
    given = _prepared(folder)
    done = fsn("acceptance", "record", *given, *PEOPLE, *SOLDERED, "-o", "a.yaml")
    assert done.returncode == 1
    rows = [r for r in done.stderr.splitlines() if "--justify" in r]
    codes = [r.split('"')[1].split("=")[0] for r in rows]
    assert codes
    (folder / "reasons.txt").write_text(
        "# let pass\n" + "".join(f"{c}=value of the board by C. Okoro\n" for c in codes),
        "utf-8-sig",  # as editors of Windows write it
    )
    done = fsn(
        "acceptance",
        "record",
        *given,
        *PEOPLE,
        *SOLDERED,
        "--justify",
        "@reasons.txt",
        "-o",
        "a.yaml",
    )
    assert done.returncode == 0, done.stderr
    assert fsn("report", "timed.yaml", "--accepted", "a.yaml", "-o", "r.md").returncode == 0
    page = (folder / "r.md").read_text("utf-8")
    assert "each warning justified by name" in page
    assert page.count("value of the board") >= 2 * len(codes)
    assert fsn("report", "timed.yaml", "--accepted", "a.yaml", "-o", "r.json").returncode == 0
    points = json.loads((folder / "r.json").read_text("utf-8"))["points"]
    assert {p["kind"] for p in points if p["block"] == "Findings"} == {"assumption"}


def test_wrong_words_and_files_are_refused(folder: Path) -> None:
    given = _prepared(folder)
    (folder / "there.yaml").write_text("mine", "utf-8")
    (folder / "link.yaml").symlink_to("away.yaml")
    for more, wanted in (
        (["-o", "a.yaml", "--date", "21.11.2026"], "YYYY-MM-DD"),
        (
            ["-o", "a.yaml", "--date", "9999-12-31"],
            "is in the future; write today or an earlier day",
        ),
        (["-o", "a.yaml", "--justify", "loss *=no name"], "by NAME"),
        (["-o", "a.yaml", "--intervention", "by nobody"], "by NAME"),
        (["-o", "a.yaml", "--justify", "loss *=- by ."], "by NAME"),
    ):
        done = fsn("acceptance", "record", *given, *PEOPLE, *more)
        assert done.returncode == 2
        assert wanted in done.stderr
        assert not (folder / "a.yaml").exists()
    assert (folder / "there.yaml").read_text("utf-8") == "mine"
    for more, wanted in (
        (["--replaces", "timed.yaml"], "timed.yaml is not an acceptance record"),
        (["--justify", "@absent.txt"], "absent.txt"),
        (["--replaces", "absent.yaml"], "absent.yaml"),
        (["-o", "there.yaml"], "there.yaml exists; name another file, or replace it with"),
        (["-o", "link.yaml"], "link.yaml exists"),
    ):
        done = fsn("acceptance", "record", *given, *PEOPLE, "-o", "a.yaml", *more)
        assert done.returncode == 1
        assert wanted in done.stderr
        assert "Traceback" not in done.stderr
    done = fsn("report", "timed.yaml", "--accepted", "a", "--against", "b", "-o", "r.md")
    assert done.returncode == 2


@pytest.mark.shows("R14")
def test_a_record_that_was_changed_accepts_nothing(folder: Path) -> None:
    assert (
        fsn(
            "acceptance", "record", *_prepared(folder), *PEOPLE, *SOLDERED, "-o", "a.yaml"
        ).returncode
        == 0
    )
    text = (folder / "a.yaml").read_text("utf-8")
    (folder / "a.yaml").write_text(text.replace("time_ms: 20", "time_ms: 10"), "utf-8")
    for command in (
        ("acceptance", "verify", "timed.yaml", "--accepted", "a.yaml"),
        ("report", "timed.yaml", "--accepted", "a.yaml", "-o", "r.md"),
        ("diff", "a.yaml", "timed.yaml"),
    ):
        done = fsn(*command)
        assert done.returncode != 0
        assert "FSN162" in done.stderr
        assert "a.yaml:" in done.stderr


def test_another_fingerprint_without_a_difference_by_meaning_is_reported(folder: Path) -> None:
    done = fsn("acceptance", "record", *_prepared(folder), *PEOPLE, *SOLDERED, "-o", "a.yaml")
    assert done.returncode == 0, done.stderr
    board = folder / "devices" / "el6910.yaml"
    text = board.read_text("utf-8")
    board.write_text(
        text.replace("sub_index: 1, type: uint8}\ntpdo", "sub_index: 1, type: int8}\ntpdo")
    )
    assert fsn("report", "timed.yaml", "--accepted", "a.yaml", "-o", "now.md").returncode == 0
    page = (folder / "now.md").read_text("utf-8")
    assert "no difference by meaning, but another fingerprint" in page
    assert "- `start-up logic-io`" in page
    assert "another fingerprint than a.yaml: to be tried again" in page


def test_values_that_no_file_can_hold_are_not_written(folder: Path) -> None:
    given = _prepared(folder)
    odd = b"loss *=odd \xff by B. Kaya".decode("utf-8", "surrogateescape")
    done = fsn("acceptance", "record", *given, *PEOPLE, *NOT_SEEN, "--justify", odd, "-o", "a.yaml")
    assert done.returncode == 1
    assert done.stderr == (
        "error: no record written: a name, reason or file name is not UTF-8; write it otherwise\n"
    )
    assert not (folder / "a.yaml").exists()


def test_an_equals_sign_in_a_name_is_part_of_it(folder: Path) -> None:
    text = (folder / "timed.yaml").read_text("utf-8")
    (folder / "timed.yaml").write_text(
        text.replace("sub: io,", "sub: a=b,")
        .replace("name: io,", "name: a=b,")
        .replace("ec_module: io,", "ec_module: a=b,"),
        "utf-8",
    )
    given = _prepared(folder)
    reasons = ("--justify", "loss a=b=x = y by B. Kaya", "--justify", "loss logic=z by B. Kaya")
    done = fsn("acceptance", "record", *given, *PEOPLE, *NOT_SEEN, *reasons, "-o", "a.yaml")
    assert done.returncode == 0, done.stderr
    record = yaml.safe_load((folder / "a.yaml").read_text("utf-8"))
    assert record["steps_left_out"][1] == {"step": "loss a=b", "reason": "x = y", "by": "B. Kaya"}
