"""Set-points stay within the limits and end where they should."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hal.parts.setpoints import Brake, Drift, Reach, Setpoints, Stream, Trapezoid

PERIOD = 1.0 / 60.0
SPEED, ACCELERATION = np.array([1.0, 2.0]), np.array([4.0, 3.0])
LOWER, UPPER = np.array([-3.0, -3.0]), np.array([3.0, 3.0])
positions = st.lists(st.floats(-2.5, 2.5), min_size=2, max_size=2).map(np.array)


def play(setpoints: Setpoints, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    samples = [setpoints.advance(PERIOD) for _ in range(round(seconds / PERIOD))]
    return np.array([position for position, _ in samples]), np.array([velocity for _, velocity in samples])


@given(positions, positions)
@settings(max_examples=50, deadline=None)
def test_a_trapezoid_arrives_with_all_joints_together_within_the_limits(start, target) -> None:
    course = Trapezoid(start, target, SPEED, ACCELERATION)
    path, velocity = play(course, 8.0)
    assert course.finished
    assert path[-1] == pytest.approx(target, abs=1e-9)
    assert np.all(np.abs(velocity) <= SPEED * (1 + 1e-9))
    assert np.all(np.abs(np.diff(velocity, axis=0)) <= ACCELERATION * PERIOD * (1 + 1e-6) + 1e-9)
    delta = target - start
    if np.min(np.abs(delta)) > 1e-3:
        share = (path - start) / delta
        assert share[:, 0] == pytest.approx(share[:, 1], abs=1e-6)


@given(positions, positions, st.floats(-1.0, 1.0))
@settings(max_examples=50, deadline=None)
def test_reaching_from_motion_arrives_within_the_limits(start, target, first_speed) -> None:
    course = Reach(start, np.array([first_speed, 0.0]), target, SPEED, ACCELERATION)
    path, velocity = play(course, 12.0)
    assert course.finished
    assert path[-1] == pytest.approx(target, abs=1e-9)
    assert np.all(np.abs(velocity) <= SPEED + 1e-9)


def test_braking_takes_the_time_that_the_deceleration_gives() -> None:
    course = Brake(np.zeros(2), np.array([1.0, -1.0]), np.array([2.0, 4.0]), LOWER, UPPER)
    path, velocity = play(course, 0.6)
    assert course.finished
    assert path[-1] == pytest.approx([0.25, -0.125], abs=0.01)
    assert np.all(velocity[-1] == 0.0)


def test_a_drifting_joint_slows_down_for_its_limit() -> None:
    course = Drift(np.array([2.0, 0.0]), np.zeros(2), np.array([1.0, 0.1]), ACCELERATION, LOWER, UPPER)
    path, velocity = play(course, 4.0)
    assert path[-1, 0] == pytest.approx(3.0, abs=1e-3)
    assert path[-1, 0] <= 3.0
    assert abs(velocity[-1, 0]) < 1e-2
    assert path[-1, 1] == pytest.approx(0.4, abs=0.01)


def test_a_streamed_set_point_is_reached_after_its_interval_and_held() -> None:
    course = Stream(np.zeros(2), np.array([0.05, -0.05]), 0.05)
    path, velocity = play(course, 0.2)
    assert path[2] == pytest.approx([0.05, -0.05])
    assert path[-1] == pytest.approx([0.05, -0.05])
    assert velocity[0] == pytest.approx([1.0, -1.0])
    assert np.all(velocity[-1] == 0.0)
