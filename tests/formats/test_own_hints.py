"""Hints about our own files: next steps that fit the file and where its path is from."""

from __future__ import annotations

from pathlib import Path

import pytest
from cli.tool import fsn

import fsoe_net
from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.formats.own.acceptance import load_acceptance
from fsoe_net.formats.own.library import load_library
from fsoe_net.formats.own.scenario import load_scenario
from fsoe_net.formats.own.test_record import load_test_record
from fsoe_net.formats.shared.files import Collector

DEVICES = Path(fsoe_net.__file__).parent / "devices"


def diagnostics_of(path: Path, reader=load_test_record) -> list[Diagnostic]:
    out = Collector()
    assert reader(path, out) is None
    return out.diagnostics


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "given.yaml"
    path.write_text(text, "utf-8")
    return path


@pytest.mark.parametrize("reader", [load_test_record, load_acceptance])
def test_repeated_key_of_a_record_names_no_driver(tmp_path: Path, reader):
    first = diagnostics_of(written(tmp_path, "version: 1\nversion: 1\n"), reader)[0]
    assert first.code == "FSN106"
    assert "driver" not in first.message


def test_missing_path_of_the_command_line_starts_in_the_current_folder(tmp_path: Path):
    (one,) = diagnostics_of(tmp_path / "none.yaml")
    assert one.hint == "check the path; relative paths start in the current folder"


def test_empty_file_has_a_next_step(tmp_path: Path):
    (one,) = diagnostics_of(written(tmp_path, ""))
    assert (one.message, one.hint) == (
        "the document is empty",
        "check the path, or fill in the file",
    )


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        # Descriptions of schemas/scenario.schema.json and of schemas/acceptance.schema.json.
        ("steps: [{press: reset}]", "add at_ms (time since the start in milliseconds)"),
        ("acceptance_record: 2", "add plan (the accepted plan: .fsnplan, zlib, base64)"),
    ],
)
def test_meaning_of_a_missing_key_is_part_of_the_hint(tmp_path: Path, text: str, hint: str):
    path = written(tmp_path, text)
    if "steps" in text:
        _, found = load_scenario(path)
    else:
        found = diagnostics_of(path, load_acceptance)
    assert hint in [one.hint for one in found]


REPORT = '{\n  "format": "fsoe-net report",\n  "text": "a\\nb"\n}\n'
NETWORK = "version: 1\nname: cell\nsubdevices: []\n"
PAGE = '<!doctype html>\n<html lang="en"><title>Example: cell</title></html>\n'


READERS = [
    (load_test_record, "a test record", "fsoe-net test-record"),
    (load_acceptance, "an acceptance record", "fsoe-net acceptance record"),
    (lambda path, out: out.diagnostics.extend(load_library([path])[1]), "a device file", "el1904"),
]


@pytest.mark.parametrize(("reader", "expected", "step"), READERS, ids=[r[1] for r in READERS])
@pytest.mark.parametrize(
    ("text", "words", "takes"),
    [
        (REPORT, "a report in JSON", ""),
        (PAGE, "a web page (HTML)", ""),
        (NETWORK, "a network", "`fsoe-net check"),
    ],
)
def test_wrong_file_is_named_with_what_was_expected(
    tmp_path: Path, text: str, words: str, takes: str, reader, expected: str, step: str
):
    (one,) = diagnostics_of(written(tmp_path, text), reader)
    assert (one.code, one.message) == ("FSN140", f"this is {words}, not {expected}")
    assert (takes or step) in one.hint


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (REPORT, "a report in JSON"),
        (NETWORK, "a YAML file of ethercat_driver_ros2 or fsoe-net"),
    ],
)
def test_wrong_capture_and_recording_are_named(tmp_path: Path, text: str, words: str):
    path = str(written(tmp_path, text))
    decoded, replayed = fsn("decode", path), fsn("campaign", "--replay", path)
    assert (decoded.returncode, replayed.returncode) == (1, 1)
    assert f"this is {words}, not a packet capture (pcap, pcapng); give" in decoded.stderr
    assert f"this is {words}, not a recording of a campaign; give" in replayed.stderr


def test_unknown_source_of_a_device_file_is_marked_with_the_near_name(tmp_path: Path):
    text = (DEVICES / "el1904.yaml").read_text("utf-8")
    assert text.count("source: esi\n") >= 2
    path = written(tmp_path, text.replace("source: esi\n", "source: esl\n", 1))
    (one,) = load_library([path])[1]
    line = path.read_text("utf-8").splitlines()[one.span.line - 1]
    assert line[one.span.column - 1 :] == "esl"
    assert one.hint == "write esi"


def test_window_that_ends_before_its_start_is_turned_round(tmp_path: Path):
    _, found = load_scenario(
        written(tmp_path, "version: 1\nexpect: [{during_ms: [780, 500], state: data_process}]\n")
    )
    (one,) = found
    assert (one.message, one.hint) == (
        "during_ms: the end is before the start",
        "write [500, 780]",
    )


def test_duration_with_a_comma_is_reported_once(tmp_path: Path):
    _, found = load_scenario(written(tmp_path, "version: 1\nduration_s: 3,5\n"))
    assert [one.code for one in found] == ["FSN111"]
