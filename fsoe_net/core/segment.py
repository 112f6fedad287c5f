"""The emulated EtherCAT segment of the C library: SubDevices of a plan that answer frames."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields

from fsoe_net.core.core import CorePlan
from fsoe_net.core.module import compiled, raise_status
from fsoe_net.errors import EnvironmentFault

_WANTED = {
    errno.EINVAL: "priorities are 1 … 99, and the CPU must exist",
    errno.EMSGSIZE: "EtherCAT frames need an MTU of 1500: ip link set IF mtu 1500",
    errno.EADDRINUSE: "another emulation answers there; end that one first",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class AlStatus:
    """AL status of a SubDevice: state word, error flag, AL status code."""

    state: str
    error: bool
    code: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentCounts:
    """Counters of a segment; see ``struct fsn_segment_counts``."""

    frames: int
    datagrams: int
    lost: int
    foreign: int
    unsent: int
    send_errno: int
    work_ns: int


def sum_counts(counts: Iterable[SegmentCounts]) -> SegmentCounts:
    """Return the combined results of several segments; the error is the first one."""
    rows = list(map(asdict, counts))
    sums = {name: sum(row[name] for row in rows) for name in rows[0]}
    sums["send_errno"] = next((e for row in rows if (e := row["send_errno"])), 0)
    return SegmentCounts(**sums)


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentLink:
    """Where and how a segment answers.

    ``interface2``, if any, is the second port of the MainDevice and closes a ring. ``priority`` is
    a SCHED_FIFO priority, 0 for the normal scheduler; ``cpu`` counts from 0, ``None`` for any.
    ``no_machine_on_this_wire`` confirms that no machine is connected to real interfaces; only a
    test rig accepts them.
    """

    interface: str
    interface2: str | None = None
    priority: int = 0
    cpu: int | None = None
    no_machine_on_this_wire: bool = False

    @property
    def interfaces(self) -> list[str]:
        """The names of its interfaces."""
        return [n for n in (self.interface, self.interface2) if n is not None]

    def __str__(self) -> str:
        return " and ".join(map(repr, self.interfaces))

    def why_refused(self, code: int) -> str:
        """Return the meaning of a system error for the segment, and the next step."""
        if code != errno.ENODEV:
            wanted = _WANTED.get(code, "raw sockets need CAP_NET_RAW, a priority CAP_SYS_NICE")
            return f"{self}: {os.strerror(code)}; {wanted}"
        there = {name for _, name in socket.if_nameindex()}
        absent = [repr(n) for n in self.interfaces if n and n not in there]
        return f"no such interface: {', '.join(absent) or self}; `ip link` lists them"


def is_test_rig() -> bool:
    """Return whether the compiled part may answer on real network interfaces.

    Raises:
        CoreMissing: The compiled part is missing.
    """
    _, lib = compiled()
    return bool(lib.fsn_segment_test_rig())


_STATES = {0: "absent", 1: "INIT", 2: "PREOP", 3: "BOOT", 4: "SAFEOP", 8: "OP"}


class Segment:
    """SubDevices of a plan in ring order; a context manager that ends the link.

    Args:
        plan: The plan; kept alive by the segment.

    Raises:
        CoreMissing: The compiled part is missing.
    """

    def __init__(self, plan: CorePlan) -> None:
        self._ffi, self._lib = compiled()
        slot = self._ffi.new("struct fsn_segment **")
        raise_status(self._lib.fsn_segment_create(plan._pointer, slot), "segment")
        self._pointer = self._ffi.gc(slot[0], self._lib.fsn_segment_free)
        self._plan = plan
        self._buffers = [self._ffi.new("uint8_t[]", max(1, n)) for n in plan.sm_sizes]

    def __enter__(self) -> Segment:
        """Return the segment itself."""
        return self

    def __exit__(self, *_: object) -> None:
        self.unlink()

    @property
    def size(self) -> int:
        """SubDevices on the ring, including couplers at free positions."""
        return int(self._lib.fsn_segment_size(self._pointer))

    @property
    def sm_count(self) -> int:
        """Sync managers of the plan."""
        return len(self._plan.sm_sizes)

    @property
    def names(self) -> frozenset[str]:
        """Names of the SubDevices of the plan."""
        return frozenset(self._plan.subdevice_names)

    def position(self, subdevice: str) -> int:
        """Return the ring position of a SubDevice.

        Raises:
            ValueError: Unknown SubDevice.
        """
        number = self._plan.subdevice_names.index(subdevice)
        return int(self._lib.fsn_segment_position(self._pointer, number))

    def frame(self, data: bytes, now_ns: int) -> bytes | None:
        """Pass one Ethernet frame through; return the answer, or ``None`` if there is none."""
        buffer = self._ffi.new("uint8_t[]", data)
        size = self._lib.fsn_segment_frame(self._pointer, buffer, len(data), now_ns)
        return bytes(self._ffi.buffer(buffer, size)) if size else None

    def set_ring(self, ring: bool) -> None:
        """Connect the last SubDevice to a second port of the MainDevice, or remove that cable."""
        self._lib.fsn_segment_set_ring(self._pointer, ring)

    def frame_from(self, port: int, data: bytes, now_ns: int) -> tuple[bytes, int] | None:
        """Pass a frame in at port 0 or 1; return the answer and the port where it leaves."""
        buffer = self._ffi.new("uint8_t[]", data)
        out = self._ffi.new("uint32_t *")
        size = self._lib.fsn_segment_frame_from(self._pointer, port, buffer, len(data), now_ns, out)
        return (bytes(self._ffi.buffer(buffer, size)), int(out[0])) if size else None

    def idle(self, now_ns: int) -> None:
        """Advance the watchdogs to a time without a frame."""
        self._lib.fsn_segment_idle(self._pointer, now_ns)

    def read_outputs(self, sm: int) -> bytes:
        """Return the newest outputs of a sync manager by its number in the plan.

        Raises:
            CoreError: The sync manager is not an output.
        """
        size, buffer = self._plan.sm_sizes[sm], self._buffers[sm]
        status = self._lib.fsn_segment_read_outputs(self._pointer, sm, buffer, size, self._ffi.NULL)
        raise_status(status, f"outputs of sync manager {sm}")
        return bytes(self._ffi.buffer(buffer, size))

    def write_inputs(self, sm: int, data: bytes) -> None:
        """Publish the inputs of a sync manager, all at once.

        Raises:
            CoreError: The sync manager is not an input, or has another length.
        """
        status = self._lib.fsn_segment_write_inputs(self._pointer, sm, data, len(data))
        raise_status(status, f"inputs of sync manager {sm}")

    def al_status(self, position: int) -> AlStatus:
        """Return the AL status of the SubDevice at a ring position."""
        code = self._ffi.new("uint16_t *")
        status = self._lib.fsn_segment_al_status(self._pointer, position, code)
        return AlStatus(state=_STATES[status & 15], error=bool(status & 16), code=code[0])

    def set_present(self, position: int, present: bool) -> None:
        """Unplug or reconnect the SubDevice at a ring position, with all following ones."""
        self._lib.fsn_segment_set_present(self._pointer, position, present)

    def power_cycle(self, position: int) -> None:
        """Switch the SubDevice at a ring position off and on."""
        self._lib.fsn_segment_power_cycle(self._pointer, position)

    def set_link(self, position: int | None, up: bool) -> None:
        """Cut or restore the cable after a SubDevice; ``None`` for the one from the MainDevice.

        Raises:
            CoreError: Unknown cable.
        """
        number = self._lib.FSN_NONE if position is None else position
        raise_status(self._lib.fsn_segment_set_link(self._pointer, number, up), "cable")

    def rx_errors(self, position: int, port: int, errors: int) -> None:
        """Count receive errors at port 0 (towards the MainDevice) or 1.

        Raises:
            CoreError: Unknown SubDevice or port.
        """
        status = self._lib.fsn_segment_rx_errors(self._pointer, position, port, errors)
        raise_status(status, f"receive errors at port {port}")

    def swap(self, one: int, other: int) -> None:
        """Exchange two SubDevices; all other calls still use their former positions.

        Raises:
            CoreError: Unknown SubDevices.
        """
        raise_status(self._lib.fsn_segment_swap(self._pointer, one, other), "swap")

    def set_identity(self, position: int, identity: tuple[int, int, int] | None) -> None:
        """Set vendor, product code and revision from the next power-on; ``None``: its own.

        Raises:
            CoreError: Unknown SubDevice.
        """
        pointer = self._ffi.NULL
        if identity is not None:
            pointer = self._ffi.new("struct fsn_segment_identity *")
            pointer.vendor_id, pointer.product_code, pointer.revision = identity
        status = self._lib.fsn_segment_set_identity(self._pointer, position, pointer)
        raise_status(status, "identity")

    def set_sdo_abort(self, position: int, index: int, sub: int | None, code: int) -> None:
        """Abort SDO transfers of an object, or of all its entries for ``None``; code 0 ends this.

        Raises:
            CoreError: Unknown SubDevice, or 16 of its objects are already aborted.
        """
        number = self._lib.FSN_NONE if sub is None else sub
        status = self._lib.fsn_segment_set_sdo_abort(self._pointer, position, index, number, code)
        raise_status(status, f"abort of 0x{index:04x}")

    def set_object(self, position: int, index: int, sub: int, data: bytes) -> None:
        """Set the value of an object that CoE reads, now and after every power-on.

        Raises:
            CoreError: Unknown SubDevice, or the length differs from the existing one.
        """
        status = self._lib.fsn_segment_set_object(
            self._pointer, position, index, sub, data, len(data)
        )
        raise_status(status, f"object 0x{index:04x}:{sub:02x}")

    def offer_object(self, position: int, index: int, sub: int, data: bytes) -> None:
        """Set an object like `set_object`; a newly added object can also be written through CoE.

        Raises:
            CoreError: Unknown SubDevice, or the length differs from the existing one.
        """
        status = self._lib.fsn_segment_offer_object(
            self._pointer, position, index, sub, data, len(data)
        )
        raise_status(status, f"object 0x{index:04x}:{sub:02x}")

    def get_object(self, position: int, index: int, sub: int, size: int) -> bytes:
        """Return the current value of an object of this length.

        Raises:
            CoreError: Unknown SubDevice or object, or another length.
        """
        buffer = self._ffi.new("uint8_t[]", max(1, size))
        status = self._lib.fsn_segment_get_object(self._pointer, position, index, sub, buffer, size)
        raise_status(status, f"object 0x{index:04x}:{sub:02x}")
        return bytes(self._ffi.buffer(buffer, size))

    def set_clock_bits(self, position: int, bits: int) -> None:
        """Set the width of distributed clock times to 32 or 64 bits.

        Raises:
            CoreError: Unknown SubDevice, or another number of bits.
        """
        status = self._lib.fsn_segment_set_clock_bits(self._pointer, position, bits)
        raise_status(status, f"clock of {bits} bits")

    def set_mailbox_delay(self, position: int, delay_ns: int) -> None:
        """Delay mailbox answers.

        Raises:
            CoreError: Unknown SubDevice.
        """
        status = self._lib.fsn_segment_set_mailbox_delay(self._pointer, position, delay_ns)
        raise_status(status, "mailbox delay")

    def set_al_delay(self, position: int, delay_ns: int) -> None:
        """Delay AL state transitions.

        Raises:
            CoreError: Unknown SubDevice.
        """
        status = self._lib.fsn_segment_set_al_delay(self._pointer, position, delay_ns)
        raise_status(status, "delay of AL states")

    def lose(self, frames: int) -> None:
        """Lose the next frames."""
        self._lib.fsn_segment_lose(self._pointer, frames)

    def lose_every(self, frames: int) -> None:
        """Lose every n-th frame; 0 for none."""
        self._lib.fsn_segment_lose_every(self._pointer, frames)

    def set_delay(self, delay_ns: int) -> None:
        """Delay frames on the interface; 0 for no delay."""
        self._lib.fsn_segment_set_delay(self._pointer, delay_ns)

    def stall(self, duration_ns: int) -> None:
        """Hold all frames on the interface for a time; they are sent afterwards."""
        self._lib.fsn_segment_stall(self._pointer, duration_ns)

    def repeat(self, frames: int) -> None:
        """Keep the next answer and send it again after each of the given number of further ones."""
        self._lib.fsn_segment_repeat(self._pointer, frames)

    def counts(self) -> SegmentCounts:
        """Return the counters of the segment."""
        c = self._ffi.new("struct fsn_segment_counts *")
        self._lib.fsn_segment_counts(self._pointer, c)
        return SegmentCounts(**{f.name: getattr(c, f.name) for f in fields(SegmentCounts)})

    def link(self, link: SegmentLink) -> None:
        """Answer on one or two veth or tap interfaces, in a thread, until `unlink`.

        Raises:
            EnvironmentFault: The interface is unknown or not virtual, or permission is missing.
        """
        # The structure contains only addresses, so the names must stay alive as long as it does.
        first = self._ffi.new("char[]", link.interface.encode())
        second = self._ffi.NULL
        if link.interface2 is not None:
            second = self._ffi.new("char[]", link.interface2.encode())
        options = self._ffi.new("struct fsn_segment_link_options *")
        options.interface, options.interface2 = first, second
        options.priority = link.priority
        # In C, 0 means any CPU.
        options.cpu = 0 if link.cpu is None else link.cpu + 1
        options.no_machine_on_this_wire = link.no_machine_on_this_wire
        error = self._ffi.new("int *")
        status = self._lib.fsn_segment_link(self._pointer, options, error)
        if status == self._lib.FSN_E_ARG:
            kinds = "is not a veth or tap interface"
            if link.interface2 is not None:
                kinds = "are not two veth or tap interfaces"
            raise EnvironmentFault(
                f"{link} {kinds}; emulated SubDevices answer on no other, lest they meet a real "
                "machine: ip link add veth0 type veth peer name veth1"
            )
        if status and error[0]:
            raise EnvironmentFault(link.why_refused(error[0]))
        raise_status(status, f"link to {link}")

    def unlink(self) -> None:
        """End the link; may be called at any time."""
        self._lib.fsn_segment_unlink(self._pointer)
