"""Descriptions of small buses for readers and writers: an FSoE logic and what talks to it."""

from __future__ import annotations

from fsoe_net.model import (
    DescribedCopy,
    DescribedEnd,
    DescribedSubDevice,
    Description,
    Device,
    Direction,
    Entry,
    Pdo,
    Sdo,
    SyncManager,
)


def entry(index: int, subindex: int, bits: int, name: str = "") -> Entry:
    return Entry(index=index, subindex=subindex, bits=bits, name=name)


def frame(base: int, data: int, number: int, *, named: bool = True) -> tuple[Entry, ...]:
    """A 6-byte FSoE frame on object `base`."""
    names = ("cmd", "data", "crc", "id") if named else ("",) * 4
    return (
        entry(base, 1, 8, names[0] and f"{names[0]} {number}"),
        entry(data, 1, 8, names[1] and f"{names[1]} {number}"),
        entry(base, 3, 16, names[2] and f"{names[2]} {number}"),
        entry(base, 2, 16, names[3] and f"{names[3]} {number}"),
    )


def device(vendor: int, product: int, blocks: int, sdos: tuple[Sdo, ...] = ()) -> Device:
    """A device with so many 6-byte frames each way, and two standard bytes behind them."""
    outputs = tuple(
        Pdo(index=0x1600 + n, entries=frame(0x7000 + 16 * n, 0x7001 + 16 * n, n))
        for n in range(blocks)
    )
    inputs = tuple(
        Pdo(index=0x1A00 + n, entries=frame(0x6000 + 16 * n, 0x6001 + 16 * n, n))
        for n in range(blocks)
    )
    outputs += (Pdo(index=0x17F0, entries=(entry(0xF788, 0, 8, "standard out"),)),)
    inputs += (
        Pdo(index=0x1BFF, entries=(entry(0xF100, 1, 3, "state"), entry(0, 0, 5), entry(0, 0, 8))),
    )
    return Device(
        path="",
        vendor_id=vendor,
        product_code=product,
        sync_managers=(
            SyncManager(
                index=2, direction=Direction.OUTPUT, carries=None, pdos=outputs, start_byte=0x1200
            ),
            SyncManager(
                index=3, direction=Direction.INPUT, carries=None, pdos=inputs, start_byte=0x1D00
            ),
        ),
        sdos=sdos,
    )


def copy(source: tuple[int, int, int], destination: tuple[int, int, int], bits: int):
    ends = [
        DescribedEnd(subdevice=s, sm_index=m, bit_offset=b) for s, m, b in (source, destination)
    ]
    return DescribedCopy(source=ends[0], destination=ends[1], bits=bits)


def bus(terminals: int, *, per_logic: int = 40) -> Description:
    """Logics, each with a frame for each of the terminals behind it."""
    subs: list[DescribedSubDevice] = []
    copies = []
    sdo = Sdo(index=0x8000, subindex=1, size_bytes=2, value=7)
    logic = 0
    for n in range(terminals):
        if n % per_logic == 0:
            logic = len(subs)
            made = device(2, 0x1AF63052, min(per_logic, terminals - n), (sdo,))
            subs.append(
                DescribedSubDevice(
                    name="logic" if not n else f"logic {n}",
                    position=logic,
                    device=made,
                    revision=0x120000,
                )
            )
        sub, slot = len(subs), 48 * (n % per_logic)
        made = device(2, 0x07703052, 1)
        subs.append(DescribedSubDevice(name=f"terminal {n} <ä> & co", position=sub, device=made))
        copies.append(copy((sub, 3, 0), (logic, 2, slot), 48))
        copies.append(copy((logic, 3, slot), (sub, 2, 0), 48))
    return Description(
        format="test", path="", subdevices=tuple(subs), copies=tuple(copies), cycle_us=2000
    )
