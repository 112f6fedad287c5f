"""FSN486, FSN487: a command that is not shown as it was given."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.project.check import check_files

FILE = """\
vendor_id: 2
product_id: 3
rpdo:
  - index: 0x1600
    channels:
      - {{index: 0x6040, sub_index: 0, type: uint16}}
      - {{index: {target}, sub_index: 0, type: int32, {command}}}
tpdo:
  - index: 0x1a00
    channels:
      - {{index: 0x6041, sub_index: 0, type: uint16}}
      - {{index: 0x6061, sub_index: 0, type: int8}}
      - {{index: {actual}, sub_index: 0, type: int32, {state}}}
"""
POSITION, VELOCITY = ("0x607a", "0x6064"), ("0x60ff", "0x606c")
COMMAND, STATE = "command_interface: position", "state_interface: position"
NOTE, WARNING, ERROR = Severity.INFO, Severity.WARNING, Severity.ERROR


def scaled(
    tmp_path: Path, command: str, state: str, objects: tuple[str, str] = POSITION
) -> list[tuple[str, Severity, int]]:
    path = tmp_path / "drive.yaml"
    target, actual = objects
    path.write_text(
        FILE.format(target=target, actual=actual, command=command, state=state), "utf-8"
    )
    return [
        (d.code, d.level, d.span.line)
        for d in check_files([str(path)]).diagnostics
        if d.code in ("FSN486", "FSN487")
    ]


# 20861 and 4.794e-5 are those of a published arm with 65535 increments for half a turn.
ACCEPTED = {
    "no scale": ("", ""),
    "published and rounded": (", factor: 20861.0", ", factor: 4.794e-5"),
    "an axis that turns the other way": (", factor: -1000", ", factor: -0.001"),
    "an offset in both": (", factor: 1000, offset: 3142", ", factor: 0.001, offset: -3.142"),
    "an offset rounded to an increment": (
        ", factor: 1000, offset: 3142",
        ", factor: 0.001, offset: -3.1415927",
    ),
    "half a turn as offset, with rounded factors": (
        ", factor: 20861, offset: -65535",
        ", factor: 4.794e-5, offset: 3.14159",
    ),
    "a factor of the device": (
        ", factor: 1000",
        ", factor_from_sdo: {index: 0x608f, sub_index: 1}",
    ),
}


@pytest.mark.parametrize("name", ACCEPTED)
def test_inverse_scales_are_accepted(name: str, tmp_path: Path):
    command, state = ACCEPTED[name]
    assert scaled(tmp_path, COMMAND + command, STATE + state) == []


FOUND = {
    "0.2 percent": (", factor: 1002", ", factor: 0.001", "FSN487", NOTE),
    "2 percent": (", factor: 1020", ", factor: 0.001", "FSN487", WARNING),
    "only the command": (", factor: 1000", "", "FSN487", WARNING),
    "only the state": ("", ", factor: 0.001", "FSN487", WARNING),
    "an offset of the state": (", factor: 1000", ", factor: 0.001, offset: 1", "FSN487", WARNING),
    "opposite signs": (", factor: 1000", ", factor: -0.001", "FSN486", ERROR),
    "opposite signs and sizes": (", factor: 7", ", factor: -0.001", "FSN486", ERROR),
}


@pytest.mark.parametrize("name", FOUND)
def test_other_scales_are_named_at_the_command(name: str, tmp_path: Path):
    command, state, code, level = FOUND[name]
    assert scaled(tmp_path, COMMAND + command, STATE + state) == [(code, level, 7)]


def test_a_velocity_is_compared_with_the_actual_velocity(tmp_path: Path):
    rows = scaled(
        tmp_path, "command_interface: v, factor: 60", "state_interface: v, factor: 1", VELOCITY
    )
    assert [code for code, *_ in rows] == ["FSN487"]


def test_different_interfaces_can_have_different_units(tmp_path: Path):
    assert scaled(tmp_path, "command_interface: rpm, factor: 60", STATE, VELOCITY) == []


def test_the_hint_is_the_inverse_of_the_state(tmp_path: Path):
    path = tmp_path / "drive.yaml"
    state = f"{STATE}, factor: 0.004, offset: -2"
    path.write_text(
        FILE.format(target="0x607a", actual="0x6064", command=COMMAND, state=state), "utf-8"
    )
    (row,) = [d for d in check_files([str(path)]).diagnostics if d.code == "FSN487"]
    factor, offset = re.findall(r"[-0-9.]+(?=,| here)", row.hint or "")
    # What is shown for a command of 7 with the scales of the hint.
    assert 0.004 * (float(factor) * 7 + float(offset)) - 2 == pytest.approx(7)


@pytest.mark.parametrize("value", ["0", "0.0", "-0", ".nan", ".inf"])
def test_a_factor_that_leaves_no_value_is_an_error(value: str, tmp_path: Path):
    assert scaled(tmp_path, f"{COMMAND}, factor: {value}", STATE) == [("FSN487", ERROR, 7)]
