"""Plan, emulated bus and core of the C library. Each object keeps alive what it points into."""

from __future__ import annotations

import functools
from types import TracebackType
from typing import Any

from fsoe_net.core.snapshot import (
    ConnectionSnapshot,
    CoreEvent,
    DirectionSnapshot,
    OutsideState,
    Snapshot,
    Statistics,
)
from fsoe_net.errors import CoreError, CoreMissing, PlanFormatError

__all__ = ["Core", "CorePlan", "EmulatedBus"]

_STATES = {state.value: state for state in OutsideState}


@functools.cache
def _module() -> tuple[Any, Any]:
    """Return cffi's ``ffi`` and ``lib``.

    Raises:
        CoreMissing: The compiled module is not there or does not fit this machine.
    """
    try:
        from fsoe_net.core import _core
    except ImportError as exc:
        raise CoreMissing(
            f"the compiled part of fsoe-net is missing ({exc}); run `make demo` once, or "
            "`pip install .` in the source tree. `check`, `plan` and `explain` work without it"
        ) from exc
    return _core.ffi, _core.lib


def _raise(status: int, what: str) -> None:
    if status:
        ffi, lib = _module()
        text = ffi.string(lib.fsn_status_text(status)).decode()
        raise CoreError(f"{what}: {text}", status)


def _fault_text(fault: Any) -> str:
    ffi, lib = _module()
    text = str(ffi.string(lib.fsn_status_text(fault.status)).decode())
    section = ffi.string(lib.fsn_section_name(fault.section)).decode()
    if fault.copy_index == lib.FSN_FAULT_NO_RECORD:
        return f"{section}: {text}" if fault.section else text
    return f"{section} {fault.copy_index}: {text}"


class CorePlan:
    """A plan that the C core has loaded and proved."""

    def __init__(self, pointer: Any) -> None:
        self._pointer = pointer
        ffi, lib = _module()
        self.cycle_ns: int = lib.fsn_plan_cycle_ns(pointer)
        self.subdevice_names = self._names("subdevice")
        self.connection_names = self._names("connection")
        self.symbols = {name: n for n, name in enumerate(self._names("symbol"))}
        info = ffi.new("struct fsn_sm_info *")
        self.sm_sizes: list[int] = []
        self._sms: dict[tuple[str, int], int] = {}
        for number in range(lib.fsn_plan_sm_count(pointer)):
            _raise(lib.fsn_plan_sm(pointer, number, info), "sync manager")
            self.sm_sizes.append(info.size_bytes if info.registered else 0)
            self._sms.setdefault((self.subdevice_names[info.subdevice], info.index), number)

    @classmethod
    def load(cls, data: bytes) -> CorePlan:
        """Load the bytes of a `.fsnplan`.

        Raises:
            PlanFormatError: The core refuses the plan; the message names record and rule.
            CoreMissing: The compiled part is not there.
        """
        ffi, lib = _module()
        slot = ffi.new("struct fsn_plan **")
        fault = ffi.new("struct fsn_fault *")
        if lib.fsn_plan_load(data, len(data), slot, fault):
            raise PlanFormatError(f"the core refuses this plan: {_fault_text(fault)}")
        return cls(ffi.gc(slot[0], lib.fsn_plan_free))

    def sync_manager(self, subdevice: str, index: int) -> int:
        """Return the record number of a sync manager.

        Raises:
            KeyError: No such SubDevice or sync manager.
        """
        return self._sms[subdevice, index]

    def _names(self, kind: str) -> tuple[str, ...]:
        ffi, lib = _module()
        info = ffi.new(f"struct fsn_{kind}_info *")
        read = getattr(lib, f"fsn_plan_{kind}")
        names = []
        for number in range(getattr(lib, f"fsn_plan_{kind}_count")(self._pointer)):
            _raise(read(self._pointer, number, info), kind)
            names.append(ffi.string(info.name).decode("utf-8", "replace"))
        return tuple(names)


class EmulatedBus:
    """The sync manager buffers of a plan's SubDevices, seen from the device side."""

    def __init__(self, plan: CorePlan) -> None:
        ffi, lib = _module()
        slot = ffi.new("struct fsn_emulated **")
        _raise(lib.fsn_emulated_create(plan._pointer, slot), "emulated bus")
        self._plan = plan
        self._lib = lib
        self._pointer = ffi.gc(slot[0], lambda p, _keep=plan: lib.fsn_emulated_free(p))
        self._buffers = [ffi.new("uint8_t[]", max(1, size)) for size in plan.sm_sizes]
        self._ffi_buffer = ffi.buffer

    def read_outputs(self, sm: int) -> bytes:
        """Return what the newest delivered outputs of an output sync manager are.

        Raises:
            CoreError: No output sync manager of that number.
        """
        buffer, size = self._buffers[sm], self._plan.sm_sizes[sm]
        status = self._lib.fsn_emulated_read_outputs(self._pointer, sm, buffer, size)
        if status:
            _raise(status, f"sync manager {sm}")
        return bytes(self._ffi_buffer(buffer, size))

    def write_inputs(self, sm: int, data: bytes) -> None:
        """Publish the inputs of an input sync manager, whole.

        Raises:
            CoreError: No input sync manager of that number, or wrong length.
        """
        status = self._lib.fsn_emulated_write_inputs(self._pointer, sm, data, len(data))
        if status:
            _raise(status, f"sync manager {sm}")

    def set_present(self, subdevice: int, present: bool) -> None:
        """Unplug a SubDevice (by number) or plug it in again.

        Raises:
            CoreError: No such SubDevice.
        """
        status = self._lib.fsn_emulated_set_present(self._pointer, subdevice, present)
        _raise(status, f"SubDevice {subdevice}")


