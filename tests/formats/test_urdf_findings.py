"""Every finding of the URDF loader: one seeded mistake, one finding, at its exact place."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.formats.ros2.urdf import load_urdf

BASE = (Path(__file__).parent / "urdf" / "robot.urdf").read_text("utf-8")
PLUGIN = "ethercat_driver/EthercatDriver"
GENERIC = "<plugin>ethercat_generic_plugins/GenericEcSlave</plugin>"
LOGIC = '      <ec_module name="logic">\n        ' + GENERIC
HARDWARE_END = "    </hardware>\n    <sensor"
E, W, I = Severity.ERROR, Severity.WARNING, Severity.INFO  # noqa: E741 - reads as a column


def _check(tmp_path: Path, text: str | bytes) -> tuple[Diagnostic, ...]:
    file = tmp_path / "robot.urdf"
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    result = load_urdf(file)
    assert all(d.span.file == str(file) for d in result.diagnostics)
    return result.diagnostics


def _param(name: str, value: str) -> str:
    return f'<param name="{name}">{value}</param>'


def _system(name: str, value: str) -> tuple[str, str]:
    return HARDWARE_END, f"      {_param(name, value)}\n{HARDWARE_END}"


ALIAS = _param("alias", "0") + "\n"
POSITION = "        " + _param("position", "1") + "\n"
FREQUENCY = _param("control_frequency", "1000")

CASES = {
    # name: (find, put, code, severity, place, part of the hint)
    "no driver plugin": (f"      <plugin>{PLUGIN}</plugin>\n", "", "FSN110", E, "4:5", PLUGIN),
    "empty driver plugin": (f">{PLUGIN}<", "> <", "FSN110", E, "4:5", PLUGIN),
    "foreign plugin": (PLUGIN, "my_robot/Cell", "FSN121", I, "5:15", "your own"),
    "misspelt driver": (PLUGIN, "ethercat_drive/EthercatDriver", "FSN121", W, "5:15", PLUGIN),
    "other driver class": (PLUGIN, "ethercat_driver/Ec", "FSN121", W, "5:15", PLUGIN),
    "driver with blanks": (PLUGIN, f" {PLUGIN}", "FSN121", W, "5:16", PLUGIN),
    "prototype": (PLUGIN, "ethercat_driver/EthercatSafetyDriver", "FSN122", W, "5:15", PLUGIN),
    "both configs": (*_system("fsoe_config", "a"), "FSN123", E, "9:7", "keep transfer_config"),
    "old config": ("transfer_config", "fsoe_config", "FSN132", I, "8:7", "write transfer_config"),
    "safety block": ("<gpio", "<safety/>\n    <gpio", "FSN124", E, "17:5", "YAML"),
    "no module plugin": (LOGIC, '      <ec_module name="logic">', "FSN120", E, "18:7", GENERIC),
    "empty module plugin": (LOGIC, LOGIC.replace(GENERIC, "<plugin/>"), "FSN120", E, "19:9", "add"),
    "own plugin": ("ethercat_plugins/ATI_FTSensor", "mine/X", "FSN121", I, "12:17", "your own"),
    "misspelt plugin": ("GenericEcSlave", "GenericECSlave", "FSN121", W, "19:17", "/GenericEcSl"),
    "no such class": ("ATI_FTSensor", "Foo", "FSN121", W, "12:17", "no such class"),
    "nested command": (
        LOGIC,
        LOGIC + '<command_interface name="x"/>',
        "FSN127",
        W,
        "19:65",
        "into <gpio>",
    ),
    "nested state": (
        LOGIC,
        LOGIC + '\n  <state_interface name="x"/>',
        "FSN127",
        W,
        "20:3",
        "into <gpio>",
    ),
    "frequency 0": (FREQUENCY, _param("control_frequency", "0"), "FSN130", E, "7:39", "1000"),
    "frequency -1": (FREQUENCY, _param("control_frequency", "-1"), "FSN130", E, "7:39", "1000"),
    "frequency nan": (FREQUENCY, _param("control_frequency", "nan"), "FSN130", E, "7:39", "1000"),
    "frequency inf": (FREQUENCY, _param("control_frequency", "inf"), "FSN130", E, "7:39", "1000"),
    "frequency 1e999": (FREQUENCY, _param("control_frequency", "1e999"), "FSN130", E, "7:39", "Hz"),
    "frequency 1e-99": (FREQUENCY, _param("control_frequency", "1e-99"), "FSN130", E, "7:39", "Hz"),
    "frequency unit": (
        FREQUENCY,
        _param("control_frequency", "500Hz"),
        "FSN130",
        E,
        "7:39",
        "write 500",
    ),
    "frequency digits": (
        FREQUENCY,
        _param("control_frequency", "\u0661\u0660"),
        "FSN130",
        E,
        "7:39",
        "Hz",
    ),
    "no position": (POSITION, "", "FSN110", E, "18:7", 'name="position"'),
    "empty position": (POSITION, _param("position", "\n"), "FSN110", E, "21:1", "write its value"),
    "no slave_config": (_param("slave_config", "input.yaml"), "", "FSN110", E, "26:7", "slave_con"),
    "empty slave_config": (">input.yaml<", "><", "FSN110", E, "29:9", "write its value"),
    "empty transfers": (">transfers.yaml<", "> <", "FSN110", E, "8:7", "write its value"),
    "nameless module": ('<ec_module name="logic">', "<ec_module>", "FSN110", E, "18:7", 'name="'),
    "nameless gpio": ('<gpio name="io">', "<gpio>", "FSN110", E, "17:5", 'name="'),
    "nameless param": (ALIAS, ALIAS + "<param>1</param>", "FSN110", E, "21:1", 'name="'),
    "param twice": (ALIAS, ALIAS + ALIAS, "FSN106", E, "21:1", "delete"),
    "system param twice": (*_system("master_id", "1"), "FSN106", E, "9:7", "delete"),
    "unknown param": ('"required"', '"requird"', "FSN109", W, "30:9", "'required'"),
    "unknown system param": (
        *_system("readiness_timeout", "1"),
        "FSN109",
        W,
        "9:7",
        "readiness_timeout_s",
    ),
    "required": (">false<", ">False<", "FSN116", E, "30:32", "write false"),
    "required word": (">false<", ">maybe<", "FSN116", E, "30:32", "true or false"),
    "two blocks": (
        "</robot>",
        f"<ros2_control name='b'><hardware><plugin>{PLUGIN}</plugin></hardware>\n"
        "<joint name='axis'/></ros2_control></robot>",
        "FSN128",
        E,
        "49:1",
        "of its own",
    ),
    "twice in a block": (
        "    <joint",
        '    <gpio name="io"/>\n    <joint',
        "FSN128",
        E,
        "33:5",
        "of its own",
    ),
}


CASES |= {
    "two hardware tags": (
        HARDWARE_END,
        f"</hardware>\n<hardware><plugin>{PLUGIN}</plugin>\n{HARDWARE_END}",
        "FSN483",
        E,
        "4:5",
        "keep one",
    ),
    "two driver plugins": (
        f"<plugin>{PLUGIN}</plugin>",
        f"<plugin>{PLUGIN}</plugin>\n<plugin>mock_components/GenericSystem</plugin>",
        "FSN483",
        E,
        "6:1",
        "keep one",
    ),
    "an interface of a mock as well": (
        "</robot>",
        "<ros2_control name='m'><hardware><plugin>mock_components/GenericSystem</plugin>\n"
        "</hardware><joint name='axis'>\n<state_interface name='torque'/>\n"
        "<command_interface name='position'/></joint></ros2_control></robot>",
        "FSN128",
        E,
        "51:1",
        "in one ros2_control block",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_one_mistake_is_one_finding_at_its_place(name: str, tmp_path: Path):
    find, put, code, severity, place, hint = CASES[name]
    assert find in BASE
    (found,) = _check(tmp_path, BASE.replace(find, put, 1))
    assert (found.code, found.level) == (code, severity)
    assert f"{found.span.line}:{found.span.column}" == place
    assert hint in found.hint


NUMBERS = [
    # text, value, code, severity, readings in the message, hint
    ("0x5", 5, "FSN131", E, "2024 read 5, later ones read 0", "write 5"),
    ("08", 8, "FSN131", W, "every driver happens to read 8", "write 8"),
    ("1.9", None, "FSN131", E, "2024 read 1, later ones read 1", "whole number"),
    (" 3", 3, "FSN131", W, "every driver happens to read 3", "write 3"),
    ("+1", 1, "FSN131", W, "every driver happens to read 1", "write 1"),
    ("-1", None, "FSN131", E, "2024 read -1, later ones read 65535", "whole number"),
    ("1_0", None, "FSN131", E, "2024 read 1, later ones read 1", "whole number"),
    ("one", None, "FSN131", E, "2024 throw an exception, later ones throw", "whole number"),
    ("\u0663", None, "FSN131", E, "2024 throw an exception", "whole number"),
    ("065536", None, "FSN131", E, "read 65536", "whole number"),
    ("65536", None, "FSN113", E, "outside 0 … 65535", "ethercat slaves"),
    ("9" * 6000, None, "FSN113", E, "outside 0 … 65535", "ethercat slaves"),
]


@pytest.mark.parametrize("row", NUMBERS, ids=lambda r: repr(r[0][:8]))
@pytest.mark.parametrize("key", ["alias", "position"])
def test_addresses_that_drivers_read_differently(key: str, row: tuple, tmp_path: Path):
    text, value, code, severity, message, hint = row
    line, old = (20, "0") if key == "alias" else (21, "1")
    bad = BASE.replace(_param(key, old), _param(key, text), 1)
    (found,) = _check(tmp_path, bad)
    assert (found.code, found.level) == (code, severity)
    column = 29 if key == "alias" else 32
    assert (found.span.line, found.span.column) == (line, column + (text[0] == " "))
    assert message in found.message
    assert hint in found.hint
    (system,) = load_urdf(tmp_path / "robot.urdf").systems
    fallback = 0 if key == "alias" else 65535
    assert getattr(system.modules[1], key) == (fallback if value is None else value)


@pytest.mark.parametrize("text", ["0", "1", "65535"])
def test_plain_numbers_are_fine(text: str, tmp_path: Path):
    assert _check(tmp_path, BASE.replace(_param("position", "1"), _param("position", text))) == ()


@pytest.mark.parametrize(("text", "hz"), [("1e3", 1000.0), (" 62.5 ", 62.5), (".5", 0.5)])
def test_frequencies_as_the_driver_reads_them(text: str, hz: float, tmp_path: Path):
    assert _check(tmp_path, BASE.replace(FREQUENCY, _param("control_frequency", text))) == ()
    assert load_urdf(tmp_path / "robot.urdf").systems[0].control_frequency == hz


def test_master_id_is_an_address_too(tmp_path: Path):
    (found,) = _check(tmp_path, BASE.replace(_param("master_id", "1"), _param("master_id", "0x1")))
    assert (found.code, found.span.line, found.span.column) == ("FSN131", 6, 31)


def test_a_param_named_plugin_is_the_plugin(tmp_path: Path):
    bad = BASE.replace(GENERIC, _param("plugin", "mine/Own"), 1)
    (found,) = _check(tmp_path, bad)
    assert (found.code, found.level) == ("FSN121", I)
    assert load_urdf(tmp_path / "robot.urdf").systems[0].modules[1].plugin == "mine/Own"


def test_of_a_param_given_twice_the_last_counts(tmp_path: Path):
    bad = BASE.replace(POSITION, POSITION + POSITION.replace("1", "9"), 1)
    (found,) = _check(tmp_path, bad)
    assert [(r.span.line, r.span.column) for r in found.related] == [(21, 9)]
    assert load_urdf(tmp_path / "robot.urdf").systems[0].modules[1].position == 9


def test_equal_names_of_different_kinds_do_not_collide(tmp_path: Path):
    assert _check(tmp_path, BASE.replace('<gpio name="io">', '<gpio name="axis">')) == ()


def test_without_transfer_config_the_xml_block_means_no_copies(tmp_path: Path):
    bad = BASE.replace(_param("transfer_config", "transfers.yaml"), "<!-- none -->")
    (found,) = _check(tmp_path, bad.replace("</sensor>", "</sensor><safety/>"))
    assert (found.code, found.span.line, found.span.column) == ("FSN124", 16, 14)
    assert "nothing would be copied" in found.message


@pytest.mark.parametrize(
    ("root", "kind"),
    [
        ("EtherCATInfo", "this is an ESI (EtherCAT SubDevice information, or"),
        ("EtherCATConfig", "this is an ENI (EtherCAT network information)"),
        ("EtherCATInfoList", "this is the output of `ethercat xml` for several SubDevices"),
        ("sdf", "this is an SDF file"),
        ("Robot", "root <Robot>"),
    ],
)
def test_other_xml_is_named(root: str, kind: str, tmp_path: Path):
    (found,) = _check(tmp_path, f'<?xml version="1.0"?>\n <{root}/>')
    assert (found.code, found.span.line, found.span.column) == ("FSN117", 2, 2)
    assert kind in found.message
    assert found.hint


def test_robot_without_the_driver_is_reported(tmp_path: Path):
    (found,) = _check(tmp_path, "<robot><ros2_control><safety/></ros2_control></robot>")
    assert (found.code, found.span.line, found.span.column) == ("FSN125", 1, 1)


@pytest.mark.parametrize(
    ("param", "code", "hint"),
    [
        (("master_plugin", "ethercat_master/EtherLabMaster"), "FSN121", "EtherlabMaster"),
        (("master_plugin", "ethercat_master/MockMaster"), "FSN452", "EtherlabMaster"),
        (("master_plugin", "my_masters/Soem"), "", ""),
        (("master_plugin", "ethercat_master/SoemMaster"), "", ""),
        (("master_iface", "enp2s0"), "FSN109", "'master_id'"),
    ],
)
def test_the_master_of_the_driver(param: tuple[str, str], code: str, hint: str, tmp_path: Path):
    without = _param("master_id", "1") if param[0] == "master_iface" else _param("none", "")
    text = BASE.replace(without, "").replace("</hardware>", f"{_param(*param)}</hardware>")
    found = [d for d in _check(tmp_path, text) if d.code in ("FSN109", "FSN121", "FSN452")]
    assert [d.code for d in found] == [code] * bool(code)
    assert all(hint in d.hint for d in found)


@pytest.mark.parametrize(
    ("text", "required", "hint"),
    [
        ("No", False, "write false"),
        (" off", False, "write false"),
        ("0", False, "write false"),
        ("True", True, "write true"),
        ("YES ", True, "write true"),
        (" on", True, "write true"),
        ("1", True, "write true"),
        ("maybe", True, "write true or false"),
    ],
)
def test_a_flag_in_other_words_is_found_and_taken_as_meant(
    text: str, required: bool, hint: str, tmp_path: Path
):
    flag = _param("required", "false")
    assert BASE.count(flag) == 1
    (found,) = _check(tmp_path, BASE.replace(flag, _param("required", text)))
    assert (found.code, found.hint) == ("FSN116", hint)
    assert found.message == f"required is {text!r}; allowed are true and false"
    (system,) = load_urdf(tmp_path / "robot.urdf").systems
    assert [m.required for m in system.modules if m.name == "input"] == [required]


def test_of_several_hardware_tags_the_last_counts(tmp_path: Path):
    mock = "<hardware><plugin>mock_components/GenericSystem</plugin></hardware>"
    text = BASE.replace("    <sensor", f"{mock}<sensor", 1)
    path = tmp_path / "robot.urdf"
    path.write_text(text, "utf-8")
    (system,) = load_urdf(path).systems
    assert system.plugin == "mock_components/GenericSystem"


def test_other_hardware_of_a_joint_can_have_other_interfaces(tmp_path: Path):
    other = (
        "<ros2_control name='m'><hardware><plugin>my/Sensor</plugin></hardware>"
        "<joint name='axis'><state_interface name='torque'/></joint></ros2_control></robot>"
    )
    assert "FSN128" not in [d.code for d in _check(tmp_path, BASE.replace("</robot>", other))]
