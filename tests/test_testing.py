"""The doubles that users test their programs with; the tests of the page run as they stand."""

import re
import shutil
import subprocess
import sys

import pytest
from live.support import EXAMPLES, ROOT, needs_core

import fsoe_net
from fsoe_net.testing.emulated import EmulatedNetwork

PAGE = ROOT / "docs" / "howto" / "program.md"
NETWORK = EXAMPLES / "estop" / "network.yaml"
NAME = "el1918-ek1914"


@needs_core
def test_the_tests_of_the_page_pass(tmp_path):
    section = PAGE.read_text("utf-8").partition("\n## Test your program\n")[2]
    blocks = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    assert len(blocks) == 3
    shutil.copy(NETWORK, tmp_path)
    shutil.copytree(NETWORK.parent / "devices", tmp_path / "devices", dirs_exist_ok=True)
    (tmp_path / "conftest.py").write_text(blocks[0], "utf-8")
    (tmp_path / "test_page.py").write_text(blocks[2] + "\n\n" + blocks[1], "utf-8")
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", "/dev/null"]
    done = subprocess.run(
        [*words, "--rootdir", str(tmp_path), str(tmp_path)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "3 passed" in done.stdout, done.stdout + done.stderr


@needs_core
def test_time_passes_only_when_it_is_let():
    bus = EmulatedNetwork(NETWORK)
    assert (bus.now_s, bus.in_data) == (0.0, False)
    bus.advance(0)
    assert bus.now_s == 0.001
    bus.advance(0.0295)
    assert bus.now_s == 0.031
    bus.wait(lambda bus: bus.in_data)
    with pytest.raises(TimeoutError, match=r"did not hold within 0\.01 s of virtual time"):
        bus.wait(lambda bus: not bus.in_data, within_s=0.01)


@needs_core
def test_it_shows_what_a_run_shows():
    bus = EmulatedNetwork(NETWORK)
    bus.advance(1.0)
    run = fsoe_net.load(NETWORK).simulate(duration_s=1.0)
    assert bus.result().to_json("1") == run.to_json("1")


@needs_core
@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("set x 1", "this network has no input 'x'; known: ek1914.0x6001:01"),
        ("jump", "unknown command 'jump'"),
        ("cut ek1914", "cut"),
        ("set", "write: set SIGNAL VALUE"),
    ],
)
def test_a_command_that_does_not_fit_is_refused(command, said):
    bus = EmulatedNetwork(NETWORK)
    with pytest.raises(ValueError, match=re.escape(said)):
        bus.do(command)
    bus.do("")
    bus.do("break ek1914")
    bus.advance(0.3)
    assert bus.connections[NAME].state != "data_process"


def test_a_network_with_an_error_is_refused():
    with pytest.raises(fsoe_net.InputError, match="nothing started: 1 error"):
        EmulatedNetwork(EXAMPLES / "broken" / "01_direction.yaml")