class Core:
    """The C core on an emulated bus: runs single cycles, or a cyclic thread of its own."""

    def __init__(self, plan: CorePlan, bus: EmulatedBus) -> None:
        ffi, lib = _module()
        slot = ffi.new("struct fsn_core **")
        fault = ffi.new("struct fsn_fault *")
        ops = lib.fsn_emulated_ops()
        status = lib.fsn_core_create(plan._pointer, ops, bus._pointer, slot, fault)
        if status:
            raise CoreError(f"the core refuses to run: {_fault_text(fault)}", status)
        self._plan = plan
        self._lib = lib
        self._ffi = ffi
        # The core points into plan and bus: they live as long as it does.
        self._pointer = ffi.gc(slot[0], lambda p, _keep=(plan, bus): lib.fsn_core_free(p))
        self._statistics = ffi.new("struct fsn_statistics *")
        count = len(plan.connection_names)
        self._connections = ffi.new("struct fsn_connection_status[]", max(1, count))
        self._image = ffi.new("uint8_t[]", max(1, lib.fsn_core_image_bytes(self._pointer)))

    def __enter__(self) -> Core:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def cycle(self, now_ns: int) -> None:
        """Run one bus cycle at a given time.

        Raises:
            CoreError: The cyclic thread runs.
        """
        status = self._lib.fsn_core_cycle(self._pointer, now_ns)
        if status:
            _raise(status, "cycle")

    def start(self, *, cycle_ns: int = 0, priority: int = 0, cpu: int | None = None) -> None:
        """Start the cyclic thread.

        Args:
            cycle_ns: Bus cycle; 0 takes the plan's.
            priority: SCHED_FIFO priority, 0 for the normal scheduler.
            cpu: CPU to run on, from 0; ``None`` for any.

        Raises:
            CoreError: It runs already, the cycle is impossible, or the system refused.
        """
        options = self._ffi.new("struct fsn_thread_options *")
        options.cycle_ns, options.priority = cycle_ns, priority
        options.cpu = 0 if cpu is None else cpu + 1
        fault = self._ffi.new("struct fsn_fault *")
        status = self._lib.fsn_core_start(self._pointer, options, fault)
        if status:
            raise CoreError(f"cyclic thread not started: {_fault_text(fault)}", status)

    def stop(self) -> None:
        """Stop the cyclic thread after its current cycle; may be called at any time."""
        self._lib.fsn_core_stop(self._pointer)

    def snapshot(self) -> Snapshot:
        """Return a consistent picture of one cycle.

        Raises:
            CoreError: The cycle was faster than every attempt to read.
        """
        status = self._lib.fsn_core_snapshot(
            self._pointer, self._statistics, self._connections, self._image
        )
        _raise(status, "snapshot")
        count = len(self._plan.connection_names)
        return Snapshot(
            statistics=_statistics(self._statistics),
            connections=tuple(_connection(self._connections[n]) for n in range(count)),
        )

    def events(self) -> list[CoreEvent]:
        """Return the changes of state since the last call."""
        event = self._ffi.new("struct fsn_event *")
        found = []
        while self._lib.fsn_core_event(self._pointer, event):
            found.append(
                CoreEvent(
                    now_ns=event.now_ns,
                    connection=event.connection,
                    before=_STATES[event.before],
                    after=_STATES[event.after],
                    reset_code=event.reset_code,
                )
            )
        return found

    def set_output(self, symbol: int, value: int) -> None:
        """Set a standard output from the next cycle on.

        Raises:
            CoreError: No such symbol, an input, or its bytes belong to a copy.
        """
        mask = 0xFFFFFFFFFFFFFFFF
        _raise(self._lib.fsn_core_set_output(self._pointer, symbol, value & mask), "output")

    def read_symbol(self, symbol: int) -> int:
        """Return the value of a symbol in the last cycle, zero-extended.

        Raises:
            CoreError: No such symbol.
        """
        null = self._ffi.NULL
        _raise(self._lib.fsn_core_snapshot(self._pointer, null, null, self._image), "snapshot")
        value = self._ffi.new("uint64_t *")
        status = self._lib.fsn_core_read_symbol(self._pointer, self._image, symbol, value)
        _raise(status, "symbol")
        return int(value[0])


def _statistics(s: Any) -> Statistics:
    timed = sum(s.latency)
    return Statistics(
        cycles=s.cycles,
        overruns=s.overruns,
        wkc_errors=s.wkc_errors,
        bytes_copied=s.bytes_copied,
        now_ns=s.now_ns,
        latency_max_ns=s.latency_max_ns,
        latency_mean_ns=s.latency_sum_ns // timed if timed else 0,
        cycle_max_ns=s.cycle_max_ns,
        copy_max_ns=s.copy_max_ns,
        events_lost=s.events_lost,
        expected_wkc=s.expected_wkc,
        actual_wkc=s.actual_wkc,
        copies=s.copies,
        merged_copies=s.merged_copies,
        realtime=bool(s.realtime),
    )


def _direction(d: Any) -> DirectionSnapshot:
    return DirectionSnapshot(
        command=d.command,
        connection_id=d.connection_id,
        reset_code=d.reset_code,
        frames=d.frames,
        process_data=d.process_data,
        failsafe_data=d.failsafe_data,
        resets=d.resets,
        last_new_ns=d.last_new_ns,
        cycle_last_ns=d.interval_last_ns,
        cycle_min_ns=d.interval_min_ns,
        cycle_mean_ns=d.interval_sum_ns // d.intervals if d.intervals else 0,
        cycle_max_ns=d.interval_max_ns,
    )


def _connection(c: Any) -> ConnectionSnapshot:
    return ConnectionSnapshot(
        state=_STATES[c.outside],
        to_sub=_direction(c.direction[0]),
        to_main=_direction(c.direction[1]),
    )
