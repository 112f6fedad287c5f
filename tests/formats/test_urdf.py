"""What a URDF says: systems, modules in driver order, places; and the published examples."""

from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path

import pytest
from data_files import need

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.ros2.urdf import UrdfResult, load_urdf

HERE = Path(__file__).parent / "urdf"


def _found(result: UrdfResult) -> list[str]:
    return [f"{d.code} {d.span.line}:{d.span.column}" for d in result.diagnostics]


@pytest.fixture
def no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Any child process fails the test."""

    def refuse(*_args: object, **_options: object) -> None:
        pytest.fail("a child process was started")

    monkeypatch.setattr(subprocess, "Popen", refuse)


@pytest.mark.usefixtures("no_process")
def test_modules_are_in_the_order_in_which_the_driver_adds_them():
    result = load_urdf(HERE / "robot.urdf")
    assert _found(result) == []
    (system,) = result.systems  # the mock_components block is not ours
    assert [(m.name, m.components[0].kind, m.components[0].name) for m in system.modules] == [
        ("drive", "joint", "axis"),
        ("logic", "gpio", "io"),
        ("input", "gpio", "io"),
        ("force", "sensor", "force"),
    ]


def test_values_and_defaults():
    (system,) = load_urdf(HERE / "robot.urdf").systems
    assert (system.name, system.plugin) == ("cell", "ethercat_driver/EthercatDriver")
    assert (system.master_id, system.control_frequency) == (1, 1000.0)
    assert (system.transfer_file, system.transfer_key) == ("transfers.yaml", "transfer_config")
    drive, logic, entry, force = system.modules
    assert (drive.alias, drive.position, drive.required) == (7, 2, True)
    assert drive.params["mode_of_operation"] == "8"
    assert (logic.alias, logic.position) == (0, 1)
    assert logic.slave_config == "\n          logic.yaml\n        "  # as the driver takes it
    assert (entry.position, entry.required) == (0, False)
    assert (force.alias, force.plugin) == (0, "ethercat_plugins/ATI_FTSensor")


def test_every_value_has_its_place():
    path = str(HERE / "robot.urdf")
    (system,) = load_urdf(path).systems
    drive, logic, *_ = system.modules
    assert str(system.span) == f"{path}:3:3"
    assert str(system.at("plugin")) == f"{path}:5:15"
    assert str(system.at("transfer_config")) == f"{path}:8:37"
    assert str(drive.span) == str(drive.at("name")) == f"{path}:35:7"
    assert str(drive.at("plugin")) == f"{path}:36:17"
    assert str(drive.at("alias")) == f"{path}:37:29"
    assert str(drive.at("mode_of_operation")) == f"{path}:39:41"
    assert str(logic.at("slave_config")) == f"{path}:23:11"  # text on a line of its own
    assert str(logic.at("required")) == str(logic.span)  # not written


def test_the_source_is_recorded_with_its_digest():
    path = HERE / "robot.urdf"
    (row,) = load_urdf(path).sources
    assert row.path == str(path)
    assert row.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_defaults_of_an_empty_block(tmp_path: Path):
    file = tmp_path / "r.urdf"
    file.write_text(
        "<robot><ros2_control name='a'><hardware><plugin>ethercat_driver/EthercatDriver</plugin>"
        "</hardware></ros2_control></robot>"
    )
    (system,) = load_urdf(file).systems
    assert (system.master_id, system.control_frequency) == (0, 100.0)
    assert (system.transfer_file, system.transfer_key, system.modules) == (None, None, ())


def test_modules_without_a_readable_position_get_unused_ones(tmp_path: Path):
    file = tmp_path / "r.urdf"
    text = (HERE / "robot.urdf").read_text()
    text = text.replace('<param name="position">1</param>', "")
    file.write_text(text.replace('"position">2<', '"position">65535<').replace(">3<", ">x<"))
    (system,) = load_urdf(file).systems
    assert [m.position for m in system.modules] == [65535, 65534, 0, 65533]


@pytest.mark.usefixtures("no_process")
def test_published_estop_template():
    path = need("yaml", "yguel_safety-humble_safety_estop.ros2_control.template.xacro")
    result = load_urdf(path)
    assert _found(result) == ["FSN122 5:21", "FSN132 8:13", "FSN120 12:13", "FSN127 16:17"]
    (system,) = result.systems
    assert [(m.name, m.position, m.plugin is None) for m in system.modules] == [
        ("el1918", 1, True),
        ("ek1914", 0, False),
    ]
    assert (system.transfer_file, system.transfer_key) == (
        "estop_ethercat_safety.yaml",
        "fsoe_config",
    )


@pytest.mark.usefixtures("no_process")
def test_published_safety_example():
    result = load_urdf(need("yaml", "yguel_safety-humble_safety.ros2_control.xacro"))
    assert _found(result) == ["FSN132 8:13"]
    assert [d.level for d in result.diagnostics] == [Severity.INFO]
    (system,) = result.systems
    assert [(m.name, m.position) for m in system.modules] == [
        ("MAXON_on_EPOS3", 0),  # the last in the file, but a joint
        ("limit_switches_on_EL1018", 6),
        ("encoder_on_EL5101", 2),
    ]


SYSTEM = """
<ros2_control name="{name}" type="system">
  <hardware><plugin>ethercat_driver/EthercatDriver</plugin>{params}</hardware>
  {components}
