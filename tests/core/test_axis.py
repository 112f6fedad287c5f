"""The axis by CiA 402 through the compiled module, and against a drive that others have written."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fsoe_net.core.module import compiled
from fsoe_net.live.axis import AxisPhase, AxisState

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
CORE = ROOT / "master_core"
MS = 1_000_000
MOST = 50

# IEC 61800-7-201: mask and bits of the statusword in each state.
STATES = {
    AxisState.NOT_READY: (0x4F, 0x00),
    AxisState.SWITCH_ON_DISABLED: (0x4F, 0x40),
    AxisState.READY_TO_SWITCH_ON: (0x6F, 0x21),
    AxisState.SWITCHED_ON: (0x6F, 0x23),
    AxisState.OPERATION_ENABLED: (0x6F, 0x27),
    AxisState.QUICK_STOP_ACTIVE: (0x6F, 0x07),
    AxisState.FAULT_REACTION_ACTIVE: (0x4F, 0x0F),
    AxisState.FAULT: (0x4F, 0x08),
}


def state_of(word: int) -> AxisState:
    found = [state for state, (mask, bits) in STATES.items() if word & mask == bits]
    assert len(found) <= 1
    return found[0] if found else AxisState.NO_STATE


class Pure:
    """The state machine without a bus."""

    def __init__(self) -> None:
        self.ffi, self.lib = compiled()
        self.axis: Any = self.ffi.new("struct fsn_axis *")
        config = {"mode": 8, "max_step": MOST, "max_velocity": 10, "max_torque": 10}
        made = self.ffi.new("struct fsn_axis_config *", config)
        assert self.lib.fsn_axis_init(self.axis, made) == 0
        self.now_ns = 0

    def step(self, word: int, position: int, mode: int = 8, *, torque_off: bool = False) -> None:
        self.now_ns += MS
        inputs = {"statusword": word, "position": position, "mode": mode, "now_ns": self.now_ns}
        self.lib.fsn_axis_step(
            self.axis,
            self.ffi.new("struct fsn_axis_inputs *", {**inputs, "torque_off": torque_off}),
        )


def test_the_words_are_those_of_c() -> None:
    ffi, lib = compiled()
    for names, kind in ((lib.fsn_axis_state_name, AxisState), (lib.fsn_axis_phase_name, AxisPhase)):
        texts = [ffi.string(names(one.value)).decode() for one in kind]
        assert len(set(texts)) == len(kind)
        assert ffi.string(names(len(kind))) == b"?"
        for one, text in zip(kind, texts, strict=True):
            assert one.name.replace("_", " ").lower().split()[0] in text


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["enable", "enable", "disable", "quick_stop", "reset", "set", "none"]),
            st.integers(0, 0xFFFF) | st.sampled_from([0x250, 0x231, 0x233, 0x1237, 0x237]),
            st.integers(-(2**31), 2**31 - 1),
            st.sampled_from([8, 8, 8, 9, 0]),
            st.integers(0, 15).map(lambda n: n == 0),
            st.integers(-100, 100),
        ),
        max_size=60,
    )
)
@settings(deadline=None)
def test_no_target_moves_before_the_drive_is_enabled(steps: list[tuple[Any, ...]]) -> None:
    pure = Pure()
    axis, lib = pure.axis, pure.lib
    before = None
    for request, word, position, mode, torque_off, by in steps:
        done = 0
        if request == "set":
            wanted = max(-(2**31), min(2**31 - 1, axis.outputs.position + by))
            done = lib.fsn_axis_set_position(axis, wanted)
            assert done != 0 or (axis.enabled and abs(by) <= MOST)
        elif request in ("enable", "reset"):
            done = getattr(lib, f"fsn_axis_{request}")(axis)
        elif request != "none":
            getattr(lib, f"fsn_axis_{request}")(axis)
        pure.step(word, position, mode, torque_off=torque_off)
        assert AxisState(axis.state) is state_of(word)
        if not axis.enabled:
            assert axis.outputs.position == position
            before = None
            continue
        assert state_of(word) is AxisState.OPERATION_ENABLED
        assert mode == 8
        assert not torque_off
        if before is None:
            assert axis.outputs.position == position
        else:
            assert abs(axis.outputs.position - before) <= MOST
        before = axis.outputs.position


@pytest.mark.parametrize("stops_in", range(8))
def test_torque_taken_off_at_any_cycle_is_not_a_fault(stops_in: int) -> None:
    pure = Pure()
    axis, lib = pure.axis, pure.lib
    answers = {0: 0x250, 6: 0x231, 7: 0x233, 15: 0x237}
    assert lib.fsn_axis_enable(axis) == 0
    word = 0x250
    for _ in range(stops_in):
        pure.step(word, 1000)
        word = answers[axis.outputs.controlword]
    started = word != 0x250
    for cycle in range(20):
        pure.step(0x250, 1000 + cycle, torque_off=True)
        assert axis.outputs.position == 1000 + cycle
        assert axis.outputs.controlword == 0
    assert AxisPhase(axis.phase) is AxisPhase.TORQUE_OFF
    pure.step(0x250, 1000)
    assert AxisPhase(axis.phase) is AxisPhase.TORQUE_OFF
    assert lib.fsn_axis_enable(axis) == 0
    pure.step(0x250, 1000)
    assert axis.outputs.controlword == 6
    assert started or stops_in <= 1


def test_against_the_simulated_drive_of_kickcat(tmp_path: Path) -> None:
    tree = os.environ.get("FSN_KICKCAT_TREE", "")
    if not tree:
        pytest.skip("set FSN_KICKCAT_TREE to a source tree of KickCAT")
    if shutil.which("c++") is None or shutil.which("cc") is None:
        pytest.skip("no compiler for C and C++")
    include = Path(tree, "lib/simulation/include")
    assert (include / "kickcat/simulation/devices/Ds402Motor.h").is_file(), "no such drive in there"
    objects = []
    for name in ("axis", "axis_requests"):
        objects.append(tmp_path / f"{name}.o")
        source = CORE / f"src/client/{name}.c"
        own = ["-I", CORE / "include", "-I", CORE / "src"]
        run("cc", "-std=c11", "-c", *own, source, "-o", objects[-1])
    # What the drive needs of a SubDevice is ours, and comes first; the drive is theirs.
    ours = ["-I", HERE / "kickcat_axis", "-I", CORE / "include"]
    theirs = ["-isystem", Path(tree, "lib/include"), "-isystem", include]
    warnings = ["-std=c++17", "-Wall", "-Wextra", "-Werror"]
    source = HERE / "kickcat_axis/drive.cpp"
    run("c++", *warnings, *ours, *theirs, source, *objects, "-o", tmp_path / "drive")
    said = run(tmp_path / "drive").splitlines()
    assert said[0] == "enabled in 4 cycles at 250000"
    assert said[-1].startswith("good after")
    assert "after a stop by the drive: torque off, drive switch on disabled" in said


def run(*words: object) -> str:
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
