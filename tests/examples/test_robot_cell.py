"""The robot cell as it is started by `make robot-cell`: an e-stop while both axes move."""

import csv
import json
import os
import shutil
import struct
from collections import deque
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from xml.etree import ElementTree

import pytest
from networks import EXAMPLES
from uncounted import not_counted
from wires import missing, run_program

from fsoe_net.errors import FsnError
from fsoe_net.live.master import find_master

CELL = EXAMPLES / "robot-cell"
REQUIRED = "live" in os.environ.get("FSN_REQUIRE", "").split(",")
NOP, LRW = 0, 12
ATTEMPTS = 3  # of a real-time run beside other work


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the folder of a run, and what it printed."""
    why = missing()
    if not why and shutil.which("dumpcap") is None:
        why = "needs dumpcap (package tshark of Debian)"
    try:
        find_master()
    except FsnError as fault:
        why = str(fault)
    if why:
        (pytest.fail if REQUIRED else pytest.skip)(why)
    said = []
    for _ in range(ATTEMPTS):
        folder = tmp_path_factory.mktemp("cell")
        with not_counted():  # counting makes the emulated drives too slow for real time
            done = run_program("examples/cell_rig.py", folder)
        if done.returncode == 0:
            return folder, done.stdout
        said.append(done.stdout + done.stderr)
        # What must never be, however busy the machine is, is never tried again.
        for never in ("moved before the restart", "frames sent that are not"):
            assert not [x for x in done.stdout.splitlines() if x.startswith("FAIL") and never in x]
    pytest.fail("\n".join(said))


def test_the_e_stop_takes_the_torque_and_nothing_moves_until_the_restart(played):
    lines = [line for line in played[1].splitlines() if line.startswith(("ok", "FAIL"))]
    assert len(lines) == 7
    assert all(line.startswith("ok") for line in lines)


def test_every_frame_of_every_cycle_is_the_one_that_came(played):
    with (played[0] / "motion.csv").open() as file:
        rows = [[float(word) for word in row] for row in csv.reader(file)]
    assert len(rows) > 1000
    assert {row[1] for row in rows} == {0.0}


def datagrams(frame: bytes) -> Iterator[tuple[int, int, bytes, int]]:
    """Yield command, address, data and working counter of the datagrams of an EtherCAT frame."""
    place, more = 16, True
    while more:
        command, _, address, length, _ = struct.unpack_from("<BBIHH", frame, place)
        place, more = place + 10, bool(length & 0x8000)
        length &= 0x7FF
        (counter,) = struct.unpack_from("<H", frame, place + length)
        yield command, address, frame[place : place + length], counter
        place += length + 2


def packets(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield second, microsecond and bytes of the packets of a pcap file of this machine."""
    place = 24
    while place + 16 <= len(data):
        second, microsecond, size = struct.unpack_from("=3I", data, place)
        yield second, microsecond, data[place + 16 : place + 16 + size]
        place += 16 + size


@pytest.mark.shows("R1")
def test_every_byte_of_safety_data_on_the_wire_is_the_one_that_came(played):
    """Of a listener on the cable, over start-up, motion, e-stop and restart."""
    layout = json.loads((played[0] / "layout.json").read_text("utf-8"))["layout"]
    # Of each datagram with a complete working counter, the inputs that came last, and before that.
    complete = {d["offset_bytes"]: d["expected_wkc"] for d in layout["datagrams"]}
    came: dict[int, deque[bytes]] = {start: deque(maxlen=20) for start in complete}
    copies = [(c["source_byte"], c["destination_byte"], c["size_bytes"]) for c in layout["copies"]]
    assert len(copies) == 6  # three connections
    sent = moved = 0
    number = b""  # of the newest frame: a reply to another one came too late, and does not count
    ends = [packets((played[0] / f"{end}.pcap").read_bytes()) for end in ("near", "far")]
    for *_, packet in sorted(chain(*ends)):
        if packet[12:14] != b"\x88\xa4":
            continue
        (first, _, mark, _), *rows = datagrams(packet)
        for command, address, data, counter in rows if first == NOP else ():
            if command != LRW:
                continue
            if counter:  # SubDevices have been there
                if counter == complete[address] and mark == number:
                    came[address].append(data)
                continue
            number = mark
            for source, destination, size in copies:
                if not 0 <= destination - address < len(data):
                    continue
                frame = data[destination - address :][:size]
                start = max(a for a in complete if a <= source)
                wanted = [row[source - start :][:size] for row in came[start]]
                assert frame in wanted or not any(frame), (frame.hex(), wanted)
                sent += any(frame)
                moved += wanted[-1:] == [frame]
    assert sent > 6 * 1000
    assert moved > 0.5 * sent  # the newest; a busy machine is late now and then


def test_the_picture_shows_both_axes_and_all_states(played):
    root = ElementTree.parse(played[0] / "robot-cell.svg").getroot()
    texts = {"".join(node.itertext()) for node in root.iter("{http://www.w3.org/2000/svg}text")}
    for text in ("Position, rev", "Velocity, rev/s", "Torque, N·m", "axis_1", "axis_2"):
        assert text in texts
    assert {"Operation enabled", "Quick stop active", "Switch on disabled"} <= texts
    assert {"ProcessData", "FailSafeData", "e-stop", "released", "reset", "start"} <= texts
