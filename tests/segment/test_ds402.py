"""A foreign MainDevice moves our emulated drive: the DS402 class of KickCAT, over a wire.

The wheel of KickCAT does not have that class: ``FSN_KICKCAT_TREE`` names a source tree of it.
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from wires import missing, run_program

FOLDER = Path(__file__).parent / "ds402"
ATTEMPTS = 4  # a MainDevice takes a frame for lost after milliseconds; a busy machine is later
REVOLUTION = 65536


@pytest.fixture(scope="module")
def peer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the MainDevice."""
    tree = os.environ.get("FSN_KICKCAT_TREE")
    if not tree:
        pytest.skip("set FSN_KICKCAT_TREE to a source tree of KickCAT")
    if shutil.which("cmake") is None or shutil.which("c++") is None:
        pytest.skip("cmake and a C++ compiler are needed for KickCAT")
    if why := missing():
        pytest.skip(why)
    build = tmp_path_factory.mktemp("ds402")
    for command in (
        ["cmake", "-S", FOLDER, "-B", build, f"-DKICKCAT_TREE={tree}"],
        ["cmake", "--build", build, "--target", "ds402_peer", "-j2"],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    return build / "ds402_peer"


@pytest.mark.parametrize("before", [[], ["drive-fault drive 0x2310"]], ids=["", "after a fault"])
def test_brought_to_operation_enabled_and_moved(peer: Path, before: list[str]):
    for _ in range(ATTEMPTS):
        done = run_program("segment/ds402_rig.py", peer, FOLDER / "network.yaml", *before)
        if done.returncode == 0 and json.loads(done.stdout)["stayed"]:
            break
    else:
        pytest.fail(f"{ATTEMPTS} times: {done.stdout} {done.stderr}")
    seen = json.loads(done.stdout)
    assert (seen["mode"], seen["error"]) == (8, 0)
    assert seen["furthest"] == pytest.approx(2 * REVOLUTION, rel=0.02)
    assert abs(seen["end"]) < REVOLUTION / 100
    assert seen["fastest"] > 2 * REVOLUTION
    assert seen["status_at_end"] & 0x4F == 0x40  # Switch on disabled
