import gc
import itertools
import threading

import pytest
from core.plan_builder import Builder, Transfer
from core.rig import Rig, load
from hypothesis import given, settings
from hypothesis import strategies as st
from weekly import examples

from fsoe_net.core.core import Core, EmulatedBus
from fsoe_net.core.snapshot import bucket_end
from fsoe_net.errors import CoreError
from fsoe_net.fsoe.observed import ConnectionState

RESET = bytes([0x2A, 5, 1, 2, 7, 0])
SESSION = bytes([0x4E, 1, 1, 2, 7, 0])
FAILSAFE = bytes([0x08, 0, 1, 2, 7, 0])
PROCESS = bytes([0x36, 1, 1, 2, 7, 0])
MAIN_OUT, MAIN_IN, SUB_OUT, SUB_IN = range(4)


def frame(content: bytes) -> bytes:
    return content.ljust(8, b"\0")


@pytest.mark.shows("R1")
def test_frame_arrives_in_the_cycle_of_its_receive() -> None:
    rig = Rig()
    rig.bus.write_inputs(MAIN_IN, frame(RESET))
    assert rig.bus.read_outputs(SUB_OUT) == bytes(8)
    rig.cycle()
    assert rig.bus.read_outputs(SUB_OUT) == frame(RESET)
    assert rig.bus.read_outputs(MAIN_OUT) == bytes(9)


@pytest.mark.shows("R1", "R3")
def test_absent_subdevice_keeps_its_old_frame_whole() -> None:
    rig = Rig()
    rig.bus.write_inputs(SUB_IN, frame(PROCESS))
    rig.cycle()
    rig.bus.set_present(1, False)
    rig.bus.write_inputs(SUB_IN, frame(FAILSAFE))
    rig.cycle(2)
    assert rig.bus.read_outputs(MAIN_OUT)[:6] == PROCESS
    statistics = rig.core.snapshot().statistics
    assert (statistics.expected_wkc, statistics.actual_wkc, statistics.wkc_errors) == (6, 3, 2)
    assert [rig.core.stale_cycles(sm) for sm in range(4)] == [0, 0, 0, 2]
    rig.bus.set_present(1, True)
    rig.cycle()
    assert rig.bus.read_outputs(MAIN_OUT)[:6] == FAILSAFE


def test_states_events_and_cycle_time() -> None:
    rig = Rig()
    steps = [RESET, SESSION, FAILSAFE, PROCESS, PROCESS[:1] + b"\2" + PROCESS[2:]]
    for content in steps:
        rig.bus.write_inputs(MAIN_IN, frame(content))
        rig.bus.write_inputs(SUB_IN, frame(content))
        rig.cycle(4)
    (seen,) = rig.core.snapshot().connections
    assert seen.state is ConnectionState.DATA_PROCESS
    assert (seen.to_sub.frames, seen.to_sub.resets, seen.to_sub.reset_code) == (5, 0, 5)
    assert (seen.to_sub.process_data, seen.to_sub.failsafe_data) == (2, 1)
    assert (seen.to_sub.command, seen.to_sub.connection_id) == (0x36, 7)
    assert seen.to_sub.interval_min_ns == seen.to_sub.interval_max_ns == 4_000_000
    assert seen.to_sub.interval_mean_ns == seen.to_sub.interval_last_ns == 4_000_000
    events = rig.core.events()
    assert [e.after for e in events] == ["reset", "session", "data_failsafe", "data_process"]
    assert [e.before for e in events[1:]] == [e.after for e in events[:-1]]
    assert events[0].now_ns == 1_000_000
    assert events[0].reset_code == 5
    assert rig.core.events() == []


def test_standard_values_are_written_and_read() -> None:
    rig = Rig()
    symbols = rig.plan.outputs | rig.plan.inputs
    rig.core.set_output(symbols["main.out"], -2)
    rig.core.set_output(symbols["sub.out"], 0xA5)
    rig.bus.write_inputs(MAIN_IN, bytes(6) + b"\x34\x12")
    rig.cycle()
    assert rig.bus.read_outputs(MAIN_OUT)[6:] == b"\xfe\xff\0"
    assert rig.bus.read_outputs(SUB_OUT)[6:] == b"\x50\x0a"
    assert rig.core.read_symbol(symbols["sub.out"]) == 0xA5
    assert rig.core.read_symbol(symbols["main.out"]) == 0xFFFE
    assert rig.core.read_symbol(symbols["main.in"]) == 0x1234
    with pytest.raises(CoreError, match="closed"):
        rig.core.set_output(symbols["main.in"], 1)
    with pytest.raises(OverflowError):
        rig.core.set_output(symbols["main.out"], 1 << 64)


