"""Files other people published: read without blame where they are right."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from data_files import listed, need

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.image import igh_text
from fsoe_net.project.check import check_files


@pytest.mark.parametrize("name", listed("yaml", "icube_*.yaml"))
def test_published_slave_files_are_clean(name: str):
    found = check_files([str(need("yaml", name))]).diagnostics
    assert [d for d in found if d.level is not Severity.INFO] == []


@pytest.fixture
def estop(tmp_path: Path) -> Path:
    """The published e-stop files under the names they use for each other, the xacro fixed."""
    prefix = "yguel_safety-humble_"
    for name in ("beckhoff_ek1914.yaml", "beckhoff_el1918.yaml", "estop_ethercat_safety.yaml"):
        shutil.copy(need("yaml", prefix + name), tmp_path / name)
    text = need("yaml", prefix + "safety_estop.ros2_control.template.xacro").read_text("utf-8")
    (tmp_path / "published.xacro").write_text(text, "utf-8")
    fixed = text.replace("EthercatSafetyDriver", "EthercatDriver").replace(
        '<ec_module name="el1918">',
        '<ec_module name="el1918"><plugin>ethercat_generic_plugins/GenericEcSlave</plugin>',
    )
    fixed = fixed.replace('<command_interface name="safety_states"/>', "")
    (tmp_path / "fixed.xacro").write_text(fixed, "utf-8")
    return tmp_path


def test_published_estop_has_its_three_known_mistakes(estop: Path):
    found = check_files([str(estop / "published.xacro")]).diagnostics
    named = {d.code for d in found if d.level is not Severity.INFO}
    assert named == {"FSN120", "FSN122", "FSN127"}


def test_mended_estop_gives_the_image_measured_on_igh(estop: Path):
    checked = check_files([str(estop / "fixed.xacro")])
    assert [d for d in checked.diagnostics if d.level is not Severity.INFO] == []
    assert checked.resolution is not None
    assert igh_text(compile_plan(checked.resolution)) == (
        "Domain0: LogBaseAddr 0x00000000, Size  33, WorkingCounter 6/6\n"
        "  SlaveConfig 0:1, SM2 (Output), LogAddr 0x00000000, Size 9\n"
        "    00 00 00 00 00 00 00 00 00 \n"
        "  SlaveConfig 0:1, SM3 ( Input), LogAddr 0x00000009, Size 8\n"
        "    00 00 00 00 00 00 00 00 \n"
        "  SlaveConfig 0:0, SM2 (Output), LogAddr 0x00000011, Size 8\n"
        "    00 00 00 00 00 00 00 00 \n"
        "  SlaveConfig 0:0, SM3 ( Input), LogAddr 0x00000019, Size 8\n"
        "    00 00 00 00 00 00 00 00 "
    )


def test_transfer_file_on_its_own_is_checked_as_far_as_it_goes():
    path = need("yaml", "yguel_safety-humble_estop_ethercat_safety.yaml")
    found = check_files([str(path)]).diagnostics
    assert [(d.code, d.level) for d in found] == [("FSN201", Severity.INFO)]
