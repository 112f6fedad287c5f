"""An emulated axis: modes, stops, limits, faults, homing, safety functions."""

import math

import pytest
from simulate.axis_rig import CPR, CSP, CST, CSV, FREE, HOMING, PP, PV, AxisRig

from fsoe_net.simulate.drive.power import PdsState
from fsoe_net.simulate.drive.safety import SafeDemand

S = PdsState
VOLTAGE, REMOTE = 1 << 4, 1 << 9
REACHED, LIMITED, BIT_12, BIT_13 = 1 << 10, 1 << 11, 1 << 12, 1 << 13
HALT = 0x10F


def spinning(rev_s: float = 5.0, **setup) -> AxisRig:
    rig = AxisRig(**setup)
    rig.enable(CSV)
    rig[0x60FF] = round(rev_s * CPR)
    rig.run(300)
    assert rig.plant.speed == pytest.approx(rev_s * math.tau, rel=1e-3)
    return rig


# -- modes ----------------------------------------------------------------------------------------


def test_nothing_moves_before_operation_is_enabled():
    rig = AxisRig()
    rig[0x6060], rig[0x607A] = CSP, 5000
    for word in (0, 6, 7):
        rig.command(word)
        rig.run(50)
        assert (rig[0x6064], rig[0x6077]) == (0, 0)
        assert rig[0x6041] & (VOLTAGE | REMOTE) == VOLTAGE | REMOTE


def test_csp_follows_a_sine_closely():
    rig = AxisRig()
    rig.enable(CSP)
    worst = 0.0
    for ms in range(2000):
        target = 3 * (1 - math.cos(math.pi * ms / 1000)) / 2
        rig[0x607A] = round(target * CPR)
        rig.run()
        worst = max(worst, abs(rig.revolutions - target))
        assert rig[0x6041] & BIT_12
    assert worst < 0.012  # revolutions
    assert rig[0x60F4] == pytest.approx((rig[0x6062] - rig[0x6064]), abs=1)


def test_csp_jumps_when_the_first_target_is_not_the_actual_position():
    """The trap of many programs: nobody but the MainDevice can avoid it."""
    rig = AxisRig(position_rev=2.0, following_error_rev=0)
    rig[0x6060] = CSP
    for word in (0, 6, 7, 15):
        rig.command(word)
    rig.run(20)
    assert rig[0x6064] < 2.0 * CPR - 100
    assert rig.until(lambda: abs(rig[0x6064]) < 2) > 0


def test_csv_and_its_offset():
    rig = spinning(5.0)
    assert rig[0x606C] == pytest.approx(5 * CPR, rel=1e-3)
    rig[0x60B1] = -2 * CPR
    rig.run(100)
    assert rig[0x606C] == pytest.approx(3 * CPR, rel=1e-3)


def test_cst_is_the_torque_until_the_speed_limit():
    rig = AxisRig(inertia_kgm2=0.01, damping_nms=0.0, friction_nm=0.1, max_rpm=600)
    rig.enable(CST)
    rig[0x6071] = 500  # of 1 N m
    rig.run(200)
    assert rig[0x6077] == 500
    # The target counts from the step in which it is received.
    assert rig.plant.speed == pytest.approx((0.5 - 0.1) / 0.01 * 0.2, rel=1e-6)
    rig.run(4000)
    assert rig.plant.speed <= 600 / 60 * math.tau * 1.001
    assert rig[0x6041] & LIMITED


def test_torque_limit_is_the_smaller_one():
    rig = AxisRig(inertia_kgm2=0.01, damping_nms=0.0, friction_nm=0.0, max_torque_nm=2.0)
    rig.enable(CST)
    rig[0x6071] = 5000
    rig.run()
    assert rig[0x6077] == 2000
    rig[0x6072] = 700
    rig.run()
    assert rig[0x6077] == 700


