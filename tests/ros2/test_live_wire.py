"""A node beside a bus with cables: fsn-master on SOEM, emulated SubDevices, Fast DDS."""

from __future__ import annotations

from pathlib import Path

from live.on_the_wire import ESTOP, on_the_wire
from ros2.rig import peer_program


def test_a_reset_is_an_error_within_a_second(tmp_path: Path) -> None:
    peer_program()
    seen = on_the_wire(
        "reset", ESTOP, tmp=tmp_path, script="live/ros2_rig.py", good=lambda s: s["after_s"] < 1.0
    )
    assert seen["after_s"] > -0.25  # the picture may have been begun before
