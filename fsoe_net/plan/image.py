"""The absolute process image that a MainDevice stack will build from a plan."""

from __future__ import annotations

from fsoe_net.dataclass import dataclass
from fsoe_net.plan.model import Plan

# IgH splits a domain into datagrams between FMMUs, at this many bytes (EC_MAX_DATA_SIZE).
MAX_DATAGRAM_BYTES = 1486


@dataclass(frozen=True, slots=True, kw_only=True)
class IghFmmu:
    """One FMMU of the domain: a whole sync manager. ``sm`` is the record number in the plan."""

    sm: int
    offset_bytes: int
    size_bytes: int
    is_output: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class IghDatagram:
    """One datagram of the domain, and the working counter with which it returns."""

    offset_bytes: int
    size_bytes: int
    working_counter: int


@dataclass(frozen=True, slots=True, kw_only=True)
class IghDomain:
    """Domain 0 as laid out by the IgH master if entries are registered in driver order."""

    fmmus: tuple[IghFmmu, ...]
    size_bytes: int
    datagrams: tuple[IghDatagram, ...]

    @property
    def working_counter(self) -> int:
        """Expected sum over all datagrams."""
        return sum(d.working_counter for d in self.datagrams)


def igh_image(plan: Plan) -> IghDomain:
    """Lay out the domain: per SubDevice first the output, then the input sync managers.

    A sync manager gets its FMMU when its first entry is registered; RxPDO entries are registered
    first. A sync manager without registered entries has no place. A datagram that reads and writes
    counts 2 for each SubDevice with outputs and 1 for each with inputs, any other 1 for each
    SubDevice.
    """
    fmmus: list[IghFmmu] = []
    end = 0
    for sub in plan.subdevices:
        numbers = range(sub.first_sm, sub.first_sm + sub.sm_count)
        in_order = sorted(numbers, key=lambda n: not plan.sync_managers[n].is_output)
        for number in in_order:
            sm = plan.sync_managers[number]
            if not sm.registered:
                continue
            fmmus.append(
                IghFmmu(
                    sm=number,
                    offset_bytes=end,
                    size_bytes=sm.size_bytes,
                    is_output=sm.is_output,
                )
            )
            end += sm.size_bytes
    return IghDomain(fmmus=tuple(fmmus), size_bytes=end, datagrams=_datagrams(plan, fmmus))


def _datagrams(plan: Plan, fmmus: list[IghFmmu]) -> tuple[IghDatagram, ...]:
    datagrams: list[list[IghFmmu]] = [[]]
    used = 0
    for fmmu in fmmus:
        # A sync manager is never split: its data would not be consistent.
        if used and used + fmmu.size_bytes > MAX_DATAGRAM_BYTES:
            datagrams.append([])
            used = 0
        datagrams[-1].append(fmmu)
        used += fmmu.size_bytes
    rows = []
    for datagram in datagrams:
        outputs = {plan.sync_managers[f.sm].subdevice for f in datagram if f.is_output}
        inputs = {plan.sync_managers[f.sm].subdevice for f in datagram if not f.is_output}
        both = bool(outputs) and bool(inputs)
        rows.append(
            IghDatagram(
                offset_bytes=datagram[0].offset_bytes if datagram else 0,
                size_bytes=sum(f.size_bytes for f in datagram),
                # Each SubDevice adds 1 for reading and 2 for writing in a datagram that does both
                # (LRW).
                working_counter=(2 * len(outputs) if both else len(outputs)) + len(inputs),
            )
        )
    return tuple(rows)


def igh_text(plan: Plan) -> str:
    """Return the output of ``ethercat domains -v`` for this plan before any data are received.

    The master prints configuration addresses as ``alias:position``; data lines end in a blank.
    """
    domain = igh_image(plan)
    lines = [
        f"Domain0: LogBaseAddr 0x00000000, Size {domain.size_bytes:3d}, "
        f"WorkingCounter {domain.working_counter}/{domain.working_counter}"
    ]
    for fmmu in domain.fmmus:
        sm = plan.sync_managers[fmmu.sm]
        sub = plan.subdevices[sm.subdevice]
        direction = "Output" if fmmu.is_output else " Input"
        lines.append(
            f"  SlaveConfig {sub.alias}:{sub.position}, SM{sm.index} ({direction}), "
            f"LogAddr 0x{fmmu.offset_bytes:08x}, Size {fmmu.size_bytes}"
        )
        for first in range(0, fmmu.size_bytes, 16):
            count = min(16, fmmu.size_bytes - first)
            lines.append("    " + "00 " * count)
    return "\n".join(lines)
