"""The facade: lifetimes, refusals, outputs; everything else is tested in C."""

from __future__ import annotations

import gc

import pytest
from networks import example

from fsoe_net.core.core import Core, CorePlan, EmulatedBus
from fsoe_net.errors import CoreError, CoreMissing, PlanFormatError
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.plan.compile import compile_plan


@pytest.fixture
def plan() -> CorePlan:
    try:
        return CorePlan.load(compile_plan(example("estop")).to_bytes())
    except CoreMissing as exc:
        pytest.skip(str(exc))


def test_names_and_sizes(plan: CorePlan):
    assert plan.subdevice_names == ("ek1914", "el1918")
    assert plan.connection_names == ("el1918-ek1914",)
    assert plan.sm_sizes[plan.sync_manager("el1918", 2)] == 9
    with pytest.raises(KeyError):
        plan.sync_manager("el1918", 9)


def test_refusal_names_record_and_rule():
    with pytest.raises(PlanFormatError, match="not a plan"):
        CorePlan.load(b"x" * 300)


def test_objects_may_die_in_any_order(plan: CorePlan):
    core = Core(plan, EmulatedBus(plan))
    core.start(cycle_ns=1_000_000)
    del plan
    gc.collect()
    assert core.snapshot().connections[0].state is ConnectionState.SILENT
    del core
    gc.collect()


@pytest.mark.shows("R1")
def test_frames_travel_in_one_cycle(plan: CorePlan):
    bus = EmulatedBus(plan)
    core = Core(plan, bus)
    source = plan.sync_manager("ek1914", 3)
    bus.write_inputs(source, bytes.fromhex("2a0086f8000000ff"))
    core.cycle(1)
    assert bus.read_outputs(plan.sync_manager("el1918", 2)).hex() == "2a0086f80000000000"
    with pytest.raises(CoreError, match="not an input of 5 bytes"):
        bus.write_inputs(source, b"short")


def test_outputs_and_inputs_by_name(plan: CorePlan):
    bus = EmulatedBus(plan)
    core = Core(plan, bus)
    core.set_output(plan.outputs["ek1914.output_3"], 1)
    core.cycle(1)
    assert bus.read_outputs(plan.sync_manager("ek1914", 2))[6] == 0b100
    assert core.read_symbol(plan.outputs["ek1914.output_3"]) == 1
    assert core.read_symbol(plan.outputs["ek1914.output_2"]) == 0
    with pytest.raises(CoreError, match="closed"):
        core.set_output(plan.inputs["ek1914.input_1"], 1)


@pytest.mark.shows("R2")
def test_no_symbol_reaches_into_a_frame(plan: CorePlan):
    assert not [
        name for name in (*plan.inputs, *plan.outputs) if "0x7000" in name or "0x7001" in name
    ]


@pytest.mark.shows("R3")
def test_missing_subdevice_shows_in_the_working_counter(plan: CorePlan):
    bus = EmulatedBus(plan)
    core = Core(plan, bus)
    core.cycle(1)
    bus.set_present(0, False)
    core.cycle(2)
    statistics = core.snapshot().statistics
    assert (statistics.wkc_errors, statistics.expected_wkc, statistics.actual_wkc) == (1, 6, 3)
    with pytest.raises(CoreError):
        bus.set_present(9, True)