def test_pv_ramps_with_the_stated_acceleration():
    rig = AxisRig(acceleration_rev_s2=20)
    rig.enable(PV)
    rig[0x60FF] = 10 * CPR
    rig.run()
    passed = rig.until(lambda: rig[0x6041] & REACHED)
    assert passed == pytest.approx(10 / 20 * 1000, abs=30)
    rig[0x60FF] = 0
    rig.run()
    assert rig.until(lambda: rig[0x6041] & BIT_12) == pytest.approx(500, abs=5)
    assert rig.until(lambda: rig[0x6041] & REACHED) < 20


def test_pp_handshake_and_time_of_a_trapezoid():
    rig = AxisRig(acceleration_rev_s2=40)
    rig.enable(PP)
    rig[0x6081] = 8 * CPR
    rig[0x607A] = 10 * CPR
    rig.command(0x1F)
    assert rig[0x6041] & BIT_12  # taken
    assert not rig[0x6041] & REACHED
    rig.command(0x0F)
    assert not rig[0x6041] & BIT_12
    passed = rig.until(lambda: rig[0x6041] & REACHED)
    assert passed == pytest.approx((10 / 8 + 8 / 40) * 1000, abs=30)
    assert rig[0x6064] == pytest.approx(10 * CPR, abs=16)


def test_pp_keeps_one_set_point_waiting():
    rig = AxisRig()
    rig.enable(PP)
    rig[0x607A] = CPR
    rig.command(0x1F)
    rig.command(0x0F)
    rig[0x607A] = 2 * CPR
    rig.command(0x1F)
    rig.command(0x0F)
    assert rig[0x6041] & BIT_12  # no room for a third
    rig.until(lambda: not rig[0x6041] & BIT_12)
    assert rig[0x6064] == pytest.approx(CPR, abs=30)
    rig.until(lambda: rig[0x6041] & REACHED)
    assert rig[0x6064] == pytest.approx(2 * CPR, abs=16)


def test_pp_relative_and_at_once():
    rig = AxisRig()
    rig.enable(PP)
    rig[0x607A] = 4 * CPR
    rig.command(0x1F)
    rig.command(0x0F)
    rig[0x607A] = -CPR
    rig.command(0x7F)  # relative to the target before, at once
    rig.command(0x0F)
    rig.until(lambda: rig[0x6041] & REACHED)
    assert rig[0x6064] == pytest.approx(3 * CPR, abs=16)


def test_a_bit_that_is_already_set_is_not_a_new_set_point():
    rig = AxisRig()
    rig[0x6060], rig[0x607A] = PP, CPR
    for word in (0, 6, 7, 0x1F):
        rig.command(word)
    rig.run(200)
    assert rig.state is S.OPERATION_ENABLED
    assert rig[0x6064] == 0


def test_unknown_modes_are_not_taken():
    rig = AxisRig()
    rig.enable(CSP)
    for mode in (2, 4, 7, 11, -1):
        rig[0x6060] = mode
        rig.run(2)
        assert rig[0x6061] == CSP


def test_mode_changes_while_enabled():
    rig = spinning()
    rig[0x6060], rig[0x607A] = CSP, rig[0x6064]
    rig.run()
    assert rig[0x6061] == CSP
    assert rig.state is S.OPERATION_ENABLED


def test_position_wraps_in_32_bits():
    turns = (1 << 31) / CPR
    rig = AxisRig(position_rev=turns - 0.5)
    rig.enable(CSP)
    start = rig[0x6064]
    for ms in range(500):
        target = start + ms * 20
        rig[0x607A] = (target + (1 << 31)) % (1 << 32) - (1 << 31)
        rig.run()
    assert rig.state is S.OPERATION_ENABLED
    assert rig.revolutions == pytest.approx(turns - 0.5 + 499 * 20 / CPR, abs=0.01)


# -- stops ----------------------------------------------------------------------------------------


def test_quick_stop_by_its_ramp_then_switch_on_disabled():
    rig = spinning(5.0, quick_stop_rev_s2=50)
    rig.command(0x02)
    assert rig.state is S.QUICK_STOP
    passed = rig.until(lambda: rig.state is S.SWITCH_ON_DISABLED)
    assert passed == pytest.approx(5 / 50 * 1000, abs=12)
    assert rig.plant.speed == 0.0


