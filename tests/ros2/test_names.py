"""Hostile names become legal names of ROS."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsoe_net.ros2.names import is_node_name, legal_text, legal_token

LEGAL = re.compile(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*")
NAMES = {
    "0x6064:00": "object_6064_00",
    "0x6064": "object_6064",
    "status_word": "status_word",
    "1 OUT (left)": "n1_OUT_left",
    "_hidden__twice_": "hidden_twice",
    "a/../b": "a_b",
    "~": "unnamed",
    "Türe·1": "T_re_1",
    "a\x00b\n": "a_b",
}


@pytest.mark.parametrize("name", NAMES)
def test_name_is_made_legal_for_ros(name: str) -> None:
    assert legal_token(name) == NAMES[name]
    assert is_node_name(NAMES[name])
    assert is_node_name(name) is (name == NAMES[name])


@given(st.text(max_size=300))
def test_each_name_becomes_a_legal_one(name: str) -> None:
    token = legal_token(name)
    assert LEGAL.fullmatch(token), token
    assert len(token) <= 80


@given(st.text(max_size=40))
def test_each_text_fits_into_a_message(text: str) -> None:
    found = legal_text(text)
    assert "\x00" not in found
    assert found.encode().decode() == found
    assert text == found or not text.isprintable()
