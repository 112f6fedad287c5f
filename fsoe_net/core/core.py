"""Plan, emulated bus and core of the C library. Each object keeps alive the objects it uses."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from fsoe_net.core.module import compiled, fault_text, raise_status
from fsoe_net.core.monitor import direction_snapshot, parameters_of
from fsoe_net.core.snapshot import (
    ConnectionSnapshot,
    CoreEvent,
    CycleImage,
    Histogram,
    Snapshot,
    Statistics,
)
from fsoe_net.errors import CoreError, PlanFormatError
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.parameters import STATED_PARAMETERS
from fsoe_net.plan.fingerprint import Fingerprint

_MASK = (1 << 64) - 1
_STATES = tuple(ConnectionState)


class CorePlan:
    """A plan that the C core has loaded and proved."""

    cycle_ns: int
    """Bus cycle in nanoseconds; 0 if the plan does not state it."""
    subdevice_names: tuple[str, ...]
    connection_names: tuple[str, ...]
    inputs: Mapping[str, int]
    """Number of each input by name, for `Core.read_symbol`."""
    outputs: Mapping[str, int]
    """Number of each output by name, for `Core.set_output` and `Core.read_symbol`."""
    sm_sizes: list[int]
    """Process data of each sync manager in bytes; 0 if it has no place on the bus."""

    def __init__(self, pointer: Any) -> None:
        self._pointer = pointer
        ffi, lib = compiled()
        self.cycle_ns = int(lib.fsn_plan_cycle_ns(pointer))
        self.subdevice_names = self._names("subdevice")
        self.connection_names = self._names("connection")
        self.inputs, self.outputs = self._read_symbols()
        info = ffi.new("struct fsn_sm_info *")
        self.sm_sizes = []
        self._sms: dict[tuple[str, int], int] = {}
        for number in range(lib.fsn_plan_sm_count(pointer)):
            raise_status(lib.fsn_plan_sm(pointer, number, info), "sync manager")
            self.sm_sizes.append(info.size_bytes if info.registered else 0)
            self._sms.setdefault((self.subdevice_names[info.subdevice], info.index), number)

    @classmethod
    def load(cls, data: bytes) -> CorePlan:
        """Load the bytes of a `.fsnplan`.

        Raises:
            PlanFormatError: The core rejects the plan; the message names record and rule.
            CoreMissing: The compiled part is missing.
        """
        ffi, lib = compiled()
        slot = ffi.new("struct fsn_plan **")
        fault = ffi.new("struct fsn_fault *")
        if lib.fsn_plan_load(data, len(data), slot, fault):
            raise PlanFormatError(f"the core refuses this plan: {fault_text(fault)}")
        return cls(ffi.gc(slot[0], lib.fsn_plan_free))

    def parts(self) -> tuple[CorePlan, ...]:
        """Return the plan of each bus; SubDevices and sync managers follow in the same order.

        Raises:
            CoreError: Out of memory.
        """
        ffi, lib = compiled()
        found = []
        for number in range(lib.fsn_plan_bus_count(self._pointer)):
            slot = ffi.new("struct fsn_plan **")
            raise_status(lib.fsn_plan_part(self._pointer, number, slot), "part of a plan")
            found.append(CorePlan(ffi.gc(slot[0], lib.fsn_plan_free)))
        return tuple(found)

    def sync_manager(self, subdevice: str, index: int) -> int:
        """Return the record number of a sync manager.

        Raises:
            KeyError: Unknown SubDevice or sync manager.
        """
        return self._sms[subdevice, index]

    def fingerprint(self) -> Fingerprint:
        """Return the fingerprint that the core computes from the loaded tables.

        Raises:
            CoreError: Out of memory.
        """
        ffi, lib = compiled()
        made = ffi.new("struct fsn_fingerprint *")
        raise_status(lib.fsn_plan_fingerprint(self._pointer, made), "fingerprint")
        sections = {
            ffi.string(lib.fsn_fingerprint_section(n)).decode("ascii"): bytes(row).hex()
            for n, row in enumerate(made.section)
        }
        return Fingerprint(whole=bytes(made.whole).hex(), sections=sections)

    def _read_symbols(self) -> tuple[dict[str, int], dict[str, int]]:
        """Return the numbers of inputs and of outputs by name."""
        ffi, lib = compiled()
        info = ffi.new("struct fsn_symbol_info *")
        sides: tuple[dict[str, int], dict[str, int]] = {}, {}
        for number in range(lib.fsn_plan_symbol_count(self._pointer)):
            raise_status(lib.fsn_plan_symbol(self._pointer, number, info), "symbol")
            name = ffi.string(info.name).decode("utf-8", "replace")
            if sides[info.output].setdefault(name, number) != number:
                side = "outputs" if info.output else "inputs"
                raise PlanFormatError(f"two {side} of the plan have the same name")
        return sides

    def _names(self, kind: str) -> tuple[str, ...]:
        ffi, lib = compiled()
        info = ffi.new(f"struct fsn_{kind}_info *")
        read = getattr(lib, f"fsn_plan_{kind}")
        names = []
        for number in range(getattr(lib, f"fsn_plan_{kind}_count")(self._pointer)):
            raise_status(read(self._pointer, number, info), kind)
            names.append(ffi.string(info.name).decode("utf-8", "replace"))
        return tuple(names)


class EmulatedBus:
    """The sync manager buffers of a plan's SubDevices, seen from the device side."""

    def __init__(self, plan: CorePlan) -> None:
        ffi, lib = compiled()
        slot = ffi.new("struct fsn_emulated **")
        raise_status(lib.fsn_emulated_create(plan._pointer, slot), "emulated bus")
        self._plan = plan
        self._lib = lib
        # Reference counts in C keep plan and bus alive as long as needed, in whatever order the
        # garbage collector runs.
        self._pointer = ffi.gc(slot[0], lib.fsn_emulated_free)
        self._buffers = [ffi.new("uint8_t[]", max(1, size)) for size in plan.sm_sizes]
        self._views = [
            ffi.buffer(buffer, size)
            for buffer, size in zip(self._buffers, plan.sm_sizes, strict=True)
        ]
        self._null = ffi.NULL

    def read_outputs(self, sm: int) -> bytes:
        """Return the newest outputs delivered to an output sync manager, all of one cycle.

        Only one thread may read a given sync manager.

        Raises:
            CoreError: Unknown output sync manager.
        """
        view = self._views[sm] if 0 <= sm < len(self._views) else None
        if view is None:
            raise CoreError(f"sync manager {sm}: {self._range()}", self._lib.FSN_E_ARG)
        status = self._lib.fsn_emulated_read_outputs(
            self._pointer, sm, self._buffers[sm], len(view), self._null
        )
        if status:
            raise self._refusal(sm, "an output", status)
        return bytes(view)

    def write_inputs(self, sm: int, data: bytes) -> None:
        """Publish the inputs of an input sync manager, all of one cycle.

        Only one thread may write a given sync manager.

        Raises:
            CoreError: Unknown input sync manager, or wrong length.
        """
        if not 0 <= sm < len(self._views):
            raise CoreError(f"sync manager {sm}: {self._range()}", self._lib.FSN_E_ARG)
        status = self._lib.fsn_emulated_write_inputs(self._pointer, sm, data, len(data))
        if status:
            raise self._refusal(sm, f"an input of {len(data)} bytes", status)

    def set_present(self, subdevice: int, present: bool) -> None:
        """Unplug a SubDevice (by number) or plug it in again.

        Raises:
            CoreError: Unknown SubDevice.
        """
        if not 0 <= subdevice < len(self._plan.subdevice_names):
            raise CoreError(f"the plan has no SubDevice {subdevice}", self._lib.FSN_E_ARG)
        status = self._lib.fsn_emulated_set_present(self._pointer, subdevice, present)
        raise_status(status, f"SubDevice {subdevice}")

    def _range(self) -> str:
        return f"the plan has {len(self._views)}, counted from 0"

    def _refusal(self, sm: int, wanted: str, status: int) -> CoreError:
        size = self._plan.sm_sizes[sm]
        return CoreError(f"sync manager {sm} ({size} bytes) is not {wanted}", status)


