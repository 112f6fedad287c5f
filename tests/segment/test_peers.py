"""MainDevices nobody here wrote bring an emulated network to OP, and FSoE to Data over the wire."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
REQUIRED = "peers" in os.environ.get("FSN_REQUIRE", "").split(",")
# A MainDevice takes a frame for lost after milliseconds; on a busy machine it gives up at times.
ATTEMPTS = 4
# A network namespace of its own, as root or as an ordinary user where the system lets it.
NAMESPACE = ["unshare", "-n"] if os.geteuid() == 0 else ["unshare", "-rn"]


def missing(package):
    """Return why the test cannot run, or an empty text."""
    if importlib.util.find_spec(package) is None:
        return f"{package} is not installed: pip install -e '.[peers]'"
    if shutil.which("unshare") is None or shutil.which("ip") is None:
        return "unshare and ip are needed for a network namespace"
    done = subprocess.run(
        [*NAMESPACE, "ip", "link", "add", "near", "type", "veth", "peer", "name", "far"],
        capture_output=True,
        text=True,
        check=False,
    )
    return "" if done.returncode == 0 else f"no network namespace with veth: {done.stderr.strip()}"


def run(peer, package, network):
    why = missing(package)
    if why:
        (pytest.fail if REQUIRED else pytest.skip)(why)
    for _ in range(ATTEMPTS):
        done = subprocess.run(
            [*NAMESPACE, sys.executable, str(ROOT / "tests/segment/peers.py"), peer, network],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode == 0:
            # KickCAT writes to standard output as well, at times only when it ends.
            return json.loads(next(n for n in done.stdout.splitlines() if n.startswith("{")))
    pytest.fail(f"{ATTEMPTS} times: {done.stderr}")


@pytest.mark.parametrize(("peer", "package"), [("soem", "pysoem"), ("kickcat", "kickcat")])
@pytest.mark.parametrize("cabling", ["ring", "gap"])
def test_redundancy(peer, package, cabling):
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
