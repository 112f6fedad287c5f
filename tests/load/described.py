"""Hypothesis: devices as the model describes them, in the part every format can hold."""

from __future__ import annotations

from hypothesis import strategies as st

from fsoe_net.model import DescribedSubDevice, Device, Direction, Entry, Pdo, Sdo, SyncManager

__all__ = ["described_devices"]

NAMES = st.text(st.characters(codec="latin-1", exclude_categories=("C", "Z")), max_size=12)


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
            carries=None,
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