def test_quick_stop_option_stays_and_holds():
    rig = spinning()
    rig[0x605A] = 6
    rig.command(0x02)
    rig.run(500)
    assert rig.state is S.QUICK_STOP
    rig[0x60FF] = 0
    rig.command(0x0F)
    assert rig.state is S.OPERATION_ENABLED


def test_halt_holds_and_continues():
    rig = spinning(5.0, acceleration_rev_s2=50)
    rig.command(HALT)
    rig.run(130)
    assert rig.state is S.OPERATION_ENABLED
    assert rig[0x6041] & REACHED
    at = rig[0x6064]
    rig.run(200)
    assert rig[0x6064] == pytest.approx(at, abs=2)
    rig.command(0x0F)
    rig.run(200)
    assert rig[0x606C] == pytest.approx(5 * CPR, rel=1e-3)


def test_disable_operation_ramps_disable_voltage_coasts():
    rig = spinning(5.0, acceleration_rev_s2=50, friction_nm=0.02, damping_nms=0.0)
    rig.command(0x07)
    assert rig.state is S.OPERATION_ENABLED
    assert rig.until(lambda: rig.state is S.SWITCHED_ON) == pytest.approx(100, abs=12)
    rig.command(0x0F)
    rig.run(300)
    speed = rig.plant.speed
    rig.command(0x00)
    assert rig.state is S.SWITCH_ON_DISABLED
    assert rig[0x6077] == 0
    rig.run(100)
    assert rig.plant.speed == pytest.approx(speed - 0.02 / 0.001 * 0.101, rel=1e-6)


# -- faults and limits ----------------------------------------------------------------------------


def test_fault_brakes_and_waits_for_a_rising_edge():
    rig = spinning(5.0, quick_stop_rev_s2=50)
    rig.axis.trip(0x2310)
    rig.run()
    assert rig.state is S.FAULT_REACTION
    assert rig.until(lambda: rig.state is S.FAULT) == pytest.approx(100, abs=12)
    assert rig[0x603F] == 0x2310
    rig.command(0x0F)
    assert rig.state is S.FAULT
    rig.command(0x80)
    assert (rig.state, rig[0x603F]) == (S.SWITCH_ON_DISABLED, 0)


def test_following_error_is_a_fault_after_its_time():
    rig = AxisRig(max_torque_nm=0.1, inertia_kgm2=0.1, following_error_rev=0.1)
    rig.enable(CSP)
    rig[0x607A] = CPR
    rig.run(5)
    assert rig[0x6041] & BIT_13
    assert rig.state is S.OPERATION_ENABLED
    rig.run(10)
    assert rig[0x603F] == 0x8611


def test_targets_beyond_position_limits_are_cut():
    rig = AxisRig(limits_rev=(-1.0, 1.0))
    rig.enable(CSP)
    for ms in range(1000):
        rig[0x607A] = min(2 * CPR, ms * 30)
        rig.run()
    assert rig[0x6064] == pytest.approx(CPR, abs=3)
    assert rig[0x6041] & LIMITED
    assert rig.state is S.OPERATION_ENABLED


def test_a_target_that_is_seen_late_does_not_shake_the_motor():
    """As on a wire: every tenth target is missed, and the next one is two steps away."""
    rig = AxisRig(inertia_kgm2=0.004)
    rig.enable(CSP)
    for ms in range(3000):
        target = 4 * CPR * (1 - math.cos(math.pi * ms / 1000)) / 2
        if ms % 10:
            rig[0x607A] = round(target)
        rig.run()
        assert not rig[0x6041] & LIMITED
        assert abs(rig.revolutions - target / CPR) < 0.05


@pytest.mark.parametrize(
    ("units", "exponent", "seconds"),
    [
        (4, -3, 0.004),
        (250, -6, 0.000_25),
        (255, 0, 255),
        (1, 1, 1),  # whole seconds are the longest unit, microseconds the shortest
        (2, -7, 0.000_002),
        (0, -3, 0.001),  # a time of zero cannot be followed
    ],
)
def test_the_interpolation_time_is_units_of_a_power_of_ten(
    units: int, exponent: int, seconds: float
):
    objects = AxisRig().axis.objects
    objects.write((0x60C2, 1), units.to_bytes(1))
    objects.write((0x60C2, 2), exponent.to_bytes(1, signed=True))
    assert objects.interpolation_s == pytest.approx(seconds)


