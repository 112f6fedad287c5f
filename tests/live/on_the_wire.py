"""A live bus in network namespaces: a rig runs there as a program, and its facts are judged."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess

import pytest
from live.support import EXAMPLES
from patience import PATIENCE_S
from wires import attempts, missing, run_program

from fsoe_net.errors import EnvironmentFault
from fsoe_net.live.master import find_master

ESTOP = str(EXAMPLES / "estop" / "network.yaml")
ROBOT = str(EXAMPLES / "el6910" / "network.yaml")
REQUIRED = "live" in os.environ.get("FSN_REQUIRE", "").split(",")
ATTEMPTS = 4  # a busy machine may stop a MainDevice for longer than a watchdog


def why_not():
    if importlib.util.find_spec("fsoe_net.core._core") is None:
        return "the compiled core is not built"
    try:
        program = find_master()
    except EnvironmentFault as fault:
        return str(fault)
    version = subprocess.run([program, "--version"], capture_output=True, text=True, check=False)
    if "bus soem: not in this build" in version.stdout:
        return "this fsn-master has no soem: make master"
    return missing()


LIMIT_S = PATIENCE_S + 50  # of one attempt, so that a second one fits into the time-out of a test


def on_the_wire(
    case,
    *networks,
    tmp,
    good=lambda _: True,
    script="live/live_rig.py",
    cables=1,
    limit_s=LIMIT_S,
):
    why = why_not()
    if why:
        (pytest.fail if REQUIRED else pytest.skip)(why)
    seen = "nothing"
    for _ in attempts(tmp, ATTEMPTS):
        try:
            done = run_program(script, case, *networks, cwd=tmp, cables=cables, limit_s=limit_s)
        except subprocess.TimeoutExpired as e:
            seen = f"no end: {e}"
            continue
        assert "Traceback (most recent" not in done.stdout
        seen = done.stdout + done.stderr
        if done.returncode == 0:
            found = json.loads(done.stdout.splitlines()[-1])
            if good(found):
                return found
    pytest.fail(f"{ATTEMPTS} times: {seen}")
