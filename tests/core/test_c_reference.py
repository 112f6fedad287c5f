"""The reference page of the C library says what the headers say."""

import re
from pathlib import Path

import pytest
from cli.tool import fsn
from live.support import needs_core

from fsoe_net.core.status import status_table
from fsoe_net.live.axis import AxisJob, AxisMode

ROOT = Path(__file__).parents[2]

HEADERS = ROOT / "master_core" / "include" / "fsn"
PAGE = ROOT / "docs" / "reference" / "c-api.md"

pytestmark = pytest.mark.skipif(
    not (HEADERS.is_dir() and PAGE.is_file()), reason="needs the source tree"
)


def test_every_status_is_listed_with_its_value_and_text() -> None:
    table = (HEADERS / "status.h").read_text()
    rows = re.findall(r'X\((\w+), (-?\d+),\s*"([^"]+)"\)', table)
    page = PAGE.read_text()
    assert len(rows) > 20
    for name, value, text in rows:
        assert f"| {value} | `FSN_{name}` | {text} |" in page


def test_every_function_is_mentioned() -> None:
    page = PAGE.read_text()
    for kind in ("subdevice", "sm", "symbol", "block", "copy", "connection"):
        page += f" fsn_plan_{kind} fsn_plan_{kind}_count"  # the page folds them into one row
    page += " fsn_status_name fsn_status_text"
    declared = set()
    for header in HEADERS.glob("*.h"):
        declared |= set(re.findall(r"\b(fsn_\w+)\(", header.read_text()))
    missing = {name for name in declared if not re.search(rf"\b{name}\b", page)}
    assert not missing


def test_every_public_function_states_its_context() -> None:
    for header in HEADERS.glob("*.h"):
        text = header.read_text()
        for match in re.finditer(r"/\*\*((?:(?!\*/).)*)\*/\s*FSN_API", text, re.DOTALL):
            assert "Context:" in match[1], match[1]


@needs_core
def test_explain_has_every_status() -> None:
    rows = re.findall(
        r'X\((\w+), (-?\d+),\s*"([^"]+)"\)', (HEADERS / "status.h").read_text("utf-8")
    )
    found = {row.name: row for row in status_table()}
    assert len(found) == len(rows) - 1  # OK is no error
    for name, value, text in rows[1:]:
        row = found[f"FSN_{name}"]
        assert (row.value, row.text) == (int(value), text)
        assert row.next_step
    for word in ("FSN_E_BUS_SILENT", "fsn_e_bus_silent", "E_BUS_SILENT"):
        done = fsn("explain", word)
        assert done.stdout == (
            "FSN_E_BUS_SILENT (-64): no SubDevice answers on this interface\n\nNext step: "
            "secure the machine, then check cable, power and --interface; --wait 30s retries.\n"
        )
    wrong = fsn("explain", "FSN_E_BUS_SILNT")
    assert wrong.returncode == 2
    assert "Did you mean FSN_E_BUS_SILENT?" in wrong.stderr
    assert "FSN_E_PLAN_CRC  CRC-32 does not fit" in fsn("explain").stdout


def test_numbers_of_axes_are_those_of_the_header():
    header = (HEADERS / "axis.h").read_text("utf-8")
    jobs = header[header.index("enum fsn_axis_job {") :].split("};")[0]
    names = re.findall(r"FSN_AXIS_JOB_(\w+)", jobs)
    assert names == [job.name for job in AxisJob]
    for mode in AxisMode:
        assert f"FSN_AXIS_{mode.name} = {mode.value}," in header
