"""Types, hashes and bytes of messages against `rosbags`, which nobody here wrote."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros2.rig import typestore

from fsoe_net.ros2 import messages
from fsoe_net.ros2.messages import HASHES, definition, ros_name

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
DRAWN = st.one_of(
    st.builds(messages.DiagnosticArray, STAMPS, st.lists(STATUSES, max_size=4)),
    st.builds(messages.JointState, STAMPS, st.lists(TEXTS, max_size=4), FLOATS, FLOATS, FLOATS),
    *(st.builds(m, SIGNALS[kind.value]) for kind, m in messages.SIGNALS.items()),
)


def foreign(message: Any) -> Any:
    """Return the message as an object of `rosbags`."""
    if isinstance(message, list):
        return [foreign(item) for item in message]
    if not dataclasses.is_dataclass(message):
        return message
    kind = STORE.types[ros_name(type(message))]
    names = [f.name for f in dataclasses.fields(message)]
    found = {name: foreign(getattr(message, name)) for name in names}
    if kind.__name__.startswith("sensor_msgs"):
        import numpy

        for name in ("position", "velocity", "effort"):
            found[name] = numpy.array(found[name], dtype=numpy.float64)
    return kind(**found)


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
