"""xacro: the real expansion, with the place of every element in the sources."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.ros2.urdf import load_urdf

MACRO = """<?xml version="1.0"?>
<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:macro name="terminal" params="name position">
    <gpio name="${name}">
      <ec_module name="${name}">
        <plugin>ethercat_generic_plugins/GenericEcSlave</plugin>
        <param name="position">${position}</param>
        <param name="slave_config">${name}.yaml</param>
      </ec_module>
    </gpio>
  </xacro:macro>
</robot>
"""
ROBOT = """<?xml version="1.0"?>
<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="rate" default="500"/>
  <xacro:include filename="macro.xacro"/>
  <ros2_control name="bus" type="system">
    <hardware>
      <plugin>ethercat_driver/EthercatDriver</plugin>
      <param name="control_frequency">$(arg rate)</param>
    </hardware>
    <xacro:terminal name="el1904" position="3"/>
    <joint name="axis">
      <ec_module name="axis">
        <plugin>ethercat_generic_plugins/EcCiA402Drive</plugin>
        <param name="position">4</param>
        <param name="slave_config">axis.yaml</param>
      </ec_module>
    </joint>
  </ros2_control>
</robot>
"""


def write(folder: Path, robot: str = ROBOT, macro: str = MACRO) -> str:
    (folder / "macro.xacro").write_text(macro, "utf-8")
    (folder / "robot.urdf.xacro").write_text(robot, "utf-8")
    return str(folder / "robot.urdf.xacro")


def test_macros_includes_and_order(tmp_path: Path):
    result = load_urdf(write(tmp_path), LoadOptions(xacro_args={"rate": "250"}))
    assert result.diagnostics == ()
    (system,) = result.systems
    assert system.control_frequency == 250
    assert [(m.name, m.position, m.components[0].kind) for m in system.modules] == [
        ("axis", 4, "joint"),
        ("el1904", 3, "gpio"),
    ]
    assert system.modules[1].slave_config == "el1904.yaml"
    place = system.modules[1].span
    assert (Path(place.file).name, place.line, place.column) == ("macro.xacro", 5, 7)
    assert system.modules[0].span.line == 12
    assert {Path(s.path).name for s in result.sources} == {"robot.urdf.xacro", "macro.xacro"}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("macro.xacro", "nowhere.xacro", "nowhere.xacro"),
        ("$(arg rate)", "$(arg speed)", "--arg speed:="),
        ("macro.xacro", "$(find my_robot)/macro.xacro", "--package"),
        ("<xacro:terminal", "<xacro:terminl", "terminl"),
        ('position="3"', "", "position"),
    ],
)
def test_failures_are_located_and_name_the_next_step(
    tmp_path: Path, old: str, new: str, words: str
):
    path = write(tmp_path, ROBOT.replace(old, new))
    result = load_urdf(path)
    (found,) = [d for d in result.diagnostics if d.code == "FSN119"]
    assert words in found.message + found.hint
    assert found.span.line > 1


def test_a_relative_package_begins_here_also_for_a_file_in_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = write(tmp_path, ROBOT.replace("macro.xacro", "$(find my_robot)/macro.xacro"))
    (tmp_path / "robots").mkdir()
    Path(path).rename(tmp_path / "robots" / "main.xacro")
    monkeypatch.chdir(tmp_path)
    result = load_urdf("robots/main.xacro", LoadOptions(packages={"my_robot": "."}))
    assert result.diagnostics == ()


def test_packages_are_found(tmp_path: Path):
    path = write(tmp_path, ROBOT.replace("macro.xacro", "$(find my_robot)/macro.xacro"))
    result = load_urdf(path, LoadOptions(packages={"my_robot": str(tmp_path)}))
    assert result.diagnostics == ()


def test_a_urdf_without_transfers_is_remarked(tmp_path: Path):
    from fsoe_net.formats.own.network import load_network

    result = load_network([write(tmp_path)])
    assert "FSN125" in [d.code for d in result.diagnostics]


def test_a_macro_names_the_parameters_that_it_lacks(tmp_path: Path):
    robot = ROBOT.replace(' name="el1904" position="3"', "")
    (said, *_) = load_urdf(write(tmp_path, robot)).diagnostics
    assert (said.code, said.hint) == ("FSN119", "give the macro: name,position")


def test_endless_macro_ends(tmp_path: Path):
    endless = MACRO.replace("<gpio", '<xacro:terminal name="a" position="1"/><gpio', 1)
    result = load_urdf(write(tmp_path, macro=endless))
    assert [d.code for d in result.diagnostics] == ["FSN119"]


def test_entities_are_refused(tmp_path: Path):
    bomb = '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><robot>&b;</robot>'
    path = tmp_path / "bomb.urdf"
    path.write_text(bomb, "utf-8")
    assert [d.code for d in load_urdf(path).diagnostics] == ["FSN118"]


@pytest.mark.parametrize("data", [b"<" * 10_000_000, b"<a>" * 100_000, b"<robot>\0</robot>", b"<"])
def test_hostile_xml_is_rejected(tmp_path: Path, data: bytes):
    path = tmp_path / "x.urdf"
    path.write_bytes(data)
    assert [d.code for d in load_urdf(path).diagnostics] == ["FSN118"]
