"""States of an emulated drive: every state with every controlword, as IEC 61800-7-201 has them."""

import pytest

from fsoe_net.simulate.drive.power import PdsState, PowerSystem

S = PdsState
# As the public manuals of drives print it: transition, state, bits 7 3 2 1 0, next state.
TABLE = """
2   SWITCH_ON_DISABLED  0x110  READY
3   READY               00111  SWITCHED_ON
3   READY               01111  SWITCHED_ON
7   READY               0xx0x  SWITCH_ON_DISABLED
7   READY               0x01x  SWITCH_ON_DISABLED
4   SWITCHED_ON         01111  OPERATION_ENABLED
6   SWITCHED_ON         0x110  READY
10  SWITCHED_ON         0xx0x  SWITCH_ON_DISABLED
10  SWITCHED_ON         0x01x  SWITCH_ON_DISABLED
5   OPERATION_ENABLED   00111  SWITCHED_ON
8   OPERATION_ENABLED   0x110  READY
9   OPERATION_ENABLED   0xx0x  SWITCH_ON_DISABLED
11  OPERATION_ENABLED   0x01x  QUICK_STOP
12  QUICK_STOP          0xx0x  SWITCH_ON_DISABLED
"""
STATUS = {  # statusword: mask and value
    S.NOT_READY: (0x4F, 0x00),
    S.SWITCH_ON_DISABLED: (0x4F, 0x40),
    S.READY: (0x6F, 0x21),
    S.SWITCHED_ON: (0x6F, 0x23),
    S.OPERATION_ENABLED: (0x6F, 0x27),
    S.QUICK_STOP: (0x6F, 0x07),
    S.FAULT_REACTION: (0x4F, 0x0F),
    S.FAULT: (0x4F, 0x08),
}


def next_state(state: PdsState, word: int) -> PdsState:
    """Return what the table has for the five bits that count."""
    bits = "".join(str(word >> n & 1) for n in (7, 3, 2, 1, 0))
    for row in TABLE.split("\n"):
        if row:
            _, before, pattern, after = row.split()
            if before == state.name and all(
                p in ("x", b) for p, b in zip(pattern, bits, strict=True)
            ):
                return S[after]
    return state


@pytest.mark.parametrize("state", [S.SWITCH_ON_DISABLED, S.READY, S.SWITCHED_ON])
def test_every_controlword_without_torque(state: PdsState):
    for word in range(0x100):
        power = PowerSystem(state=state)
        power.step(word, standing=True, safe_stop=False)
        assert power.state is next_state(state, word), f"0x{word:02x}"


@pytest.mark.parametrize("state", [S.OPERATION_ENABLED, S.QUICK_STOP])
def test_every_controlword_with_torque(state: PdsState):
    """Disable operation (5) and the end of a quick stop (12) wait until the motor stands."""
    for word in range(0x100):
        power = PowerSystem(state=state)
        power.step(word, standing=False, safe_stop=False)
        after = next_state(state, word)
        waits = after is S.SWITCHED_ON
        assert power.state is (state if waits else after), f"0x{word:02x}"
        assert power.disabling is waits
        power.step(word, standing=True, safe_stop=False)
        if waits:
            assert power.state is S.SWITCHED_ON
        elif after is S.QUICK_STOP:
            assert power.state is S.SWITCH_ON_DISABLED


def test_states_have_the_statuswords_of_the_standard():
    assert set(STATUS) == set(S)
    for state in S:
        fitting = [s for s, (mask, value) in STATUS.items() if state.value & mask == value]
        assert fitting == [state]


@pytest.mark.parametrize("stays", [False, True])
def test_after_a_quick_stop(stays: bool):
    """0x605A: 5 … 8 stay in Quick stop active, from where operation is enabled again (16)."""
    power = PowerSystem(state=S.OPERATION_ENABLED, stays_stopped=stays)
    power.step(0x02, standing=False, safe_stop=False)
    assert power.state is S.QUICK_STOP
    power.step(0x0F, standing=False, safe_stop=False)
    assert power.state is S.QUICK_STOP  # not while it moves
    power.step(0x02, standing=True, safe_stop=False)
    assert power.state is (S.QUICK_STOP if stays else S.SWITCH_ON_DISABLED)
    power.step(0x0F, standing=True, safe_stop=False)
    assert power.state is (S.OPERATION_ENABLED if stays else S.SWITCH_ON_DISABLED)


def test_fault_is_left_by_a_rising_edge_only():
    power = PowerSystem(state=S.SWITCHED_ON)
    power.step(0x80, standing=True, safe_stop=False)
    power.trip(0x2310)
    assert (power.state, power.error_code) == (S.FAULT, 0x2310)
    power.step(0x80, standing=True, safe_stop=False)  # held since before the fault
    assert power.state is S.FAULT
    for word in range(0x80):
        power.step(word, standing=True, safe_stop=False)
        assert power.state is S.FAULT
    power.step(0x80, standing=True, safe_stop=False)
    assert (power.state, power.error_code) == (S.SWITCH_ON_DISABLED, 0)


def test_fault_with_torque_stops_first():
    power = PowerSystem(state=S.OPERATION_ENABLED)
    power.trip(0x8611)
    power.step(0x80, standing=False, safe_stop=False)
    assert power.state is S.FAULT_REACTION
    power.step(0x0F, standing=True, safe_stop=False)
    assert power.state is S.FAULT


@pytest.mark.parametrize("state", [s for s in S if s.value not in (0x00, 0x08, 0x0F)])
@pytest.mark.parametrize("code", [0, 0x5441])
def test_torque_taken_from_outside(state: PdsState, code: int):
    power = PowerSystem(state=state)
    had_torque = power.has_torque
    power.take_torque(code)
    is_fault = bool(code) and had_torque
    assert power.state is (S.FAULT if is_fault else S.SWITCH_ON_DISABLED)
    assert power.error_code == (code if is_fault else 0)


def test_torque_taken_during_a_fault_reaction_keeps_the_fault():
    power = PowerSystem(state=S.OPERATION_ENABLED)
    power.trip(0x2310)
    power.take_torque(0)
    assert (power.state, power.error_code) == (S.FAULT, 0x2310)


def test_a_safe_stop_is_a_quick_stop_that_commands_do_not_end():
    power = PowerSystem(state=S.OPERATION_ENABLED, stays_stopped=True)
    power.step(0x0F, standing=False, safe_stop=True)
    assert power.state is S.QUICK_STOP
    power.step(0x0F, standing=True, safe_stop=True)
    assert power.state is S.QUICK_STOP
    power.step(0x00, standing=True, safe_stop=True)
    assert power.state is S.SWITCH_ON_DISABLED
