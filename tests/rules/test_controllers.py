"""FSN477 blames no interface that another controller or other hardware can offer."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from cases_file import DIAGNOSTICS
from networks import EXAMPLES

from fsoe_net.project.check import check_files

OTHER = """\
  <ros2_control name="gripper" type="system">
    <hardware><plugin>some_package/Gripper</plugin></hardware>
  </ros2_control>
</robot>
"""


@pytest.mark.parametrize(
    ("joint", "hardware", "reported"),
    [
        ("finger", False, True),  # no block has this joint
        ("finger", True, False),  # the other hardware may export it
        ("state", False, False),  # a controller of this name: a chain
        ("axis", True, False),
    ],
)
def test_only_what_nothing_can_offer_is_missing(
    joint: str, hardware: bool, reported: bool, tmp_path: Path
) -> None:
    folder = tmp_path / "robot"
    shutil.copytree(DIAGNOSTICS / "base", folder)
    urdf, controllers = folder / "robot.urdf", folder / "controllers.yaml"
    text = controllers.read_text("utf-8")
    controllers.write_text(text.replace("joints: [axis]", f"joints: [{joint}]"), "utf-8")
    if hardware:
        urdf.write_text(urdf.read_text("utf-8").replace("</robot>", OTHER), "utf-8")
    found = check_files([str(urdf), str(controllers)]).diagnostics
    assert ("FSN477" in [d.code for d in found]) is reported


def test_a_mistake_of_the_description_is_not_copied_into_the_controllers(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES / "el6910" / "devices", tmp_path / "el6910" / "devices")
    cell = tmp_path / "robot-cell"
    shutil.copytree(EXAMPLES / "robot-cell", cell)
    urdf = cell / "robot.urdf.xacro"
    text = urdf.read_text("utf-8")
    urdf.write_text(text.replace('command_interface name="position"',
                                 'command_interface name="positon"'), "utf-8")  # fmt: skip
    found = check_files([str(urdf), str(cell / "controllers.yaml")]).diagnostics
    (hint,) = (d.hint for d in found if d.code == "FSN477")
    assert "position in the robot description" in hint
