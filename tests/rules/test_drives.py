"""Drives of CiA 402: which process data are found fault with, and which are not."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from diagnostics import test_cases as cases

from fsoe_net.diag.diagnostic import Severity

DRIVE = "devices/drive.yaml"
TARGET = "type: int32, command_interface: position}"
STATE = "type: int32, state_interface: position}"
MODE = "\n      - {index: 0x6060, sub_index: 0, type: int8, %s}"
SHOWN = "\n      - {index: 0x6061, sub_index: 0, type: int8}"
PAD = "\n      - {index: 0x0000, sub_index: 0, type: bit8}"
SDO = "type: uint16, value: 2}"
PLUGIN = "ethercat_generic_plugins/EcCiA402Drive"


def mode(value: object) -> list[str]:
    return [DRIVE, TARGET, TARGET + MODE % f"default: {value}" + PAD]


def start_up(value: int, index: str = "0x6060") -> list[str]:
    row = f"\n  - {{index: {index}, sub_index: 0, type: int8, value: {value}}}"
    return [DRIVE, SDO, SDO + row]


def mapped_mode(keys: str) -> list[str]:
    return [DRIVE, TARGET, TARGET + MODE.replace(", %s", keys) + PAD]


HIDDEN = [DRIVE, SHOWN, ""]
GENERIC = ["robot.urdf", PLUGIN, "ethercat_generic_plugins/GenericEcSlave"]
NO_ACTUAL = [DRIVE, "0x6064, sub_index: 0", "0x606c, sub_index: 0"]
NO_STATUS = [DRIVE, "0x6041, sub_index: 0", "0x603f, sub_index: 0"]
ROBOT = "robot.urdf"
PACKAGE = [ROBOT, "ethercat_driver/EthercatDriver", "fsoe_net_ros/EthercatDriver"]
COMMAND = '<command_interface name="position"/>'
NO_MODE = [ROBOT, '<param name="mode_of_operation">8</param>', ""]
FIXED = [DRIVE, TARGET, "type: int32, default: 5, command_interface: position}"]
NOT_A_NUMBER = [DRIVE, TARGET, "type: int32, default: .nan, command_interface: position}"]
VELOCITY_TOO = [
    DRIVE,
    "      - {index: 0x607a,",
    "      - {index: 0x60ff, sub_index: 0, type: int32, command_interface: velocity}\n"
    "      - {index: 0x607a,",
]
VELOCITY_COMMAND = '<command_interface name="velocity"/>'
COMMANDS_VELOCITY = [ROBOT, COMMAND, VELOCITY_COMMAND]
SECOND = [
    [
        DRIVE,
        "{index: 0x607a,",
        "{index: 0x6840, sub_index: 0, type: uint16}\n      - {index: 0x687a,",
    ],
    [
        DRIVE,
        "{index: 0x6064,",
        "{index: 0x6841, sub_index: 0, type: uint16}\n      - {index: 0x6864,",
    ],
]
URDF_MODE_9 = [["robot.urdf", 'mode_of_operation">8', 'mode_of_operation">9']]
CASES = {
    "position, mode and what they are": ([mode(8)], []),
    "velocity by start-up, with its target": (
        [start_up(9), [DRIVE, "0x607a, sub_index: 0", "0x60ff, sub_index: 0"]],
        [],
    ),
    "velocity without its target": ([*URDF_MODE_9, mode(8)], ["FSN470"]),
    "the plugin writes the mode of the URDF": ([mode(9)], []),
    "a generic plugin writes that of the slave YAML": ([mode(9), GENERIC], ["FSN470"]),
    "a velocity is commanded in a mode of positions": (
        [mode(8), VELOCITY_TOO, COMMANDS_VELOCITY],
        ["FSN470"],
    ),
    "a velocity is commanded as well": (
        [mode(8), VELOCITY_TOO, [ROBOT, COMMAND, COMMAND + VELOCITY_COMMAND]],
        [],
    ),
    "a velocity is commanded in its mode": (
        [*URDF_MODE_9, mode(9), VELOCITY_TOO, COMMANDS_VELOCITY],
        [],
    ),
    "a start-up mode that a command changes": (
        [
            NO_MODE,
            start_up(8),
            mapped_mode(", command_interface: mode"),
            VELOCITY_TOO,
            [ROBOT, COMMAND, VELOCITY_COMMAND + '<command_interface name="mode"/>'],
        ],
        [],
    ),
    "a fixed target without the actual one": (
        [FIXED, HIDDEN, NO_ACTUAL],
        ["FSN471", "FSN473"],
    ),
    "torque without its target": ([start_up(10)], ["FSN470"]),
    "homing takes no target": ([start_up(6), NO_ACTUAL], []),
    "profile position is no loop": ([start_up(1), NO_ACTUAL], []),
    "a mode that nobody states": ([mode(".nan")], []),
    "a mode by a program": (
        [[DRIVE, TARGET, TARGET + MODE % "command_interface: mode, default: 9" + PAD]],
        [],
    ),
    "a fixed target in velocity": ([start_up(3), FIXED], []),
    "a fixed target": ([FIXED, HIDDEN], ["FSN473"]),
    "a plugin that waits for the mode": ([HIDDEN], ["FSN475"]),
    "the same with a mode that is written": ([mode(8), HIDDEN], ["FSN475"]),
    "the same in velocity": (
        [start_up(9), HIDDEN, [DRIVE, "0x607a, sub_index: 0", "0x60ff, sub_index: 0"]],
        [],
    ),
    "this project does not wait for the mode": ([HIDDEN, PACKAGE], []),
    "the same with a mode that the drive may refuse": ([mode(8), HIDDEN, PACKAGE], ["FSN474"]),
    "this project does not read where the axis is": ([NO_ACTUAL, PACKAGE], ["FSN471"]),
    "the mode is not shown to another plugin": ([mode(8), HIDDEN, GENERIC], ["FSN474"]),
    "a plugin that replaces it": ([mode(8), FIXED], []),
    "the same with another plugin": (
        [mode(8), FIXED, GENERIC],
        ["FSN473"],
    ),
    "a default that is not a number": ([NOT_A_NUMBER], []),
    "the second axis": (SECOND, []),
    "a mode of the second axis": ([*SECOND, start_up(9, "0x6860")], ["FSN470"]),
    "a mode of an axis that is not there": ([start_up(9, "0x7060")], []),
    "an output of a terminal": (
        [[DRIVE, "0x6040, sub_index: 0", "0x7040, sub_index: 0"], GENERIC],
        [],
    ),
    "the plugin has no controlword": (
        [[DRIVE, "0x6040, sub_index: 0", "0x7040, sub_index: 0"]],
        ["FSN484"],
    ),
    "the plugin reads no statusword": ([NO_STATUS], ["FSN484"]),
    "another plugin reads no statusword": ([NO_STATUS, GENERIC], ["FSN472"]),
    "the plugin does not read where the axis is": ([NO_ACTUAL], ["FSN475"]),
    "another plugin does not read where the axis is": ([NO_ACTUAL, GENERIC], ["FSN471"]),
    "a PDO without channels can have each object": (
        [NO_STATUS, NO_ACTUAL, [DRIVE, "tpdo:\n", "tpdo:\n  - {index: 0x1a01}\n"]],
        ["FSN472", "FSN471", "FSN406"],
    ),
    "PDOs in the list of the other direction": (
        [[DRIVE, "index: 0x1600", "index: 0x1a02"], [DRIVE, "0x6040, sub", "0x6041, sub"]],
        ["FSN401"],
    ),
    "PDOs on no sync manager": (
        [[DRIVE, "rpdo:\n", "sm:\n  - {index: 3, type: input, pdo: tpdo}\nrpdo:\n"]],
        ["FSN409"],
    ),
    "nothing writes the mode": ([NO_MODE, mapped_mode("")], ["FSN485"]),
    "no joint has the command for the mode": (
        [NO_MODE, mapped_mode(", command_interface: mode, default: 0")],
        ["FSN485"],
    ),
    "a joint has the command for the mode": (
        [
            NO_MODE,
            mapped_mode(", command_interface: mode"),
            [ROBOT, COMMAND, COMMAND + '<command_interface name="mode"/>'],
        ],
        [],
    ),
    "nothing but the plugin writes the mode": ([mapped_mode("")], []),
    "the second axis does not say where it is": (
        [*SECOND, [DRIVE, "0x6864", "0x686c"], [DRIVE, "0x6841", "0x683f"]],
        ["FSN472", "FSN471"],
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_findings_in_a_drive(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    edits, wanted = CASES[name]
    folder = tmp_path / "case"
    shutil.copytree(cases.HERE / "base", folder)
    cases._seed(folder, {"edit": edits})
    monkeypatch.chdir(folder)
    rows = cases.findings({"check": ["robot.urdf"]})
    assert [d.code for d in rows if d.level is not Severity.INFO] == wanted, rows


NOTED = {
    "the mode of the URDF is not mapped": ([], ["robot.urdf:24:41"]),
    "a start-up SDO sends it": ([start_up(8)], []),
    "the URDF states none": ([NO_MODE], []),
    "another plugin": ([GENERIC], []),
}


@pytest.mark.parametrize("name", NOTED)
def test_a_mode_that_is_not_mapped_is_a_note(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    edits, places = NOTED[name]
    folder = tmp_path / "case"
    shutil.copytree(cases.HERE / "base", folder)
    cases._seed(folder, {"edit": edits})
    monkeypatch.chdir(folder)
    rows = [d for d in cases.findings({"check": ["robot.urdf"]}) if d.code == "FSN485"]
    assert [(str(d.span), d.level) for d in rows] == [(p, Severity.INFO) for p in places]


@pytest.mark.parametrize(("plugin", "count"), [([], 0), ([GENERIC], 1)])
def test_only_the_drive_plugin_writes_a_mode_without_an_interface(
    plugin: list, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "case"
    shutil.copytree(cases.HERE / "base", folder)
    cases._seed(folder, {"edit": [mode(8), *plugin]})
    monkeypatch.chdir(folder)
    rows = cases.findings({"check": ["robot.urdf"]})
    assert [d.code for d in rows].count("FSN450") == count


def test_outputs_that_a_transfer_writes_need_no_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "case"
    shutil.copytree(cases.HERE / "base", folder)
    copy = """    transfers:
      - size: 1
        kind: standard
        in: {ec_module: logic, index: 0xf100, subindex: 1}
        out: {ec_module: axis, index: 0x6060, subindex: 0}
"""
    idle = [NO_MODE, mapped_mode(""), VELOCITY_TOO]
    cases._seed(folder, {"edit": idle})
    monkeypatch.chdir(folder)
    codes = [d.code for d in cases.findings({"check": ["robot.urdf"]})]
    assert {"FSN481", "FSN485"} <= set(codes)
    cases._seed(folder, {"edit": [["transfers.yaml", "    transfers:\n", copy]]})
    codes = [d.code for d in cases.findings({"check": ["robot.urdf"]})]
    assert not {"FSN481", "FSN485"} & set(codes)