@pytest.mark.parametrize("number", [-1, 3, 1 << 40])
def test_numbers_out_of_range_are_core_errors(number: int) -> None:
    rig = Rig()
    calls = [
        lambda: rig.core.set_output(number, 0),
        lambda: rig.core.read_symbol(number),
        lambda: rig.bus.set_present(number, True),
        lambda: rig.bus.read_outputs(number if number != 3 else MAIN_IN),
        lambda: rig.bus.write_inputs(number if number != 3 else MAIN_OUT, bytes(9)),
        lambda: rig.core.stale_cycles(number if number != 3 else 4),
    ]
    for call in calls:
        with pytest.raises(CoreError):
            call()


def test_wrong_length_is_refused_and_changes_nothing() -> None:
    rig = Rig()
    rig.bus.write_inputs(SUB_IN, frame(PROCESS))
    for length in (0, 7, 9):
        with pytest.raises(CoreError, match=rf"8 bytes\) is not an input of {length} bytes"):
            rig.bus.write_inputs(SUB_IN, bytes(length))
    rig.cycle()
    assert rig.bus.read_outputs(MAIN_OUT)[:6] == PROCESS


def test_cycles_helper_counts_and_dates() -> None:
    rig = Rig()
    rig.core.cycles(10, 5, 4)
    statistics = rig.core.snapshot().statistics
    assert (statistics.cycles, statistics.now_ns, statistics.bytes_copied) == (4, 25, 48)
    assert statistics.latency.count == 0
    assert statistics.latency.buckets == ()


def test_close_is_idempotent_and_later_calls_are_refused() -> None:
    rig = Rig()
    with rig.core as core:
        core.start(cycle_ns=100_000)
    rig.core.close()
    rig.core.stop()
    for call in (rig.core.snapshot, rig.cycle, lambda: rig.core.set_output(0, 1)):
        with pytest.raises(CoreError):
            call()
    with pytest.raises(CoreError):
        rig.core.start(cycle_ns=100_000)
    assert rig.core.events() == []


def test_a_bus_serves_one_core_at_a_time() -> None:
    rig = Rig()
    with pytest.raises(CoreError, match="bus does not open"):
        Core(rig.plan, rig.bus)
    rig.core.close()
    Core(rig.plan, rig.bus).cycle(1)


def test_a_bus_of_another_plan_is_refused() -> None:
    rig = Rig()
    other = load(Builder(sizes=[(1, 1)]).build())
    with pytest.raises(CoreError):
        Core(other, rig.bus)


@pytest.mark.uncounted
@pytest.mark.parametrize("order", list(itertools.permutations(["plan", "bus", "core"])))
def test_any_order_of_garbage_collection(order: tuple[str, ...]) -> None:
    rig = Rig()
    parts = {"plan": rig.plan, "bus": rig.bus, "core": rig.core}
    rig.core.start(cycle_ns=50_000)
    del rig
    for name in order:
        del parts[name]
        gc.collect()


@pytest.mark.weekly
def test_reference_cycles_are_collected() -> None:
    for _ in range(50):
        rig = Rig()
        rig.core.start(cycle_ns=50_000)
        for part in (rig.plan, rig.bus, rig.core):
            part.ring = (part, rig)  # type: ignore[union-attr]
        del rig, part
    gc.collect()


