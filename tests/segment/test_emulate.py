"""`fsoe-net emulate`: what it refuses, and a network that nobody talks to."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from cli.tool import fsn
from segment.test_peers import NAMESPACE, missing

from fsoe_net.core import Segment
from fsoe_net.run import SegmentSession, counted_session_ids

ROOT = Path(__file__).parents[2]
ESTOP = str(ROOT / "examples" / "estop" / "network.yaml")


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ([ESTOP], 2, "--interface"),
        ([ESTOP, "--interface", "lo"], 3, "lo"),
        ([ESTOP, "--interface", "no-such-interface"], 3, "is no veth or tap interface"),
        ([ESTOP, "--interface", "x" * 300], 3, "is no veth or tap interface"),
        (["absent.yaml", "--interface", "lo"], 1, "nothing started"),
    ],
)
def test_refusals(arguments, code, message):
    done = fsn("emulate", *arguments)
    assert done.returncode == code, done.stderr
    assert message in done.stderr


def test_nobody_speaks():
    why = missing("json")
    if why:
        pytest.skip(why)
    script = (
        "ip link add near type veth peer name far; ip link set near up; ip link set far up;"
        f"exec {sys.executable} -m fsoe_net.cli emulate {ESTOP} --interface far --duration 0.2"
    )
    done = subprocess.run(
        [*NAMESPACE, "sh", "-c", script + " --format json"],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 1
    assert "EMULATION of 2 SubDevices on far" in done.stderr
    document = json.loads(done.stdout)
    assert document["states"]["ek1914"] == {"state": "INIT", "error": False, "code": 0}
    assert document["connections"] == {"el1918-ek1914": "reset"}
    assert document["passed"] is False


def test_frames_in_memory():
    """A broadcast read counts both SubDevices; unplugging the second leaves one."""
    from networks import example

    from fsoe_net.plan import compile_plan

    resolution = example("estop")
    session = SegmentSession(
        resolution, compile_plan(resolution).to_bytes(), None, session_ids=counted_session_ids()
    )
    segment: Segment = session.segment
    head = bytes.fromhex("ffffffffffff 010101010101 88a4 0d10")
    read = head + bytes.fromhex("07 00 0000 0000 0100 0000 00 0000")
    assert segment.frame(read, 1)[-2:] == b"\2\0"
    assert segment.position("el1918") == 1
    segment.set_present(1, False)
    assert segment.frame(read, 2)[-2:] == b"\1\0"
    assert segment.al_status(1).state == "absent"
    assert segment.frame(b"nothing", 3) is None
    assert (segment.counts().frames, segment.counts().foreign) == (2, 1)
