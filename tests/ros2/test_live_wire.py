"""A node beside a bus with cables: fsn-master on SOEM, emulated SubDevices, Fast DDS."""

from __future__ import annotations

from pathlib import Path

from live.on_the_wire import ESTOP, ROBOT, on_the_wire
from ros2.rig import peer_program


def test_a_reset_is_an_error_within_a_second(tmp_path: Path) -> None:
    peer_program()
    seen = on_the_wire(
        "reset", ESTOP, tmp=tmp_path, script="live/ros2_rig.py", good=lambda s: s["after_s"] < 1.0
    )
    assert seen["since_s"] > -0.25  # the picture may have been begun before


def test_objects_are_read_and_written_as_ethercat_msgs_has_it(tmp_path: Path) -> None:
    """The identity is that of the device file; safety objects are never written."""
    seen = on_the_wire("objects", ROBOT, tmp=tmp_path, script="live/ros2_rig.py")
    assert seen["vendor"] == 0x22D2
    assert "0x06020000" in seen["missing"]  # ETG.1000: the object does not exist
    assert (seen["written"], seen["then"]) == ([True, False, False], 1234)


def test_hardware_status_is_that_of_the_devices(tmp_path: Path) -> None:
    """The identity is that of the slave files; a cable is cut between the two SubDevices."""
    peer_program()
    seen = on_the_wire("hardware", ESTOP, tmp=tmp_path, script="live/ros2_rig.py")
    running = seen["running"]
    assert running["ek1914"]["identity"] == ["0x00000002", "0x077a2c52"]
    assert running["el1918"]["identity"] == ["0x00000002", "0x077e3052"]
    assert [row["al"] for row in running.values()] == [[8, False, 0]] * 2
    assert [row["connectivity"] for row in running.values()] == [1, 1]
    cut = seen["cut"]["el1918"]
    assert (cut["al"], cut["health"]) == ([0, False, 0], 4)
    assert seen["ended"] in ("silent", "reset", "session")
