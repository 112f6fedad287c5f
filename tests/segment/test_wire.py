"""A segment on veth pairs answers raw frames; the checks are in wire.py."""

import subprocess
import sys

import pytest
from segment.test_peers import EXAMPLES, NAMESPACE, ROOT, missing


@pytest.mark.parametrize("check", ["ring", "realtime", "faults"])
def test_on_the_wire(check):
    why = missing("json")
    if why:
        pytest.skip(why)
    network = str(EXAMPLES / "estop" / "network.yaml")
    done = subprocess.run(
        [*NAMESPACE, sys.executable, str(ROOT / "tests/segment/wire.py"), check, network],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
