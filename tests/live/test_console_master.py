"""The console and the built ``fsn-master`` on its emulated bus: leases and the end of a script."""

import pytest
from master import rig

from fsoe_net.errors import ConsoleError
from fsoe_net.live.console.console import Console
from fsoe_net.live.console.leased_client import LeasedClient

OUTPUT = "drive_1.0x6060:00"  # stop value 8


@pytest.fixture
def master():
    with rig.running() as found:
        yield found


def console_of(master, **more):
    lines = []
    link = LeasedClient(master.path, **more)
    return Console(link, lines.append, lines.append), lines


def test_outputs_stay_while_a_script_waits_and_fall_back_at_its_end(master):
    console, lines = console_of(master, lease_ms=3000)
    script = f"set {OUTPUT} 1; wait 4s; list {OUTPUT}"
    console.run_script(script, "s")
    assert lines[-1].split()[2:4] == ["1", "you"]
    assert console.owned() == [OUTPUT]
    assert not [line for line in lines if "fall" in line]
    console.link.close()
    with master.client() as other:
        other.wait_for(OUTPUT, 8)


def test_start_stop_restart(master):
    console, lines = console_of(master)
    console.run_script("start; stop; stop; start; restart; start for 5s", "s")
    assert lines == [
        "already running",
        *("stopped", "already stopped", "running", "running", "already running"),
    ]
    console.run_script("set drive_1 0x6060 1; stop; wait 20ms", "s")
    assert any(line.endswith(f"outputs have their stop values: {OUTPUT}") for line in lines[6:])
    with pytest.raises(ConsoleError, match=r"s:1:1: set: .*stopped"):
        console.run_script("set drive_1 0x6060 1", "s")
    console.link.close()


def test_a_restart_relevant_output_is_armed_first(master):
    console, lines = console_of(master)
    with pytest.raises(ConsoleError, match="arm it first"):
        console.run_script("set el6910.logic_control 1", "s")
    console.run_script("arm el6910.logic_control; set el6910.logic_control 1", "s")
    assert lines[-1] == "1 set: el6910.logic_control"
    console.run_script("state; state all; connections; snapshot; get all; events", "s")
    console.link.close()


def test_another_client_has_the_output(master):
    console, _ = console_of(master)
    with master.client() as other:
        other.good("lease 0")
        other.good(f"set {OUTPUT}=3")
        with pytest.raises(ConsoleError, match=r"s:1:1: set: .*client"):
            console.run_script(f"set {OUTPUT} 1", "s")
    console.link.close()
