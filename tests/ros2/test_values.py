"""Which joints and topics the symbols of a plan become."""

from __future__ import annotations

import math
import re

from hypothesis import given
from hypothesis import strategies as st

from fsoe_net.live.control_values import Symbol
from fsoe_net.ros2.control import settable
from fsoe_net.ros2.values import Joint, SignalKind, find_joints, signal_topics


def symbol(name: str, kind: str = "signed", *, output: bool = False, **more: object) -> Symbol:
    subdevice, _, entry = name.partition(".")
    address = re.fullmatch(r"0x([0-9a-f]{4}):([0-9a-f]{2})", entry)
    index, subindex = (int(n, 16) for n in address.groups()) if address else (0, 0)
    row: dict[str, object] = {
        "name": name, "subdevice": subdevice, "is_output": output, "index": index,
        "subindex": subindex, "kind": kind, "bits": 1 if kind == "bool" else 32,
        "open": output, "restart_relevant": False, "stop_value": 0, "client": None, "factor": 1.0,
        "offset": 0.0,
    }  # fmt: skip
    return Symbol(**(row | more))  # type: ignore[arg-type]


def test_an_axis_is_found_by_its_objects_or_by_the_names_of_the_driver() -> None:
    found = find_joints(
        [
            symbol("a.0x6064:00"),
            symbol("a.0x606c:00"),
            symbol("a.0x6077:00"),
            symbol("b.position"),
            symbol("b.effort"),
            symbol("c.0x606c:00"),  # no position
            symbol("d.0x6064:00", output=True),  # no input
            symbol("e.pos.x"),
            symbol("f.where", index=0x6064),  # the maker of the file calls it so
            symbol("g.position", output=True),
            symbol("g.actual", index=0x6064),
        ]
    )
    assert [(joint.name, joint.position, joint.is_raw) for joint in found] == [
        ("a", "a.0x6064:00", True),
        ("b", "b.position", True),
        ("f", "f.where", True),
        ("g", "g.actual", True),
    ]


def test_a_joint_has_the_parts_that_have_a_unit() -> None:
    found = find_joints(
        [
            symbol("a.0x6064:00", factor=0.001),
            symbol("a.0x606c:00", kind="real"),
            symbol("a.0x6077:00"),  # counts
            symbol("b.position", offset=2.0),
            symbol("b.effort", factor=0.1),
        ]
    )
    assert found == (
        Joint(name="a", position="a.0x6064:00", velocity="a.0x606c:00", effort=""),
        Joint(name="b", position="b.position", velocity="", effort="b.effort"),
    )


def test_axes_of_one_subdevice_have_numbers_and_end_at_a_gap() -> None:
    names = ("0x6064:00", "0x6864:00", "0x686c:00", "0x7864:00")
    first, second = find_joints([symbol(f"leg 1.{name}", factor=0.1) for name in names])
    assert (first.name, first.position, first.velocity) == ("leg_1_1", "leg 1.0x6064:00", "")
    assert (second.name, second.velocity) == ("leg_1_2", "leg 1.0x686c:00")


def test_a_missing_value_is_nan() -> None:
    joint = Joint(name="a", position="p", velocity="", effort="e")
    position, velocity, effort = joint.values({"p": 2, "e": None})
    assert position == 2.0
    assert math.isnan(velocity)
    assert math.isnan(effort)


def test_a_topic_has_the_type_of_its_value() -> None:
    rows = signal_topics(
        [
            symbol("io.in", "bool"),
            symbol("io.count", "unsigned"),
            symbol("io.bits", "bits"),
            symbol("io.speed", "signed"),
            symbol("io.level", "signed", factor=0.5),
            symbol("io.force", "real"),
            symbol("io.out", "bool", output=True),
        ]
    )
    assert [(r.topic, r.kind.value) for r in rows] == [
        ("inputs/io/in", "Bool"),
        ("inputs/io/count", "UInt64"),
        ("inputs/io/bits", "UInt64"),
        ("inputs/io/speed", "Int64"),
        ("inputs/io/level", "Float64"),
        ("inputs/io/force", "Float64"),
        ("outputs/io/out", "Bool"),
    ]
    assert SignalKind.BOOL.python(1) is True
    assert SignalKind.SIGNED.python(None) == 0
    assert math.isnan(float(SignalKind.REAL.python(None)))


def test_a_parameter_has_the_kind_of_its_signal() -> None:
    taken = {
        kind: [kind.takes(value) is True for value in (True, 3, 0.5)]
        for kind in (SignalKind.BOOL, SignalKind.UNSIGNED, SignalKind.SIGNED, SignalKind.REAL)
    }
    assert taken == {
        SignalKind.BOOL: [True, False, False],
        SignalKind.UNSIGNED: [False, True, False],
        SignalKind.SIGNED: [False, True, False],
        SignalKind.REAL: [False, True, True],
    }


@given(st.lists(st.text(max_size=12), max_size=8))
def test_topics_are_never_the_same(names: list[str]) -> None:
    rows = signal_topics([symbol(f"{name}.x", "bool") for name in names])
    assert len({row.topic for row in rows}) == len(names)


def test_outputs_of_drives_armed_ones_and_closed_ones_cannot_be_set() -> None:
    symbols = [
        symbol("drive.0x6064:00"),
        symbol("drive.0x60fe:01", output=True),
        symbol("other.0x6040:00", output=True),
        symbol("other.0x60ff:00", output=True),
        symbol("named.run", output=True, index=0x6040),  # a controlword with a name of its own
        symbol("named.lamp", "bool", output=True),
        symbol("part.controlword", output=True),  # a part of an object
        symbol("logic.run", output=True, restart_relevant=True),
        symbol("safe.frame", output=True, open=False),
        symbol("io.lamp", "bool", output=True),
    ]
    rows = settable(signal_topics(symbols), find_joints(symbols))
    assert [row.topic for row in rows] == ["outputs/io/lamp"]
