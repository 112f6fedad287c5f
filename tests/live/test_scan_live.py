"""A scan over a real wire: what is changed on the emulated segment is what `check` names."""

import json
import subprocess
from functools import partial

import pytest
from cli.tool import fsn
from live.on_the_wire import ESTOP, REQUIRED, ROBOT, why_not
from weekly import first
from wires import run_program

from fsoe_net.live.master import find_master

ATTEMPTS = 3  # a busy machine may stop a scan for longer than a mailbox waits


def why_no_scan():
    why = why_not()
    if why:
        return why
    told = subprocess.run([find_master(), "--help"], capture_output=True, text=True, check=False)
    return "" if "--scan" in told.stdout + told.stderr else "this fsn-master has no --scan"


def on_the_wire(case, network, *commands, tmp, good):
    why = why_no_scan()
    if why:
        (pytest.fail if REQUIRED else pytest.skip)(why)
    seen = "nothing"
    for attempt in range(ATTEMPTS):
        folder = tmp / str(attempt)
        folder.mkdir()
        done = run_program("live/scan_rig.py", case, network, *commands, cwd=folder)
        seen = done.stdout + done.stderr
        assert "Traceback (most recent" not in done.stdout
        if done.returncode == 0:
            found = json.loads(done.stdout.splitlines()[-1])
            if good(found, folder):
                return found, folder
    pytest.fail(f"{ATTEMPTS} times: {seen}")


CHANGES = {
    ESTOP: [
        ("", None, ""),
        ("fsoe-address ek1914 77", "FSN508", "ek1914 (position 0) has FSoE address 77"),
        ("fsoe-address ek1914 14;swap ek1914 el1918", "FSN503", "are exchanged"),
        ("swap ek1914 el1918;break el1918", "FSN501", "el1918 is missing"),
        (
            "heal el1918;wrong el1918 0x2 0x07703052;power-cycle el1918",
            "FSN504",
            "position 1 is",
        ),
        ("right el1918;power-cycle el1918", None, ""),
    ],
    ROBOT: [
        ("swap drive_1 drive_2", "FSN508", "drive_1 and drive_2 are exchanged"),
        ("swap drive_1 drive_2;fsoe-address el1904 102", "FSN508", "the address of el2904"),
    ],
}


def as_expected(network, seen, folder):
    for (_, code, words), check in zip(CHANGES[network], seen["checks"], strict=True):
        found = [row for row in check["found"] if row[0] != "FSN512" or code == "FSN512"]
        if [row[0] for row in found] != ([code] if code else []):
            return False
        if found and words not in found[0][1]:
            return False
    if seen["scan"][0] != 0:
        return False
    # On a busy machine a device may answer too late, and the scan says so: then it is tried again.
    rows = json.loads((folder / "found/scan.json").read_text("utf-8"))["subdevices"]
    answered = not any(row["problems"] for row in rows)
    return answered and told_by_devices(rows) == TOLD[network]


# Objects with the parameters of FSoE connections, by position: of MainInstances, of SubInstances.
TOLD = {
    ESTOP: {0: ([], [0x9001]), 1: ([0x9081], [])},
    ROBOT: {
        1: ([0x9001, 0x9011, 0x9021, 0x9031], []),
        2: ([], [0x9001]),
        3: ([], [0x9001]),
        4: ([], [0x6791]),
        5: ([], [0x6791]),
    },
}


def told_by_devices(rows):
    return {
        row["position"]: tuple(
            [c["object"] for c in row["fsoe"][key]] for key in ("connections", "given")
        )
        for row in rows
        if row["fsoe"] is not None
    }


@pytest.mark.shows("R8")
@pytest.mark.parametrize("network", first(1, [ESTOP, ROBOT]))
def test_a_change_on_the_wire_is_its_finding(network, tmp_path):
    commands = [row[0] for row in CHANGES[network]]
    seen, folder = on_the_wire(
        "steps", network, *commands, tmp=tmp_path, good=partial(as_expected, network)
    )
    assert "goes to PREOP" in seen["checks"][0]["err"]
    assert "brought to PREOP" in seen["scan"][1]
    files = folder / "found"
    done = fsn("check", "network.yaml", "--scan", "scan.json", "--format", "json", cwd=files)
    codes = {d["code"] for d in json.loads(done.stdout)["diagnostics"]}
    assert codes <= {"FSN125", "FSN232", "FSN512", "FSN406", "FSN408", "FSN411"}


def test_a_bus_in_operation_continues(tmp_path):
    def good(seen, _):
        return "no request scan" in seen["err"] or (seen["data"] and seen["found"] == [])

    seen, _ = on_the_wire("attached", ESTOP, tmp=tmp_path, good=good)
    if "no request scan" in seen["err"]:
        (pytest.fail if REQUIRED else pytest.skip)("this fsn-master has no request scan")
    assert seen["code"] == 0
    assert "no SubDevice changes its state" in seen["err"]
    assert seen["cycles"] > 0