</ros2_control>
"""
MODULE = """
<ec_module name="{name}"><plugin>ethercat_generic_plugins/GenericEcSlave</plugin>
  <param name="position">{position}</param><param name="slave_config">{config}</param></ec_module>
"""


def module(name: str = "drv", position: int = 0, config: str = "a.yaml") -> str:
    return MODULE.format(name=name, position=position, config=config)


def robot(tmp_path: Path, *systems: tuple[str, str, str]) -> UrdfResult:
    """Load a robot of systems, each with name, params and components."""
    rows = [SYSTEM.format(name=n, params=p, components=c) for n, p, c in systems]
    path = tmp_path / "r.urdf"
    path.write_text(f'<robot name="r">{"".join(rows)}</robot>', "utf-8")
    return load_urdf(path)


@pytest.mark.parametrize(
    ("second", "components"),
    [
        (module(), [("a", "b")]),
        (module(position=1), [("a",), ("b",)]),  # another SubDevice by the same name
        (module(config="b.yaml"), [("a",), ("b",)]),  # a second instance for the newest driver
        (module("other"), [("a",), ("b",)]),
    ],
)
def test_one_subdevice_in_two_joints_is_one_module(
    second: str, components: list[tuple[str, ...]], tmp_path: Path
):
    joints = f'<joint name="a">{module()}</joint><joint name="b">{second}</joint>'
    (system,) = robot(tmp_path, ("s", "", joints)).systems
    assert [tuple(c.name for c in m.components) for m in system.modules] == components


def test_a_module_twice_in_one_joint_stays_two(tmp_path: Path):
    joint = f'<joint name="a">{module()}{module()}</joint>'
    (system,) = robot(tmp_path, ("s", "", joint)).systems
    assert [c.name for m in system.modules for c in m.components] == ["a", "a"]


def test_masters_with_names_have_numbers_of_their_own(tmp_path: Path):
    def params(master: str, plugin: str = "ethercat_master/SoemMaster") -> str:
        named = f'<param name="master_plugin">{plugin}</param>' if plugin else ""
        return f'{named}<param name="master_id">{master}</param>'

    rows = [
        ("one", params("enp2s0"), ""),
        ("two", params("0", ""), ""),
        ("three", params("enp3s0"), ""),
        ("four", params("enp2s0"), ""),
    ]
    result = robot(
        tmp_path, *((n, p, f'<joint name="{n}">{module(n)}</joint>') for n, p, _ in rows)
    )
    assert [s.master_id for s in result.systems] == [1, 0, 2, 1]
    assert [d.code for d in result.diagnostics] == []


@pytest.mark.parametrize("plugin", ["", "ethercat_master/EtherlabMaster"])
def test_the_igh_master_takes_no_name(plugin: str, tmp_path: Path):
    named = f'<param name="master_plugin">{plugin}</param>' if plugin else ""
    params = f'{named}<param name="master_id">enp2s0</param>'
    result = robot(tmp_path, ("s", params, f'<joint name="j">{module()}</joint>'))
    (found,) = result.diagnostics
    assert found.code == "FSN131"
    assert found.hint.endswith("a name such as enp2s0 needs a master_plugin that takes one")


def test_a_module_in_an_old_safety_block_is_not_named_twice(tmp_path: Path):
    block = f'<safety>{module()}</safety><joint name="j">{module("x")}</joint>'
    result = robot(tmp_path, ("s", "", block))
    assert [d.code for d in result.diagnostics] == ["FSN124"]


MACRO = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:macro name="{name}" params="prefix">{inside}</xacro:macro>
  <xacro:macro name="other"><link name="l"/></xacro:macro>
</robot>
"""


def test_a_macro_that_is_not_called_is_named(tmp_path: Path):
    inside = SYSTEM.format(name="${prefix}s", params="", components="")
    path = tmp_path / "arm.xacro"
    path.write_text(MACRO.format(name="arm", inside=inside), "utf-8")
    (found,) = load_urdf(path).diagnostics
    assert (found.code, found.span.line) == ("FSN125", 2)
    assert found.message == (
        "the driver is in the macro <xacro:arm>, which this file defines and does not call; "
        "these parameters have no default: prefix"
    )
    path.write_text(MACRO.format(name="arm", inside='<link name="k"/>'), "utf-8")
    (found,) = load_urdf(path).diagnostics
    assert found.message.startswith("no ros2_control block")
