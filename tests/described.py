"""For readers and writers: small buses around an FSoE logic, and devices by Hypothesis."""

from __future__ import annotations

from hypothesis import strategies as st

from fsoe_net.model.bus import Device, Direction, Entry, Pdo, Sdo, SyncManager
from fsoe_net.model.description import DescribedCopy, DescribedEnd, DescribedSubDevice, Description

NAMES = st.text(st.characters(codec="latin-1", exclude_categories=("C", "Z")), max_size=12)


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
            SyncManager(index=2, direction=Direction.OUTPUT, pdos=outputs, start_byte=0x1200),
            SyncManager(index=3, direction=Direction.INPUT, pdos=inputs, start_byte=0x1D00),
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


def _entries(most_bits: int):
    gaps = st.builds(Entry, index=st.just(0), subindex=st.just(0), bits=st.integers(1, most_bits))
    plain = st.builds(
        Entry,
        index=st.integers(1, 0xFFFF),
        subindex=st.integers(0, 255),
        bits=st.integers(1, most_bits),
        type_name=st.sampled_from(["", "UINT", "BOOL"]),
        name=NAMES,
    )
    return st.lists(gaps | plain, max_size=6).map(tuple)


@st.composite
def described_devices(draw, *, most_bits: int = 255, sdos: bool = True):
    """Return a device with 0 … 4 sync managers whose PDO indices do not repeat."""
    indices = draw(st.lists(st.integers(1, 0xFFFF), min_size=6, max_size=6, unique=True))
    pdos = [Pdo(index=i, entries=draw(_entries(most_bits)), name=draw(NAMES)) for i in indices]
    count = draw(st.integers(0, 4))
    managers = tuple(
        SyncManager(
            index=n,
            direction=draw(st.sampled_from(Direction)),
            pdos=tuple(pdos.pop() for _ in range(draw(st.integers(0, 1)))),
            start_byte=draw(st.integers(0x1000, 0xFFFF)),
        )
        for n in range(count)
    )
    made = st.builds(
        lambda index, sub, size, value: Sdo(
            index=index, subindex=sub, size_bytes=size, value=value % (1 << 8 * size)
        ),
        st.integers(1, 0xFFFF),
        st.integers(0, 255),
        st.sampled_from([1, 2, 4, 8]),
        st.integers(0, 2**64 - 1),
    )
    word = st.integers(0, 0xFFFF)
    long = st.integers(1, 0xFFFFFFFF)
    return DescribedSubDevice(
        name=draw(NAMES),
        order=draw(NAMES),
        revision=draw(long),
        device=Device(
            path="",
            vendor_id=draw(long),
            product_code=draw(long),
            assign_activate=draw(word),
            sync_managers=managers,
            sdos=tuple(draw(st.lists(made, max_size=3))) if sdos else (),
        ),
        available=tuple(pdos[:2]),
    )
