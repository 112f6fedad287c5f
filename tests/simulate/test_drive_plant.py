"""Motor and load against formulas on paper."""

import math

import pytest

from fsoe_net.simulate.drive.plant import Plant

J, T, FRICTION, DAMPING = 0.002, 1.5, 0.2, 0.01


def moved(plant: Plant, torque: float, seconds: float, steps: int) -> Plant:
    for _ in range(steps):
        plant.advance(torque, seconds / steps)
    return plant


@pytest.mark.parametrize("steps", [1, 7, 4000])
def test_constant_torque_gives_constant_acceleration(steps: int):
    plant = moved(Plant(J, FRICTION, 0.0), T, 0.5, steps)
    rate = (T - FRICTION) / J
    assert plant.speed == pytest.approx(rate * 0.5)
    assert plant.angle == pytest.approx(rate * 0.5**2 / 2)


@pytest.mark.parametrize("steps", [1, 7, 4000])
def test_damping_gives_a_final_speed(steps: int):
    plant = moved(Plant(J, FRICTION, DAMPING), T, 0.3, steps)
    final, constant = (T - FRICTION) / DAMPING, J / DAMPING
    assert plant.speed == pytest.approx(final * (1 - math.exp(-0.3 / constant)))
    angle = final * (0.3 - constant * (1 - math.exp(-0.3 / constant)))
    assert plant.angle == pytest.approx(angle)


@pytest.mark.parametrize("steps", [1, 7, 4000])
@pytest.mark.parametrize("sign", [1, -1])
def test_coasting_ends_by_friction(steps: int, sign: int):
    """0 = speed - friction / inertia * time, and it stays where it came to rest."""
    plant = Plant(J, FRICTION, 0.0, speed=sign * 50.0)
    rest = 50.0 * J / FRICTION
    moved(plant, 0.0, rest * 0.5, steps)
    assert plant.speed == pytest.approx(sign * 25.0)
    moved(plant, 0.0, rest, steps)
    assert plant.speed == 0.0
    assert plant.angle == pytest.approx(sign * 50.0 * rest / 2)


def test_coasting_with_damping_ends_after_the_time_of_the_formula():
    plant = Plant(J, FRICTION, DAMPING, speed=50.0)
    rest = J / DAMPING * math.log(1 + DAMPING * 50.0 / FRICTION)
    plant.advance(0.0, rest * 0.999)
    assert 0 < plant.speed < 0.1
    plant.advance(0.0, rest * 0.01)
    assert plant.speed == 0.0


def test_friction_holds_a_resting_axis():
    plant = Plant(J, FRICTION, DAMPING)
    plant.advance(FRICTION, 1.0)
    plant.advance(-FRICTION, 1.0)
    assert (plant.angle, plant.speed) == (0.0, 0.0)
    plant.advance(FRICTION * 1.01, 1.0)
    assert plant.speed > 0


def test_reversal_goes_through_rest():
    """Against the motion friction helps the torque, after it it works against it."""
    plant = Plant(J, FRICTION, 0.0, speed=10.0)
    rest = 10.0 * J / (T + FRICTION)
    plant.advance(-T, rest + 0.1)
    assert plant.speed == pytest.approx(-(T - FRICTION) / J * 0.1)


def test_energy_is_what_the_torque_has_done():
    plant = Plant(J, 0.0, 0.0)
    plant.advance(T, 0.25)
    assert J * plant.speed**2 / 2 == pytest.approx(T * plant.angle)