def test_a_device_that_stood_still_for_a_while_does_not_stop_the_motor():
    rig = AxisRig(inertia_kgm2=0.004)
    rig.enable(CSP)
    for ms in range(1000):
        rig[0x607A] = round(2 * CPR * (1 - math.cos(math.pi * ms / 1000)) / 2)
        if not 480 < ms < 500:
            rig.run()
        else:
            rig.now_ns += 1_000_000  # the next step is twenty times as long
        assert not rig[0x6041] & LIMITED
    assert rig.revolutions == pytest.approx(2, abs=0.01)


def test_a_limit_switch_stops_what_has_no_position():
    rig = AxisRig(limits_rev=(-1.0, 1.0), quick_stop_rev_s2=200)
    rig.enable(CSV)
    rig[0x60FF] = 3 * CPR
    rig.until(lambda: rig.state is S.FAULT)
    assert rig[0x603F] == 0x8612
    assert rig[0x60FD] & 0b10
    assert 1.0 < rig.revolutions < 1.1


def test_without_outputs_the_drive_stops():
    rig = spinning()
    rig.operational = False
    rig.until(lambda: rig.state is S.FAULT)
    assert rig[0x603F] == 0x7500
    assert rig.plant.speed == 0.0


def test_power_cycle_forgets_all_but_the_angle():
    rig = spinning()
    angle = rig.plant.angle
    rig.axis.power_cycle()
    assert (rig.plant.angle, rig.plant.speed) == (angle, 0.0)
    assert rig.state is S.NOT_READY


# -- homing ---------------------------------------------------------------------------------------


def homed(rig: AxisRig, method: int) -> None:
    rig.enable(HOMING)
    rig[0x6098], rig[0x607C] = method, 123
    rig.command(0x1F)
    rig.until(lambda: rig[0x6041] & BIT_12 and rig[0x6041] & REACHED, 20_000)
    assert not rig[0x6041] & BIT_13


@pytest.mark.parametrize(
    ("method", "start", "edge"),
    [
        (17, 0.0, -2.0),
        (18, 0.0, 2.0),
        (19, 0.0, 0.5),
        (20, 0.0, 0.5),
        (19, 0.7, 0.5),
        (20, 0.7, 0.5),
        (21, 1.5, 1.0),
        (22, 1.5, 1.0),
        (22, 0.7, 1.0),
    ],
)
def test_homing_on_a_switch(method: int, start: float, edge: float):
    """Where the edge was, the axis shows the home offset."""
    rig = AxisRig(position_rev=start, limits_rev=(-2.0, 2.0), home_switch_rev=(0.5, 1.0))
    homed(rig, method)
    shown = 123 + (rig.revolutions - edge) * CPR
    assert rig[0x6064] == pytest.approx(shown, abs=3)
    assert abs(rig.revolutions - edge) < 0.01


@pytest.mark.parametrize("method", [35, 37])
def test_homing_in_place(method: int):
    rig = AxisRig(position_rev=1.25)
    homed(rig, method)
    assert rig[0x6064] == 123
    assert rig.revolutions == pytest.approx(1.25)


def test_homing_without_a_switch_or_a_method_is_an_error():
    rig = AxisRig(limits_rev=(-2.0, 2.0))
    rig.enable(HOMING)
    rig[0x6098] = 19
    rig.command(0x1F)
    rig.until(lambda: rig[0x6041] & BIT_13)
    rig.command(0x0F)
    rig[0x6098] = 1
    rig.command(0x1F)
    assert rig[0x6041] & BIT_13


# -- safety functions -----------------------------------------------------------------------------

STO, SS1 = SafeDemand(sto=True), SafeDemand(ss1=True)


