"""Output of ``fsoe-net emulate``."""

from __future__ import annotations

import os

from fsoe_net.cli.run_output import print_events
from fsoe_net.cli.terminal import echo
from fsoe_net.core.segment import is_test_rig
from fsoe_net.diag.words import counted
from fsoe_net.errors import EnvironmentFault
from fsoe_net.simulate.emulate import EmulateResult

_BANNER = """\
############################################################################
#  TEST RIG: this build answers on REAL network interfaces.                #
#  Emulated e-stops, safety logic and drives with valid FSoE addresses.    #
#  On a machine they would act as devices that protect people.             #
#  Never connect it to one.                                                #
############################################################################"""


def check_rig(vouched: bool) -> None:
    """Print a prominent warning about a test rig, after checking that the user vouches for it.

    Raises:
        EnvironmentFault: This is not a test rig, or the user has not vouched for it.
    """
    if not is_test_rig():
        if vouched:
            raise EnvironmentFault(
                "--no-machine-on-this-wire: this is not a test rig and answers on veth and tap "
                "only; a test rig is built with -DFSN_TEST_RIG=ON"
            )
        return
    echo(_BANNER, err=True)
    if not vouched:
        raise EnvironmentFault(
            "a test rig may answer on a real interface; look at the cable, then repeat with "
            "--no-machine-on-this-wire"
        )


def print_emulation(result: EmulateResult) -> None:
    """Print how an emulation ended."""
    print_events(result.events)
    echo()
    for name, status in result.states.items():
        error = f", error 0x{status.code:04x}" if status.error else ""
        echo(f"{name:24} {status.state}{error}")
    for name, state in result.connections.items():
        echo(f"{name:24} {state.text}")
    c = result.counts
    if c.frames:
        own = f", {c.work_ns / c.frames / 1000:.1f} us each"
    else:
        own = ": no MainDevice spoke on this interface"
    echo(f"\n{counted(c.frames, 'frame')} answered{own}")
    if c.unsent:
        echo(f"{counted(c.unsent, 'answer')} could not be sent: {os.strerror(c.send_errno)}")
    # Without expectations, the reason for a failure must be derived from the states.
    if not result.verdicts and not result.passed and c.frames:
        in_op = all(status.state == "OP" for status in result.states.values())
        missing = "copied the FSoE frames between them" if in_op else "brought all of them to OP"
        echo(f"not every connection is in Data: no MainDevice has {missing}")
    for verdict in result.verdicts:
        if not verdict.held:
            echo(f"{verdict.place}: not observed: {verdict.text}; {verdict.seen}")
