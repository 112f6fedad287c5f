"""Every code: the clean files do not raise it, one seeded mistake raises it at the right place."""

from __future__ import annotations

import shutil
from importlib import import_module
from pathlib import Path

import pytest
import yaml

from fsoe_net.diag.catalogue import CATALOGUE
from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.formats.esi.read import EsiChoice
from fsoe_net.formats.own.answers import load_answers
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.own.scan import load_scan
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.answers import Answers
from fsoe_net.project.check import check_files
from fsoe_net.proposal.draft import Inputs, make_draft, question_findings
from fsoe_net.proposal.gather import gather
from fsoe_net.rules.runtime import Runtime

HERE = Path(__file__).parent

CASES = yaml.safe_load((HERE / "cases.yaml").read_text("utf-8"))
PAD = "      - {index: 0x0000, sub_index: 0, type: bit240}\n"


def _seed(folder: Path, case: dict) -> None:
    for file, find, put in case.get("edit", ()):
        path = folder / file
        text = path.read_text("utf-8")
        assert find in text, f"{find!r} is not in {file}"
        if put.startswith("REPEAT"):
            put = find + PAD * int(put.removeprefix("REPEAT"))
        path.write_text(text.replace(find, put, 1), "utf-8")
    for file, text in case.get("write", ()):
        (folder / file).write_text(text, "utf-8")
    for file, find, put in case.get("patch", ()):
        path = folder / file
        data = path.read_bytes()
        assert bytes.fromhex(find) in data, f"{find} is not in {file}"
        path.write_bytes(data.replace(bytes.fromhex(find), bytes.fromhex(put)))
    for file, size in case.get("cut", ()):
        path = folder / file
        path.write_bytes(path.read_bytes()[:size])


def findings(case: dict) -> list[Diagnostic]:
    """Return what is found in the files of a case, in the current folder.

    `reader: module.function` reads them with a function of `fsoe_net`, and `choice` with that
    choice of a device; `init: [files]` proposes a network from them, with `answers` if there are;
    all others are checked, and compared with the bus if there is a `scan` and with all files in
    `check` that are not of the network itself.
    """
    if "init" in case:
        return _proposal_findings(case)
    if "reader" not in case:
        scan = None
        if "scan" in case:
            scan, damage = load_scan(case["scan"])
            assert scan is not None, damage
        runtime = Runtime(case.get("runtime", "fsn"))
        return check_files(case["check"], runtime=runtime, scan=scan, compared=True).diagnostics
    module, _, name = case["reader"].rpartition(".")
    read = getattr(import_module(f"fsoe_net.{module}"), name)
    options = {"choice": EsiChoice(**case["choice"])} if "choice" in case else {}
    out = Collector()
    for file in case["check"]:
        read(file, out, **options)
    return out.diagnostics


def _proposal_findings(case: dict) -> list[Diagnostic]:
    out = Collector()
    answers = load_answers(case["answers"], out) if "answers" in case else Answers()
    assert answers is not None, out.diagnostics
    found = gather(case["init"], LoadOptions())
    made = make_draft(Inputs.of(found), answers)
    asked = question_findings(made, answered="answers" in case)
    return [*found.out.diagnostics, *made.findings, *asked]


def _check(folder: Path, case: dict, monkeypatch: pytest.MonkeyPatch) -> list[Diagnostic]:
    monkeypatch.chdir(folder)
    return findings(case)


@pytest.mark.shows("R6")
def test_every_code_has_a_case_and_a_page():
    assert sorted(CASES) == sorted(CATALOGUE)
    pages = HERE.parents[1] / "docs" / "diagnostics"
    missing = [code for code in CATALOGUE if not (pages / f"{code}.md").is_file()]
    assert missing == []


@pytest.mark.shows("R6")
@pytest.mark.parametrize("code", sorted(CASES))
def test_seeded_mistake_is_named_at_its_place(
    code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    case = CASES[code]
    folder = tmp_path / "case"
    shutil.copytree(HERE / "base", folder)
    _seed(folder, case)
    found = _check(folder, case, monkeypatch)
    places = [str(d.span) for d in found if d.code == code]
    assert case["at"] in places, [f"{d.span} {d.code} {d.message}" for d in found]
    # One mistake is one finding: whatever else is reported must be expected or a mere note.
    others = {d.code for d in found if d.level is not Severity.INFO} - {code}
    assert others <= set(case.get("also", ())), [f"{d.span} {d.code} {d.message}" for d in found]
    assert all(d.hint for d in found), [d.code for d in found if not d.hint]


def test_clean_bus_raises_nothing_of_its_own(monkeypatch: pytest.MonkeyPatch):
    found = _check(HERE / "base", {"check": ["network.yaml"], "scan": "scan.json"}, monkeypatch)
    assert [d.code for d in found if d.code.startswith("FSN5")] == []


OTHERS = ["cell.eni.xml", "coupler.xml", "safety.xml", "slaves.txt"]


@pytest.mark.shows("R6")
@pytest.mark.parametrize(
    "files",
    [
        ["network.yaml"],
        ["timed.yaml"],
        ["robot.urdf"],
        ["robot.urdf", "controllers.yaml"],
        ["devices/drive.yaml"],
        ["network.yaml", *OTHERS],
    ],
)
def test_clean_files_raise_nothing_but_notes(files: list[str], monkeypatch: pytest.MonkeyPatch):
    found = _check(HERE / "base", {"check": files}, monkeypatch)
    assert [f"{d.span} {d.code}" for d in found if d.level is not Severity.INFO] == []


READERS = {
    case["reader"]: case["check"] for case in CASES.values() if {"reader", "edit"} <= set(case)
}
READERS["formats.sii.read.load_sii"] = ["gate.sii"]
READERS["capture.start_up.load_capture"] = ["start-up.pcap"]


@pytest.mark.parametrize("reader", sorted(READERS))
def test_clean_files_of_other_tools_raise_nothing(reader: str, monkeypatch: pytest.MonkeyPatch):
    found = _check(HERE / "base", {"check": READERS[reader], "reader": reader}, monkeypatch)
    assert [f"{d.span} {d.code}" for d in found] == []


@pytest.mark.parametrize("file", ["network.yaml", "bus.eni.xml", "scan.json", "devices"])
def test_clean_files_to_start_from_raise_nothing(file: str, monkeypatch: pytest.MonkeyPatch):
    found = _check(HERE / "base", {"init": [file]}, monkeypatch)
    expected = {"FSN157"} if file == "devices" else set()
    assert {d.code for d in found if d.level is not Severity.INFO} == expected
