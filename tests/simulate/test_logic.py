"""The restart rule of the emulated safety logic, as a truth table and as a property."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsoe_net.simulate.device import SafetyLogic

# Each story: (inputs good, reset pressed) per step, and the outputs that must follow.
STORIES = {
    "off after power-up, without reset": ([(1, 0), (1, 0)], [0, 0]),
    "on with the edge, stays on when released": ([(1, 0), (1, 1), (1, 1), (1, 0)], [0, 1, 1, 1]),
    "edge while an input is bad does nothing": ([(0, 0), (0, 1), (0, 0), (1, 0)], [0, 0, 0, 0]),
    "held since before the inputs were good": ([(0, 1), (1, 1), (1, 1), (1, 0)], [0, 0, 0, 0]),
    "a new edge after a held one": ([(0, 1), (1, 1), (1, 0), (1, 1)], [0, 0, 0, 1]),
    "bad input switches off": ([(1, 1), (0, 1), (0, 0)], [1, 0, 0]),
    "good again is not enough": ([(1, 1), (0, 0), (1, 0), (1, 0)], [1, 0, 0, 0]),
    "held through a bad input": ([(1, 1), (0, 1), (1, 1)], [1, 0, 0]),
    "edge in the very step the inputs become good": ([(0, 0), (1, 1)], [0, 1]),
    "second press while on changes nothing": ([(1, 1), (1, 0), (1, 1), (1, 0)], [1, 1, 1, 1]),
}


@pytest.mark.parametrize("name", STORIES)
def test_outputs_follow_inputs_and_reset(name: str):
    steps, wanted = STORIES[name]
    logic = SafetyLogic()
    seen = []
    for good, pressed in steps:
        logic.pressed = bool(pressed)
        seen.append(int(logic.update(bool(good))))
    assert seen == wanted


@given(st.lists(st.tuples(st.booleans(), st.booleans()), max_size=40))
def test_on_only_while_good_and_only_since_an_edge_in_this_good_spell(
    steps: list[tuple[bool, bool]],
):
    logic = SafetyLogic()
    before, edge_in_spell = False, False
    for good, pressed in steps:
        logic.pressed = pressed
        edge_in_spell = good and (edge_in_spell or (pressed and not before))
        before = pressed
        assert logic.update(good) is edge_in_spell