def test_thread_runs_next_to_python() -> None:
    rig = Rig()
    done = threading.Event()
    torn: list[bytes] = []

    def device() -> None:
        number = 0
        while not done.is_set():
            number = number % 250 + 1
            rig.bus.write_inputs(MAIN_IN, bytes([number] * 8))
            got = rig.bus.read_outputs(SUB_OUT)[:6]
            if len(set(got)) != 1:
                torn.append(got)

    rig.core.start(cycle_ns=100_000, priority=1)
    with pytest.raises(CoreError):
        rig.core.cycle(1)
    with pytest.raises(CoreError, match="runs already"):
        rig.core.start(cycle_ns=100_000)
    thread = threading.Thread(target=device, daemon=True)
    thread.start()
    last = 0
    while last < 300:
        last = rig.core.snapshot().statistics.cycles
    done.set()
    thread.join()
    rig.core.stop()
    rig.core.stop()
    statistics = rig.core.snapshot().statistics
    assert not torn
    latency = statistics.latency
    assert sum(times for _, times in latency.buckets) == latency.count == statistics.cycles >= 300
    assert 0 <= latency.min_ns <= latency.mean_ns <= latency.max_ns
    assert latency.p50_ns <= latency.p99_ns <= latency.p999_ns <= latency.max_ns
    assert latency.buckets[0][0] <= latency.min_ns
    for h in (latency, statistics.period, statistics.work):
        shares = (h.at_most(500_000), h.at_most(990_000), h.at_most(999_000))
        assert shares == (h.p50_ns, h.p99_ns, h.p999_ns)
        assert h.buckets[-1][0] <= h.max_ns < bucket_end(h.buckets[-1][0])
    assert statistics.copy.max_ns <= statistics.work.max_ns
    rig.cycle()


@pytest.mark.parametrize("cycle_ns", [1, 999, 4_000_000_001])
def test_impossible_cycle_times(cycle_ns: int) -> None:
    rig = Rig()
    with pytest.raises(CoreError, match="1 us to 4 s"):
        rig.core.start(cycle_ns=cycle_ns)


FRAMES = st.sampled_from([6, 7, 11, 15, 31, 63, 67, 71, 127, 255])


@st.composite
def networks(draw: st.DrawFn) -> Builder:
    """Random pairs in a row of SubDevices, with gaps of 0 to 2 bytes, so that some merge."""
    count = draw(st.integers(2, 5))
    ends = draw(st.lists(st.tuples(st.integers(0, 4), st.integers(1, 4)), max_size=12))
    used_in, used_out = [0] * count, [0] * count
    pairs = []
    for a, step in ends:
        main, sub = a % count, (a + step) % count
        if main == sub:
            continue
        transfers = []
        for source, target in ((main, sub), (sub, main)):
            size, gap = draw(FRAMES), draw(st.integers(0, 2))
            used_in[source] += gap
            used_out[target] += gap
            transfers.append(Transfer(source, used_in[source], target, used_out[target], size))
            used_in[source] += size
            used_out[target] += size
        if max(*used_in, *used_out) <= 1400:
            pairs.append((transfers[0], transfers[1]))
    sizes = [(min(o + 1, 1486), min(i + 1, 1486)) for o, i in zip(used_out, used_in, strict=True)]
    return Builder(sizes=sizes, pairs=pairs)


@pytest.mark.shows("R1")
@settings(max_examples=examples(60), deadline=None)
@given(builder=networks(), data=st.data())
def test_copies_equal_a_plain_model(builder: Builder, data: st.DataObject) -> None:
    plan = load(builder.build())
    bus = EmulatedBus(plan)
    core = Core(plan, bus)
    inputs = {n: bytes(size) for n, (_, size) in enumerate(builder.sizes)}
    for number in range(3):
        absent = data.draw(st.integers(-1, len(builder.sizes) - 1))
        for n, (_, size) in enumerate(builder.sizes):
            bus.set_present(n, n != absent)
            content = data.draw(st.binary(min_size=size, max_size=size))
            bus.write_inputs(2 * n + 1, content)
            if n != absent:
                inputs[n] = content
        core.cycle(number)
        image = core.image()
        for n, (size, _) in enumerate(builder.sizes):
            expected = bytearray(size)
            for t, _connection in builder.sorted_copies():
                if t.target == n:
                    taken = inputs[t.source][t.source_byte : t.source_byte + t.size]
                    expected[t.target_byte : t.target_byte + t.size] = taken
            if n != absent:
                assert bus.read_outputs(2 * n) == bytes(expected)
            assert bytes(expected) in image
