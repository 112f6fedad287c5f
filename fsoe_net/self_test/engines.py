"""The C core compared with the Python engine, and its handling of damaged frames."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, NamedTuple, Protocol

from fsoe_net.project.installed import shipped
from fsoe_net.self_test.model import TriedValue, reference, reference_file

if TYPE_CHECKING:
    from fsoe_net.core.core import Core, EmulatedBus
    from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict

_WAIT_S = 30.0
_WRITES = 20_000


class _Follower(Protocol):
    @property
    def state(self) -> ConnectionState: ...

    def frame(self, direction: int, data: bytes, now_ns: int) -> CrcVerdict: ...

    def sequence(self, direction: int) -> int: ...


class _Frame(NamedTuple):
    """A recorded frame; ``known``: verdict, number in the chain and state, in words."""

    direction: int
    data: bytes
    known: str


def _recorded() -> list[_Frame]:
    rows = [line.split() for line in reference_file("estop.frames").splitlines()]
    return [
        _Frame(int(row[0] == "sub"), bytes.fromhex(row[1]), " ".join(row[3:]))
        for row in rows
        if row and row[0] in ("main", "sub")
    ]


def _followers() -> tuple[_Follower, _Follower]:
    from fsoe_net.core.monitor import Monitor
    from fsoe_net.self_test.monitor import PythonMonitor

    return PythonMonitor(1, 1), Monitor(1, 1)


def _seen(monitor: _Follower, frames: Sequence[_Frame]) -> list[str]:
    words = []
    for n, frame in enumerate(frames):
        verdict = monitor.frame(frame.direction, frame.data, n)
        number = monitor.sequence(frame.direction)
        words.append(f"{verdict} {number} {monitor.state}")
    return words


def known_conversations() -> Iterator[TriedValue]:
    """Decode a recorded run and a published start-up: every CRC right, every state as known."""
    from fsoe_net.capture.hexframes import follow_frames, parse_frames

    recorded = _recorded()
    yield TriedValue("recorded frames", reference()["recorded_frames"], len(recorded))
    lines = reference_file("estop.frames").splitlines()
    decoded = follow_frames(parse_frames(("estop.frames", line) for line in lines))
    # A missing or additional frame must also be a difference.
    for n, (frame, seen) in enumerate(zip_longest(recorded, decoded)):
        got = seen and f"{seen.verdict} {seen.sequence} {seen.state}"
        yield TriedValue(f"recorded frame {n + 1}", frame and frame.known, got)
    published = reference()["published_start_up"]
    for row in follow_frames(parse_frames([("published", " ".join(published))])):
        yield TriedValue(f"published {row.frame.data.hex()}", "RIGHT", row.verdict.name)


def core_and_python() -> Iterator[TriedValue]:
    """Let both engines judge the recorded run, unchanged and with one bit of each frame changed.

    Both also calculate the fingerprint of each plan, and the core rejects it if any byte is
    changed.
    """
    from fsoe_net.core.core import CorePlan
    from fsoe_net.errors import PlanFormatError
    from fsoe_net.network import load

    for name, known in reference()["networks"].items():
        data = load(shipped("examples") / name / "network.yaml").compile().to_bytes()
        whole = CorePlan.load(data).fingerprint().whole
        yield TriedValue(f"{name}: fingerprint by the core", known["fingerprint"], whole)
        taken = []
        for n in range(len(data)):
            try:
                CorePlan.load(data[:n] + bytes([data[n] ^ 0x01]) + data[n + 1 :])
            except PlanFormatError:
                continue
            taken.append(n)
        yield TriedValue(f"{name}: changed bytes of the plan that the core takes", [], taken)
    recorded = _recorded()
    runs = [("recorded run", recorded)]
    for n, frame in enumerate(recorded):
        bit = n % (8 * len(frame.data))
        changed = frame._replace(data=_flipped(frame.data, bit))
        what = f"recorded run, bit {bit} of frame {n + 1} changed"
        runs.append((what, [*recorded[:n], changed, *recorded[n + 1 :]]))
    for what, frames in runs:
        python, core = (_seen(follower, frames) for follower in _followers())
        yield TriedValue(what, python, core)


def _flipped(data: bytes, bit: int) -> bytes:
    """Return the bytes with one bit changed, counted from the lowest bit of the first byte."""
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def copies() -> Iterator[TriedValue]:
    """Copy frames on an emulated bus: complete and unchanged even if damaged, never torn."""
    from fsoe_net.core.core import Core, CorePlan, EmulatedBus
    from fsoe_net.network import load

    where = reference()["copy"]
    network = load(shipped("examples") / "estop" / "network.yaml")
    plan = CorePlan.load(network.compile().to_bytes())
    bus = EmulatedBus(plan)
    source = plan.sync_manager(*where["from"])
    destination = plan.sync_manager(*where["to"])
    size, inputs = where["bytes"], plan.sm_sizes[source]
    with Core(plan, bus) as core:
        frame = _recorded()[-1].data
        frames = [_flipped(frame, bit) for bit in range(8 * size)]
        for n, data in enumerate([*frames, frame]):
            bus.write_inputs(source, data.ljust(inputs, b"\xff"))
            core.cycle(n + 1)
            got = bus.read_outputs(destination)[:size].hex()
            what = "frame" if data == frame else f"frame with bit {n} changed"
            yield TriedValue(f"{what}, copied", data.hex(), got)
        before = bus.read_outputs(destination)[:size].hex()
        bus.set_present(plan.subdevice_names.index(where["from"][0]), present=False)
        bus.write_inputs(source, bytes(inputs))
        core.cycle(8 * size + 2)
        got = bus.read_outputs(destination)[:size].hex()
        yield TriedValue("frame of a SubDevice that does not answer", before, got)
        bus.set_present(plan.subdevice_names.index(where["from"][0]), present=True)
        bus.write_inputs(source, bytes(inputs))
        core.cycle(8 * size + 3)
        yield from _beside_the_cycle(core, bus, (source, destination), (inputs, size))


def _beside_the_cycle(
    core: Core, bus: EmulatedBus, places: tuple[int, int], sizes: tuple[int, int]
) -> Iterator[TriedValue]:
    """Write and read while the cyclic thread copies; all bytes of a complete frame are equal."""
    (source, destination), (inputs, size) = places, sizes
    core.start(cycle_ns=250_000)
    torn, last = 0, bytes(size)
    until = time.monotonic() + _WAIT_S
    number = 0
    # The thread may need a moment to copy the last frame.
    while number < _WRITES or (last[0] != _WRITES & 0xFF and time.monotonic() < until):
        number += 1
        value = min(number, _WRITES) & 0xFF
        bus.write_inputs(source, bytes([value]) * inputs)
        last = bus.read_outputs(destination)[:size]
        torn += len(set(last)) > 1
    core.stop()
    yield TriedValue(f"frames that arrived torn, of {_WRITES} written during the cycle", 0, torn)
    yield TriedValue("last frame", bytes([_WRITES & 0xFF]).hex() * size, last.hex())
