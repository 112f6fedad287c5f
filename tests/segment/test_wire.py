"""A segment on veth pairs answers raw frames; the checks are in wire.py."""

import pytest
from wires import ROOT, missing, run_program


@pytest.mark.parametrize("check", ["ring", "realtime", "faults"])
def test_on_the_wire(check):
    why = missing()
    if why:
        pytest.skip(why)
    network = str(ROOT / "examples" / "estop" / "network.yaml")
    done = run_program("segment/wire.py", check, network, cables=2)
    assert done.returncode == 0, done.stderr
