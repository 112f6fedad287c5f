"""The reference pages say what the program does."""

import dataclasses
import re
from pathlib import Path

import pytest
from run.support import ESTOP, ROOT, document, needs_core, run, session_of

from fsoe_net.load import load_scenario, read_schema
from fsoe_net.run import run_virtual

PAGES = ROOT / "docs" / "reference"


def page(name: str) -> str:
    return (PAGES / name).read_text("utf-8")


def code(text: str, language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", text, re.S)
    assert found
    return found.group(1)


@needs_core
def test_example_of_the_scenario_page_passes(tmp_path: Path):
    path = tmp_path / "s.yaml"
    path.write_text(code(page("scenario-file.md"), "yaml"), "utf-8")
    result = run(ESTOP, path)
    assert [v.held for v in result.verdicts] == [True, True, True]


@needs_core
def test_failed_expectation_reads_as_shown(tmp_path: Path):
    text = "duration_s: 0.2\nexpect:\n  - {at_ms: 100, state: data_process}\n"
    session = session_of(ESTOP, text, tmp=tmp_path)
    (v,) = run_virtual(session, session.duration_ns).verdicts
    shown = f"s.yaml{v.place.rpartition('.yaml')[2]}: not observed: {v.text}; {v.seen}\n"
    assert shown == code(page("scenario-file.md"), "text")


def test_every_key_of_the_schema_is_on_the_page():
    schema, text = read_schema("scenario"), page("scenario-file.md")
    keys = set(schema["properties"]) - {"logic"}
    for name in ("step", "expectation"):
        keys |= set(schema["$defs"][name]["properties"])
    keys |= set(schema["$defs"]["expectation"]["properties"]["state"]["enum"])
    assert [k for k in sorted(keys) if not re.search(rf"`{k}[`:]", text)] == []


@needs_core
def test_every_key_of_the_json_is_on_the_page():
    text, found = page("run-output.md"), document(run(ESTOP))
    keys = {*found, *found["connections"][0], *found["statistics"], *found["events"][0]}
    listed = {word for row in re.findall(r"^\| (`.*?) \|", text, re.M) for word in row.split("`")}
    listed |= {word for row in re.findall(r"\{([a-z_, ]+)\}", text) for word in row.split(", ")}
    assert sorted(keys - listed) == []
    fields = {f.name for f in dataclasses.fields(run(ESTOP).statistics)}
    assert sorted(fields - listed) == []


@pytest.mark.parametrize("name", ["estop", "el6910"])
def test_the_scenario_examples_are_valid(name: str):
    scenario, found = load_scenario(ROOT / "examples" / name / "scenario.yaml")
    assert scenario is not None
    assert found == []
