"""A scenario against a network: unknown names, values that fit no bits."""

from pathlib import Path

import pytest
from cli.tool import fsn
from live.support import ESTOP, ROBOT, needs_core, session_of

from fsoe_net.errors import InputError

pytestmark = needs_core


def refused(folder: Path, tmp: Path, text: str) -> list[tuple[str, str]]:
    with pytest.raises(InputError, match="does not fit this network") as caught:
        session_of(folder, text, tmp=tmp)
    assert all(d.span.line for d in caught.value.diagnostics)
    return [(d.code, d.hint) for d in caught.value.diagnostics]


STEP = "steps: [{{at_ms: 1, {}}}]\n"
EXPECT = "expect: [{{at_ms: 1, {}}}]\n"


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("initial: {ek1914.0x6001:03: 1}\n", "write ek1914.0x6001:01 or ek1914.0x6001:02"),
        ("logic: {inputs: [ek1914.0x6001:1, ek1914.0x6010:01]}\n", "write ek1914.0x6001:01"),
        ("logic: {outputs: [ek1941.0x7001:01]}\n", "write ek1914.0x7001:01"),
        (STEP.format("set: {ek1914.inputs_1: 1}"), "write ek1914.input_1"),
        (STEP.format("output: {ek1914.input_1: 1}"), "write ek1914.output_1"),
        (
            STEP.format("output: {ek1914.0x7001:01: 1}"),
            "write ek1914.0x7010:05 or ek1914.0x7010:06",
        ),
        (STEP.format("break: ek19"), "write ek1914"),
        (STEP.format("heal: zzz"), "known: ek1914, el1918"),
        (STEP.format("power_cycle: EL1918"), "write el1918"),
        (STEP.format("local_reset: ek1914-el1918"), "write el1918-ek1914"),
        (STEP.format("press: el1981"), "write el1918"),
        (EXPECT.format("connection: el1918, state: data"), "write el1918-ek1914"),
        (EXPECT.format("safe_outputs: {ek1914.0x6001:01: 1}"), "write ek1914.0x7001:01"),
    ],
)
def test_unknown_name_with_the_nearest(tmp_path: Path, text: str, hint: str):
    assert refused(ESTOP, tmp_path, text) == [("FSN116", hint)]


@pytest.mark.parametrize(
    ("folder", "text", "hint"),
    [
        (ESTOP, "initial: {ek1914.0x6001:01: 2}\n", "write 0 … 1"),
        (ESTOP, STEP.format("set: {ek1914.6001:1: -1}"), "write 0 … 1"),
        (ESTOP, STEP.format("set: {ek1914.input_1: 2}"), "write 0 … 1"),
        (ESTOP, STEP.format("output: {ek1914.output_1: 3}"), "write 0 … 1"),
        (ESTOP, EXPECT.format("safe_outputs: {ek1914.0x7001:01: 7}"), "write 0 … 1"),
        (ROBOT, STEP.format("set: {drive_1.0x6611:00: 65536}"), "write 0 … 65535"),
        (ROBOT, STEP.format("output: {drive_1.0x6071:00: 32768}"), "write -32768 … 32767"),
    ],
)
def test_value_that_fits_no_bits(tmp_path: Path, folder: Path, text: str, hint: str):
    """It would be cut off silently: an input set to 2 would read 0."""
    assert refused(folder, tmp_path, text) == [("FSN113", hint)]


def test_every_mistake_is_reported_at_its_place(tmp_path: Path):
    text = "initial:\n  a: 1\n  b: 1\nsteps:\n  - {at_ms: 1, break: c}\n"
    with pytest.raises(InputError) as caught:
        session_of(ESTOP, text, tmp=tmp_path)
    places = [(d.span.line, d.span.column) for d in caught.value.diagnostics]
    assert places == [(3, 3), (4, 3), (6, 23)]


def test_mistakes_of_every_kind_come_in_one_run(tmp_path: Path):
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text(
        "version: 1\n"
        "initial: {ek1914.0x6001:03: 1}\n"
        "steps:\n"
        "  - {at_ms: 1, press: nobody}\n"
        "  - {at_ms: -1, unplug: ek1914}\n"
        "expect:\n"
        "  - {at_ms: 1, connection: el1918-ek1914, sate: reset}\n",
        "utf-8",
    )
    network = str(ESTOP / "network.yaml")
    done = fsn("run", network, "--scenario", str(scenario), "--virtual-time")
    assert done.returncode == 1
    lines = sorted({line.split(":")[1] for line in done.stderr.splitlines() if "error[" in line})
    assert lines == ["2", "4", "5", "7"], done.stderr