class Core:
    """The C core on an emulated bus: runs single cycles or its own cyclic thread."""

    def __init__(self, plan: CorePlan, bus: EmulatedBus) -> None:
        ffi, lib = compiled()
        slot = ffi.new("struct fsn_core **")
        fault = ffi.new("struct fsn_fault *")
        ops = lib.fsn_emulated_ops()
        status = lib.fsn_core_create(plan._pointer, ops, bus._pointer, slot, fault)
        if status:
            raise CoreError(f"the core refuses to run: {fault_text(fault)}", status)
        self._plan = plan
        self._lib = lib
        self._ffi = ffi
        self._pointer = ffi.gc(slot[0], lib.fsn_core_free)
        self._image_bytes = int(lib.fsn_core_image_bytes(self._pointer))
        # C allows one consumer of events, one writer of outputs and one set-up thread at a time.
        self._events_lock = threading.Lock()
        self._outputs_lock = threading.Lock()
        self._setup_lock = threading.Lock()

    def __enter__(self) -> Core:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop the cyclic thread and release the core; may be called at any time, also twice.

        No other thread may be inside a call. Later calls raise `CoreError`.
        """
        with self._setup_lock:
            if self._pointer != self._ffi.NULL:
                pointer, self._pointer = self._pointer, self._ffi.NULL
                self._ffi.release(pointer)

    def cycle(self, now_ns: int) -> None:
        """Run one bus cycle at a given time.

        Raises:
            CoreError: The cyclic thread is running, or the core is closed.
        """
        status = self._lib.fsn_core_cycle(self._pointer, now_ns)
        if status:
            raise_status(status, "cycle")

    def cycles(self, now_ns: int, step_ns: int, count: int) -> None:
        """Run ``count`` bus cycles, the first at ``now_ns``, then every ``step_ns``.

        Raises:
            CoreError: The cyclic thread is running, or the core is closed.
        """
        for number in range(count):
            self.cycle(now_ns + number * step_ns)

    def start(self, *, cycle_ns: int = 0, priority: int = 0, cpu: int | None = None) -> None:
        """Start the cyclic thread.

        Args:
            cycle_ns: Bus cycle; 0 for that of the plan.
            priority: SCHED_FIFO priority, 0 for the normal scheduler.
            cpu: CPU to run on, from 0; ``None`` for any.

        Raises:
            CoreError: The thread is already running, the cycle is invalid, or the system denied the
                request.
        """
        options = self._ffi.new("struct fsn_thread_options *")
        options.cycle_ns, options.priority = cycle_ns, priority
        # C counts CPUs from 1 here; 0 means any CPU.
        options.cpu = 0 if cpu is None else cpu + 1
        fault = self._ffi.new("struct fsn_fault *")
        with self._setup_lock:
            status = self._lib.fsn_core_start(self._pointer, options, fault)
        if status:
            raise CoreError(f"cyclic thread not started: {fault_text(fault)}", status)

    def stop(self) -> None:
        """Stop the cyclic thread after its current cycle; may be called at any time."""
        with self._setup_lock:
            self._lib.fsn_core_stop(self._pointer)

    def snapshot(self) -> Snapshot:
        """Return a consistent snapshot of one cycle.

        Raises:
            CoreError: The cycle was faster than every attempt to read.
        """
        ffi = self._ffi
        count = len(self._plan.connection_names)
        # A separate buffer for each call: several threads may read at once.
        statistics = ffi.new("struct fsn_statistics *")
        connections = ffi.new("struct fsn_connection_status[]", max(1, count))
        raise_status(
            self._lib.fsn_core_snapshot(self._pointer, statistics, connections, ffi.NULL),
            "snapshot",
        )
        return Snapshot(
            statistics=_statistics(ffi, self._lib, statistics),
            connections=tuple(_connection(connections[n]) for n in range(count)),
        )

    def cycle_image(self) -> CycleImage:
        """Return number, counters and process image of one cycle; faster than `snapshot`.

        Raises:
            CoreError: The cycle was faster than every attempt to read.
        """
        ffi = self._ffi
        s = ffi.new("struct fsn_statistics *")
        image = ffi.new("uint8_t[]", max(1, self._image_bytes))
        raise_status(
            self._lib.fsn_core_snapshot(self._pointer, s, ffi.NULL, image),
            "snapshot",
        )
        return CycleImage(
            cycle=s.cycles,
            now_ns=s.now_ns,
            expected_wkc=s.expected_wkc,
            actual_wkc=s.actual_wkc,
            frames=_frame_counts(s),
            image=bytes(ffi.buffer(image, self._image_bytes)),
        )

    def image(self) -> bytes:
        """Return the process image of one cycle.

        Raises:
            CoreError: The cycle was faster than every attempt to read.
        """
        image = self._image()
        return bytes(self._ffi.buffer(image, self._image_bytes))

    def sm_base(self, sm: int) -> int | None:
        """Return the first byte of a sync manager in the image, or ``None`` if it has no place."""
        base = int(self._lib.fsn_core_sm_base(self._pointer, sm))
        return None if base == self._lib.FSN_NONE else base

    def stale_cycles(self, sm: int) -> int:
        """Return in how many cycles an input sync manager contained bytes of an earlier cycle.

        Raises:
            CoreError: Unknown sync manager, or the core is closed.
        """
        # The C function returns a count and no status, so it cannot reject a number.
        if self._pointer == self._ffi.NULL or not 0 <= sm < len(self._plan.sm_sizes):
            raise_status(self._lib.FSN_E_ARG, f"sync manager {sm}")
        return int(self._lib.fsn_core_stale_cycles(self._pointer, sm))

    def events(self) -> list[CoreEvent]:
        """Return the state changes since the last call."""
        event = self._ffi.new("struct fsn_event *")
        found = []
        with self._events_lock:
            while self._lib.fsn_core_event(self._pointer, event):
                found.append(
                    CoreEvent(
                        now_ns=event.now_ns,
                        connection=event.connection,
                        before=_STATES[event.before],
                        after=_STATES[event.after],
                        reset_code=event.reset_code,
                        by=("", "main", "sub")[event.by],
                        differs=_differs(event.differs),
                        parameters=parameters_of(event.parameters),
                    )
                )
        return found

    def set_output(self, symbol: int, value: int) -> None:
        """Set a standard output from the next cycle on.

        Negative values are stored in two's complement.

        Raises:
            CoreError: The symbol is unknown or an input, or its bytes belong to a copy.
            OverflowError: The value has more than 64 bits.
        """
        if not -(1 << 63) <= value < 1 << 64:
            raise OverflowError(f"{value} has more than 64 bits")
        self._check_symbol(symbol)
        with self._outputs_lock:
            status = self._lib.fsn_core_set_output(self._pointer, symbol, value & _MASK)
        raise_status(status, f"output {symbol}")

    def read_symbol(self, symbol: int) -> int:
        """Return the value of a symbol in the last cycle, zero-extended.

        Raises:
            CoreError: Unknown symbol.
        """
        self._check_symbol(symbol)
        value = self._ffi.new("uint64_t *")
        image = self._image()
        status = self._lib.fsn_core_read_symbol(self._pointer, image, symbol, value)
        raise_status(status, f"symbol {symbol}")
        return int(value[0])

    def _check_symbol(self, symbol: int) -> None:
        if not 0 <= symbol < len(self._plan.inputs) + len(self._plan.outputs):
            raise CoreError(f"the plan has no symbol {symbol}", self._lib.FSN_E_ARG)

    def _image(self) -> Any:
        ffi = self._ffi
        image = ffi.new("uint8_t[]", max(1, self._image_bytes))
        status = self._lib.fsn_core_snapshot(self._pointer, ffi.NULL, ffi.NULL, image)
        raise_status(status, "snapshot")
        return image


def _statistics(ffi: Any, lib: Any, s: Any) -> Statistics:
    read: dict[str, Callable[[Any], Any]] = {
        "int": int,
        "bool": bool,
        "Histogram": lambda h: _histogram(ffi, lib, h),
    }
    values = _frame_counts(s)
    for f in fields(Statistics):
        if f.name not in values:
            values[f.name] = read[str(f.type)](getattr(s, f.name))
    return Statistics(**values)


def _frame_counts(s: Any) -> dict[str, Any]:
    return {name: getattr(s.counts, name) for name in dir(s.counts)}


def _histogram(ffi: Any, lib: Any, h: Any) -> Histogram:
    def percentile(per_million: int) -> int:
        return int(lib.fsn_histogram_percentile(ffi.addressof(h), per_million))

    times = ffi.unpack(h.bucket, len(h.bucket)) if h.count else ()
    return Histogram(
        count=h.count,
        sum_ns=h.sum_ns,
        min_ns=h.min_ns,
        p50_ns=percentile(500_000),
        p99_ns=percentile(990_000),
        p999_ns=percentile(999_000),
        max_ns=h.max_ns,
        buckets=tuple((int(lib.fsn_histogram_floor(n)), k) for n, k in enumerate(times) if k),
    )


def _connection(c: Any) -> ConnectionSnapshot:
    return ConnectionSnapshot(
        state=_STATES[c.observed],
        to_sub=direction_snapshot(c.direction[0]),
        to_main=direction_snapshot(c.direction[1]),
        gaps=c.gaps,
        observed=parameters_of(c.parameters),
        differs=_differs(c.differs),
    )


def _differs(bits: int) -> tuple[str, ...]:
    return tuple(name for bit, name in enumerate(STATED_PARAMETERS) if bits >> bit & 1)
