"""MainDevices nobody here wrote bring an emulated network to OP, and FSoE to Data over the wire."""

import importlib.util
import json
import os

import pytest
from wires import ROOT, missing, run_program

EXAMPLES = ROOT / "examples"
REQUIRED = "peers" in os.environ.get("FSN_REQUIRE", "").split(",")
# A MainDevice takes a frame for lost after milliseconds; on a busy machine it gives up at times.
ATTEMPTS = 4


def why_not(package):
    """Return why the test cannot run, or an empty text."""
    if importlib.util.find_spec(package) is None:
        return f"{package} is not installed: pip install -e '.[peers]'"
    return missing()


def run(peer, package, network):
    why = why_not(package)
    if why:
        (pytest.fail if REQUIRED else pytest.skip)(why)
    for _ in range(ATTEMPTS):
        done = run_program("segment/peers.py", peer, network, cables=2)
        if done.returncode == 0:
            # KickCAT writes to standard output as well, at times only when it ends.
            return json.loads(next(n for n in done.stdout.splitlines() if n.startswith("{")))
    pytest.fail(f"{ATTEMPTS} times: {done.stderr}")


@pytest.mark.parametrize(("peer", "package"), [("soem", "pysoem"), ("kickcat", "kickcat")])
@pytest.mark.parametrize("cabling", ["ring", "gap"])
def test_main_device_reaches_data_over_a_ring_and_a_gap(peer, package, cabling):
    """Two cables to the segment: as a closed ring, and with a gap behind the first SubDevice."""
    seen = run(f"{peer}-{cabling}", package, str(EXAMPLES / "estop" / "network.yaml"))
    assert seen["found"] == 2
    assert set(seen["states"]) <= {8, "OP"}
    assert seen["in_data"]


@pytest.mark.parametrize(
    ("network", "sizes"),
    [
        ("estop", [[8, 8], [9, 8]]),
        ("el6910", [[0, 0], [75, 35], [6, 6], [8, 6], [46, 82], [46, 82]]),
    ],
)
@pytest.mark.parametrize(("peer", "package"), [("soem", "pysoem"), ("kickcat", "kickcat")])
def test_network_comes_up(peer, package, network, sizes):
    seen = run(peer, package, str(EXAMPLES / network / "network.yaml"))
    assert seen["found"] == len(sizes)
    assert seen["sizes"] == sizes
    assert set(seen["states"]) <= {8, "OP"}
    assert seen["in_data"]
    assert seen["foreign"] == 0
    if peer == "soem":
        assert seen["safeop"] == 4
        assert seen["good"] > 0.95
        assert seen["vendor"] == seen["identities"][-1][1]


def test_sync0_wants_clocks_that_a_person_sets():
    seen = run("clocks", "pysoem", str(EXAMPLES / "estop" / "network.yaml"))
    assert seen["unset"] == {"state": 0x14, "code": 0x002C}
    assert seen["has_clocks"]
    assert seen["set"]["state"] == 8
