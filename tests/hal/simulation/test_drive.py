"""Between the velocity of a base and the motion of its wheels."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from bestman_bt.messages import Twist2D
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import BaseModel
from hal.simulation.base_drives import PARK_AFTER, Odometry, SideDrive, SteeredDrive, WheelDrive
from hal.simulation.parameters import SimulationParameters

SIDES = SideDrive(0.1, 0.1, 0.5)
PLACES = np.array([[0.25, 0.2], [0.25, -0.2], [-0.25, 0.2], [-0.25, -0.2]])
STEERED = SteeredDrive(PLACES, np.full(4, 0.08))
NONE = np.zeros(0)
VELOCITIES = [(0.4, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.8), (0.2, -0.3, 0.5)]


@pytest.mark.parametrize("velocity", [(0.4, 0.0, 0.0), (0.0, 0.0, 0.8), (0.3, 0.0, -0.5)])
def test_the_wheels_of_two_sides_report_the_velocity_that_they_were_given(velocity) -> None:
    speeds = SIDES.wheel_speeds(velocity, NONE)
    assert SIDES.motion(speeds, NONE) == pytest.approx(velocity)


def test_four_wheels_of_two_sides_turn_alike_on_each() -> None:
    speeds = SideDrive(0.1, 0.1, 0.5, wheels=4).wheel_speeds((0.4, 0.0, 0.4), NONE)
    assert speeds.tolist() == pytest.approx([3.0, 5.0, 3.0, 5.0])


@pytest.mark.parametrize("velocity", VELOCITIES)
def test_steered_wheels_report_the_velocity_that_they_were_given(velocity) -> None:
    steering = STEERED.steering_angles(velocity, np.zeros(4))
    speeds = STEERED.wheel_speeds(velocity, steering)
    assert STEERED.motion(speeds, steering) == pytest.approx(velocity)


def test_a_steered_wheel_turns_by_a_quarter_at_most_and_rolls_backwards_instead() -> None:
    present = np.full(4, 0.1)
    steering = STEERED.steering_angles((-0.4, 0.0, 0.0), present)
    np.testing.assert_allclose(steering, 0.0, atol=1e-12)
    assert np.all(STEERED.wheel_speeds((-0.4, 0.0, 0.0), steering) < 0.0)


def test_a_standing_base_leaves_its_wheels_where_they_point() -> None:
    present = np.array([0.3, -0.4, 0.5, 0.6])
    np.testing.assert_array_equal(STEERED.steering_angles((0.0, 0.0, 0.0), present), present)


def test_odometry_of_a_sideways_arc_ends_where_the_arc_does() -> None:
    """vy and wz constant: a circle of radius vy / wz, about a point ahead or behind."""
    odometry = Odometry(STEERED, np.zeros(4))
    vy, wz, steps = 0.3, 0.6, 2000
    velocity, step = (0.0, vy, wz), math.pi / wz / steps
    steering = STEERED.steering_angles(velocity, np.zeros(4))
    wheels = np.zeros(4)
    for _ in range(steps):
        wheels = wheels + STEERED.wheel_speeds(velocity, steering) * step
        odometry.update(wheels, steering)
    assert (odometry.x, odometry.y) == pytest.approx((-2 * vy / wz, 0.0), abs=1e-5)
    assert odometry.heading == pytest.approx(math.pi)


def test_wheels_are_held_once_they_have_stood_for_a_while_without_a_break(monkeypatch: pytest.MonkeyPatch) -> None:
    model, parameters = load_robot_model("diff_panda").of(BaseModel)["base"], SimulationParameters()
    drive, held = WheelDrive("base", model, parameters, np.random.default_rng(0)), []
    motors = SimpleNamespace(
        speeds=np.zeros(2),
        steering=NONE,
        count=lambda: None,
        park=lambda: held.append(True),
        steer=lambda angles: 0.0,
        drive=lambda speeds: None,
    )
    monkeypatch.setattr(drive, "_attached_motors", motors)
    monkeypatch.setattr(drive, "read", lambda: None)
    drive.send(Twist2D(0.3, 0.0, 0.0))
    drive.send(Twist2D())
    long_enough = round(PARK_AFTER / parameters.control_period)
    for _ in range(4 * long_enough):  # it stands for a moment, again and again: it rocks to rest
        motors.speeds = 0.5 - motors.speeds
        drive.watch()
    assert not held
    motors.speeds = np.zeros(2)
    for _ in range(long_enough + 1):
        drive.watch()
    assert held == [True]
