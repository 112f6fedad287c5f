"""Names for what is seen."""

from fsoe_net.capture.names import ConnectionNames
from fsoe_net.model.signals import Signal


def test_a_value_is_named_by_its_label_or_else_its_address():
    # A SubDevice may have points in its name.
    bits = [
        Signal(
            name=f"cell.ek1914.0x6001:0{n}",
            index=0x6001,
            subindex=n,
            bit=n - 1,
            bits=1,
            label=label,
        )
        for n, label in ((1, ""), (2, "STO"))
    ]
    names = ConnectionNames(
        name="logic-cell.ek1914",
        ends=("logic", "cell.ek1914"),
        signals=((), tuple(bits)),
        frame_bytes=(6, 6),
        connection_id=1,
        addresses=(frozenset(), frozenset()),
    )
    assert names.values(1, b"\x02") == "0x6001:01=0 STO=1"