def test_sto_takes_the_torque_and_the_motor_coasts_to_rest():
    rig = spinning(5.0, safe=True, friction_nm=0.1, damping_nms=0.0)
    speed = rig.plant.speed
    rig.demand = STO
    rig.run()
    assert rig.state is S.SWITCH_ON_DISABLED
    assert rig[0x6077] == 0
    rest_ms = speed * 0.001 / 0.1 * 1000
    assert rig.until(lambda: rig.plant.speed == 0.0) == pytest.approx(rest_ms, abs=2)


@pytest.mark.parametrize("word", range(16))
def test_no_controlword_gives_torque_under_sto(word: int):
    rig = AxisRig(safe=True)
    rig.demand = STO
    for last in (6, 7, 15, word):
        rig.command(last)
        assert rig.state is S.SWITCH_ON_DISABLED


def test_sto_is_a_fault_where_the_drive_is_so():
    rig = spinning(safe=True, sto_is_fault=True)
    rig.demand = STO
    rig.run()
    assert (rig.state, rig[0x603F]) == (S.FAULT, 0x5441)
    rig.demand = FREE
    rig.run(10)
    assert rig.state is S.FAULT


def test_a_drive_starts_safe():
    rig = AxisRig(safe=True)
    assert rig.axis.safe.torque_off


def test_ss1_ramps_then_takes_the_torque():
    rig = spinning(5.0, safe=True, quick_stop_rev_s2=50, ss1_ms=400)
    rig.demand = SS1
    rig.run()
    assert rig.state is S.QUICK_STOP
    speed = rig.plant.speed
    rig.run(50)
    assert rig.plant.speed == pytest.approx(speed - 50 * math.tau * 0.05, rel=0.02)
    assert not rig.axis.safe.torque_off
    passed = rig.until(lambda: rig.axis.safe.torque_off)
    assert 50 + passed == pytest.approx(5 / 50 * 1000, abs=12)
    assert rig.state is S.SWITCH_ON_DISABLED
    rig.demand = FREE
    rig.run(100)
    assert rig.state is S.SWITCH_ON_DISABLED  # nothing comes back by itself


def test_ss1_takes_the_torque_after_its_time_though_the_motor_turns():
    rig = spinning(5.0, safe=True, quick_stop_rev_s2=5, ss1_ms=200)
    rig.demand = SS1
    rig.run()
    assert rig.until(lambda: rig.axis.safe.torque_off) == pytest.approx(200, abs=1)
    assert rig.plant.speed > 10


def test_sls_holds_the_speed():
    limit = 2 * math.tau
    rig = spinning(5.0, safe=True)
    rig.demand = SafeDemand(sls_speeds=[limit])
    rig.run(600)
    assert rig.plant.speed == pytest.approx(limit, rel=1e-3)
    assert rig[0x6041] & LIMITED
    assert rig.state is S.OPERATION_ENABLED
    assert rig.axis.safe.limit_watched
    rig.demand = FREE
    rig.run(200)
    assert rig.plant.speed == pytest.approx(5 * math.tau, rel=1e-3)


def test_too_fast_under_sls_is_a_stop_that_stays():
    """A load that drives the motor: the torque limit is too small to hold the speed."""
    limit = 2 * math.tau
    rig = spinning(5.0, safe=True, friction_nm=0.0, damping_nms=0.0, inertia_kgm2=0.01)
    rig[0x6072] = 10
    demand = rig.demand = SafeDemand(sls_speeds=[limit])
    rig.run(499)
    assert rig.state is S.OPERATION_ENABLED
    rig.until(lambda: rig.axis.safe.torque_off)
    assert rig.axis.safe.violated
    rig.plant.speed = 0.0
    rig.run(10)
    assert rig.axis.safe.torque_off
    rig.demand = SafeDemand(sls_speeds=demand.sls_speeds, acknowledge=True)
    rig.run(2)
    assert not rig.axis.safe.torque_off
    assert rig.state is S.SWITCH_ON_DISABLED


def test_the_lower_limit_counts():
    rig = spinning(5.0, safe=True)
    rig.demand = SafeDemand(sls_speeds=[3 * math.tau, math.tau])
    rig.run(300)
    assert rig.plant.speed == pytest.approx(math.tau, rel=1e-3)
