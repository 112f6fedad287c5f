"""Types, hashes and bytes of messages against `rosbags`, which nobody here wrote."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros2.rig import typestore

from fsoe_net.ros2 import messages
from fsoe_net.ros2.messages import HASHES
from fsoe_net.ros2.recording import definition, ros_name

STORE = typestore()
PUBLISHED = [m for m in HASHES if "/msg/" in ros_name(m)]
TEXTS = st.text(st.characters(min_codepoint=1, exclude_categories=["Cs"]), max_size=20)
STAMPS = st.builds(
    messages.Header,
    st.builds(messages.Stamp, st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1)),
    TEXTS,
)
FLOATS = st.lists(st.floats(width=64), max_size=5)
VALUES = st.builds(messages.KeyValue, TEXTS, TEXTS)
STATUSES = st.builds(
    messages.DiagnosticStatus, st.integers(0, 3), TEXTS, TEXTS, TEXTS, st.lists(VALUES, max_size=4)
)
SIGNALS = {
    "Bool": st.booleans(),
    "Int64": st.integers(-(2**63), 2**63 - 1),
    "UInt64": st.integers(0, 2**64 - 1),
    "Float64": st.floats(width=64),
}
BYTES, WORDS = st.integers(0, 255), st.integers(0, 65535)
DEVICES = st.builds(
    messages.HardwareDeviceStatus,
    STAMPS,
    TEXTS,
    st.lists(
        st.builds(
            messages.GenericHardwareState,
            *(BYTES, st.lists(BYTES, max_size=3), BYTES, BYTES, BYTES, TEXTS, TEXTS, TEXTS),
            st.lists(VALUES, max_size=3),
        ),
        max_size=2,
    ),
    ethercat_states=st.lists(
        st.builds(messages.EtherCatState, WORDS, TEXTS, TEXTS, BYTES, st.booleans(), WORDS),
        max_size=2,
    ),
)
DRAWN = st.one_of(
    st.builds(messages.HardwareStatus, STAMPS, TEXTS, st.lists(DEVICES, max_size=3)),
    st.builds(messages.DiagnosticArray, STAMPS, st.lists(STATUSES, max_size=4)),
    st.builds(messages.JointState, STAMPS, st.lists(TEXTS, max_size=4), FLOATS, FLOATS, FLOATS),
    *(st.builds(m, SIGNALS[kind.value]) for kind, m in messages.SIGNALS.items()),
)

ARRAYS_OF_FIELDS = dict.fromkeys(("position", "velocity", "effort"), "float64") | {
    "error_domain": "uint8"
}


def foreign(message: Any) -> Any:
    """Return the message as an object of `rosbags`."""
    if isinstance(message, list):
        return [foreign(item) for item in message]
    if not dataclasses.is_dataclass(message):
        return message
    kind = STORE.types[ros_name(type(message))]
    names = [f.name for f in dataclasses.fields(message)]
    found = {name: foreign(getattr(message, name)) for name in names}
    import numpy

    for name in found.keys() & ARRAYS_OF_FIELDS.keys():
        found[name] = numpy.array(found[name], dtype=ARRAYS_OF_FIELDS[name])
    return kind(**found)


VALUE_FIELDS = {
    "type": st.integers(0, 9),
    "bool_value": st.booleans(),
    "integer_value": st.integers(-(2**63), 2**63 - 1),
    "double_value": st.floats(width=64, allow_nan=False),
    "string_value": TEXTS,
    "byte_array_value": st.lists(st.integers(0, 255), max_size=3),
    "bool_array_value": st.lists(st.booleans(), max_size=3),
    "integer_array_value": st.lists(st.integers(-(2**63), 2**63 - 1), max_size=3),
    "double_array_value": st.lists(st.floats(width=64, allow_nan=False), max_size=3),
    "string_array_value": st.lists(TEXTS, max_size=3),
}
ARRAYS = {"byte": "uint8", "bool": "bool", "integer": "int64", "double": "float64"}


@given(st.lists(st.tuples(TEXTS, st.fixed_dictionaries(VALUE_FIELDS)), max_size=3))
def test_a_request_to_set_parameters_is_what_another_program_makes_of_it(rows: Any) -> None:
    """Behind the 16 bytes in front of it, of the caller."""
    import numpy

    kinds = {n: STORE.types[f"rcl_interfaces/msg/{n}"] for n in ("Parameter", "ParameterValue")}
    parameters = []
    for name, fields in rows:
        arrays = {
            f"{kind}_array_value": numpy.array(fields[f"{kind}_array_value"], dtype=word)
            for kind, word in ARRAYS.items()
        }
        value = kinds["ParameterValue"](**fields | arrays)
        parameters.append(kinds["Parameter"](name, value))
    name = "rcl_interfaces/srv/SetParameters_Request"
    payload = bytes(STORE.serialize_cdr(STORE.types[name](parameters), name))
    read = messages.SetParametersRequest.deserialize(payload[:4] + bytes(16) + payload[4:])
    assert [p.name for p in read.parameters] == [name for name, _ in rows]
    for own, (_, fields) in zip(read.parameters, rows, strict=True):
        assert {key: getattr(own.value, key) for key in fields} == fields
        known = {1: "bool_value", 2: "integer_value", 3: "double_value"}.get(fields["type"])
        assert own.value.python() == (known and fields[known])


@pytest.mark.parametrize("message", HASHES, ids=ros_name)
def test_the_hash_of_each_type_is_that_of_its_definition(message: Any) -> None:
    assert STORE.hash_rihs01(ros_name(message)) == f"RIHS01_{HASHES[message]}"


@pytest.mark.parametrize("message", PUBLISHED, ids=ros_name)
def test_a_recording_defines_each_message_as_ros_does(message: Any) -> None:
    def without_constants(text: str) -> list[str]:
        return [line for line in text.splitlines() if line and "=" not in line.replace("====", "")]

    expected, _ = STORE.generate_msgdef(ros_name(message), ros_version=2)
    assert without_constants(definition(message)) == without_constants(expected)


@given(DRAWN)
def test_the_bytes_are_those_of_another_serializer(message: Any) -> None:
    theirs = STORE.serialize_cdr(foreign(message), ros_name(type(message)))
    ours = message.serialize(use_version_2=False)
    # The padding to 4 bytes at the end belongs to no field; bits of the head say how much it is.
    assert ours[4 : len(theirs)] == theirs[4:]
    assert ours[:2] == theirs[:2]
    assert ours[len(theirs) :] == bytes(len(ours) - len(theirs))
    assert len(ours) - len(theirs) < 4
