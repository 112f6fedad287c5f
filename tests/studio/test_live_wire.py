"""The live page beside a bus with cables: fsn-master on SOEM, emulated SubDevices, a browser."""

from __future__ import annotations

from pathlib import Path

import pytest
from live.on_the_wire import ESTOP, on_the_wire
from studio.browser import available


@pytest.mark.weekly
def test_a_cut_cable_is_seen_and_its_end_too(tmp_path: Path) -> None:
    available()
    seen = on_the_wire("cable", ESTOP, tmp=tmp_path, script="live/studio_rig.py")
    assert "ek1914" in seen["gone"]  # behind which the cable is cut
    assert seen["cause"] == "last Reset: SubInstance: watchdog expired"
    assert seen["verdict"].startswith("✖ fsn-master, soem on near: running, with problems")
    assert " OP ports" in seen["back"]  # with a warning for 5 s after it returned
    assert "lost and back" in seen["back"]
