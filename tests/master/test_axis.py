"""Axes of a client in the cycle of a running ``fsn-master``, whose emulated bus has no drive."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from master import rig
from networks import EXAMPLES
from patience import PATIENCE_S

import fsoe_net
from fsoe_net import ControlRefused
from fsoe_net.live.axis import AxisJob, AxisMode, AxisPhase, AxisState
from fsoe_net.live.client import Client

NOT_THERE = "no answer, drive not ready to switch on, at 0"


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with rig.running() as master, fsoe_net.connect(str(master.path)) as found:
        yield found


def test_an_axis_is_found_by_its_device(client: Client) -> None:
    with client.realtime("drive_1.*", misses=1000) as realtime:
        axis = realtime.axis("drive_1", max_step=10, max_velocity=100, answer_s=0.05)
        assert (axis.phase, axis.mode, axis.job) == (AxisPhase.OFF, AxisMode.CSP, AxisJob.NONE)
        axis.enable()
        while axis.phase in (AxisPhase.OFF, AxisPhase.ENABLING):
            realtime.wait(PATIENCE_S)
            axis.step()
            realtime.send()
            assert axis.target_position == axis.position == 0
            assert (axis.target_velocity, axis.target_torque, axis.controlword) == (0, 0, 0)
            assert (axis.velocity, axis.torque, axis.statusword) == (0, 0, 0)
        assert (axis.phase, axis.state) == (AxisPhase.NO_ANSWER, AxisState.NOT_READY)
        assert (axis.enabled, axis.limited, axis.reached, axis.halted) == (False,) * 4
        with pytest.raises(ControlRefused, match="now; phase no answer, drive not ready"):
            axis.set_position(1)
        for refused in (axis.reset, axis.home):
            with pytest.raises(ControlRefused):
                refused()
        for refused in (axis.set_velocity, axis.set_torque, axis.move):
            with pytest.raises(ControlRefused):
                refused(1)
        with pytest.raises(ValueError, match="mode CST: not mapped, not of this drive, or its lim"):
            axis.mode = AxisMode.CST
        axis.mode = AxisMode.CSV
        axis.halt()
        axis.step()
        realtime.send()
        assert axis.halted
        axis.quick_stop()
        axis.disable()
        axis.step()
        assert (axis.phase, axis.mode) == (AxisPhase.OFF, AxisMode.CSV)
        realtime.send()
        mode = "drive_1.0x6060:00"
        while realtime.sent(mode) != AxisMode.CSV:
            realtime.wait(PATIENCE_S)


def test_invalid_input_is_rejected(client: Client) -> None:
    with client.realtime("drive_1.*", misses=1000) as realtime:
        with pytest.raises(ControlRefused, match=r"axis 0 of drive_2: .* is not an output of this"):
            realtime.axis("drive_2", max_step=1)
        with pytest.raises(ControlRefused, match="axis 1 of drive_1: 0x6840 is not mapped"):
            realtime.axis("drive_1", 1, max_step=1)
        with pytest.raises(ControlRefused, match="0x6040 is not mapped"):
            realtime.axis("el1904", max_step=1)
        with pytest.raises(ControlRefused, match="CSP needs max_step"):
            realtime.axis("drive_1")
        with pytest.raises(ControlRefused, match="no input nothing"):
            realtime.axis("drive_1", max_step=1, torque_off="nothing", torque_off_mask=1)
        with pytest.raises(ValueError, match="a limit of an axis is out of range"):
            realtime.axis("drive_1", max_step=-1)
        axis = realtime.axis("drive_1", max_step=1)
    with pytest.raises(ValueError, match="has left the cycle"):
        axis.step()


def test_the_example_in_python(client: Client) -> None:
    script = EXAMPLES / "clients/move_axis.py"
    words = [sys.executable, str(script), client.path, "drive_1", "5", "10"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "")
    assert done.stdout == "NO_ANSWER, drive NOT_READY, at 0\n"
    words[3] = "el1904"
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.stderr.startswith("move_axis: ")


@pytest.mark.parametrize(("language", "program"), [("c11", "cc"), ("c++17", "g++")])
def test_the_example_in_c_and_c_plus_plus(
    client: Client, tmp_path: Path, language: str, program: str
) -> None:
    if shutil.which(program) is None or shutil.which("cc") is None:
        pytest.skip(f"no {program}")
    core = rig.ROOT / "master_core"
    include = ["-I", core / "include"]
    objects = []
    for source in sorted((core / "src/client").glob("*.c")):
        objects.append(tmp_path / f"{source.stem}.o")
        words = ["cc", "-c", source, "-I", core / "src", *include, "-o", objects[-1]]
        subprocess.run([str(word) for word in words], check=True)
    warnings = ["-Wall", "-Wextra", "-Werror", "-Wpedantic", f"-std={language}"]
    words = [program, "-x", "c" if language == "c11" else "c++", EXAMPLES / "clients/axis.c"]
    words += [*warnings, *include, "-x", "none", *objects, "-o", tmp_path / "axis"]
    subprocess.run([str(word) for word in words], check=True)
    run = [str(tmp_path / "axis"), client.path, "drive_1", "5", "10"]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "")
    assert done.stdout == f"{NOT_THERE}\n" or done.stdout.startswith("enabling")  # taken back
