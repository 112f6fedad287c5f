"""The page of a safety function says which safe bits of which frames carry it."""

from __future__ import annotations

from pathlib import Path

from networks import EXAMPLES, resolved
from report.made import BASE

from fsoe_net.compare.diff_safety import compare_functions
from fsoe_net.document.model import Number, Table, Text, Verdict
from fsoe_net.model.safety import SafeBit, SafetyElement, SafetyFunction
from fsoe_net.report.section_safe_bits import safe_bits


def rows(path: Path, **bits: tuple[SafeBit, ...]) -> list[list[str]]:
    """Return the cells of the table of the first function, with these bits at its SubDevices."""
    resolution = resolved(path)
    function = resolution.network.safety_functions[0]
    elements = tuple(with_bits(e, bits) for e in function.elements)
    stated = SafetyFunction(name=function.name, elements=elements)
    _, table = safe_bits(stated, resolution.connections)
    assert isinstance(table, Table)
    assert all(len(row) == len(table.columns) for row in table.rows)
    return [[" ".join(map(shown, cell)) for cell in row] for row in table.rows]


def with_bits(e: SafetyElement, bits: dict[str, tuple[SafeBit, ...]]) -> SafetyElement:
    return SafetyElement(kind=e.kind, name=e.name, sub=e.sub, bits=bits.get(e.sub, e.bits))


def shown(item: object) -> str:
    assert isinstance(item, Text | Number | Verdict)
    return item.word if isinstance(item, Verdict) else item.text


def test_each_bit_has_connection_frame_byte_and_entry() -> None:
    axis = (SafeBit(bit=0, name="STO"), SafeBit(bit=9, name="brake"))
    way = "el6910-el1904 el1904 → el6910"
    assert rows(EXAMPLES / "robot-cell" / "network.yaml", axis_2=axis) == [
        # examples/el6910/devices/el1904.yaml, examples/robot-cell/devices/drive.yaml
        ["ES1 channel A", "input el1904", way, "0", "1", "0", "0x6001:01 e-stop channel A"],
        ["ES1 channel B", "input el1904", way, "1", "1", "1", "0x6001:02 e-stop channel B"],
        ["STO", "output axis_1", "el6910-axis_1 el6910 → axis_1", "0", "1", "0", "0x6640:00 STO"],
        ["SS1", "output axis_1", "el6910-axis_1 el6910 → axis_1", "1", "1", "1", "0x6650:01 SS1"],
        ["STO", "output axis_2", "el6910-axis_2 el6910 → axis_2", "0", "1", "0", "0x6640:00 STO"],
        ["brake", "output axis_2", "el6910-axis_2 el6910 → axis_2", "9", "2", "1", "padding"],
    ]


def test_bits_after_a_crc_are_counted_past_it() -> None:
    # 31 and 11 bytes: safe bytes 2 and 3 are at bytes 5 and 6 of the frame
    bits = (SafeBit(bit=16, name="a"), SafeBit(bit=31, name="b"))
    path = EXAMPLES / "el6910" / "network.yaml"
    resolution = resolved(path)
    function = resolution.network.safety_functions[1]
    elements = tuple(with_bits(e, {"drive_1": bits}) for e in function.elements)
    _, table = safe_bits(SafetyFunction(name="f", elements=elements), resolution.connections)
    assert isinstance(table, Table)
    found = [[" ".join(map(shown, cell)) for cell in row] for row in table.rows]
    assert [row[3:6] for row in found if "drive_1" in row[1]] == [
        ["16", "5", "0"],
        ["31", "6", "7"],
    ]


def test_missing_and_wrong_bits_are_named() -> None:
    wrong = (SafeBit(bit=8, name="K1"), SafeBit(bit=0, name="K2", slot=3))
    found = rows(BASE / "timed.yaml", io2=wrong)
    assert found == [
        ["not stated", "input io", "logic-io io → logic", "", "", "", ""],
        ["K1", "output io2", "logic-io2 logic → io2", "8", "in no frame", "", ""],
        ["K2", "output io2", "", "0", "in no frame", "", ""],
    ]


def test_an_element_in_the_logic_has_no_frame() -> None:
    network = resolved(BASE / "timed.yaml")
    function = network.network.safety_functions[0]
    local = tuple(
        SafetyElement(kind=e.kind, name=e.name, sub="logic" if e.sub == "io" else e.sub)
        for e in function.elements
    )  # io is renamed: its input is now at the logic
    _, table = safe_bits(SafetyFunction(name="f", elements=local), network.connections)
    assert isinstance(table, Table)
    assert [" ".join(map(shown, cell)) for cell in table.rows[0]][:2] == [
        "no FSoE frame",
        "input io",
    ]


def test_exchanged_bits_are_a_difference() -> None:
    def stated(*bits: SafeBit) -> tuple[SafetyFunction, ...]:
        elements = with_bits(output, {"io2": bits})
        return (SafetyFunction(name="f", elements=(elements,)),)

    function = resolved(BASE / "timed.yaml").network.safety_functions[0]
    (output,) = (e for e in function.elements if e.sub == "io2")
    a = stated(SafeBit(bit=0, name="K1"), SafeBit(bit=1, name="K2"))
    b = stated(SafeBit(bit=0, name="K2"), SafeBit(bit=1, name="K1", slot=0))
    assert [str(c) for c in compare_functions(a, b)] == [
        "~ safety function f changed: output io2: safe bits bit 0 K1, bit 1 K2 -> bit 0 K2, "
        "slot 0 bit 1 K1"
    ]
    assert [str(c) for c in compare_functions(stated(), a)] == [
        "~ safety function f changed: output io2: safe bits not stated -> bit 0 K1, bit 1 K2"
    ]


def test_a_function_without_ends_has_no_table() -> None:
    assert safe_bits(SafetyFunction(name="f", elements=()), ()) == []
