"""Set-points stay within the limits and end where they should."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestman_bt.messages import JointTrajectory
from hal.parts.setpoints import Brake, BrakeThenMove, Drift, Follow, Reach, Setpoints, Stream, Trapezoid

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


@pytest.mark.slow
@given(positions, positions, st.floats(-1.0, 1.0))
@settings(max_examples=50, deadline=None)
def test_reaching_from_motion_arrives_within_the_limits(start, target, first_speed) -> None:
    course = Reach(start, np.array([first_speed, 0.0]), target, SPEED, ACCELERATION)
    path, velocity = play(course, 12.0)
    assert course.finished
    assert path[-1] == pytest.approx(target, abs=1e-9)
    assert np.all(np.abs(velocity) <= SPEED + 1e-9)
    # The last step may take what is left of the speed away at once.
    changes = np.abs(np.diff(np.vstack([[first_speed, 0.0], velocity]), axis=0))
    assert np.all(changes <= 2 * ACCELERATION * PERIOD + 1e-6)
    assert np.mean(changes > ACCELERATION * PERIOD + 1e-9) < 0.01
    if abs(first_speed) < 1e-9:
        assert np.all(path <= np.maximum(start, target) + 2e-3)
        assert np.all(path >= np.minimum(start, target) - 2e-3)


def test_braking_takes_the_time_that_the_deceleration_gives() -> None:
    course = Brake(np.zeros(2), np.array([1.0, -1.0]), np.array([2.0, 4.0]), LOWER, UPPER)
    path, velocity = play(course, 0.6)
    assert course.finished
    assert path[-1] == pytest.approx([0.25, -0.125], abs=0.01)
    assert np.all(velocity[-1] == 0.0)


def test_braking_stops_at_a_joints_limit_and_is_over_when_all_joints_rest() -> None:
    course = Brake(np.array([2.9, -2.9]), np.array([1.0, -1.0]), np.array([1.0, 0.5]), LOWER, UPPER)
    path, _ = play(course, 1.1)
    assert not course.finished
    assert path[-1] == pytest.approx([3.0, -3.0])
    play(course, 1.0)
    assert course.finished
    assert Brake(np.zeros(2), np.zeros(2), ACCELERATION, LOWER, UPPER).finished
    assert not Brake(np.zeros(2), np.array([0.0, -0.1]), ACCELERATION, LOWER, UPPER).finished


@pytest.mark.parametrize("first_speed", [0.0, 0.8, -0.8])
def test_a_move_from_motion_brakes_first_and_then_goes_straight(first_speed: float) -> None:
    first = np.array([first_speed, 0.0])
    brake = Brake(np.zeros(2), first, ACCELERATION, LOWER, UPPER)
    course = BrakeThenMove(brake, np.array([1.0, -0.5]), SPEED, ACCELERATION)
    path, velocity = play(course, 6.0)
    assert course.finished
    assert path[-1] == pytest.approx([1.0, -0.5])
    changes = np.abs(np.diff(np.vstack([first, velocity]), axis=0))
    assert np.all(changes <= ACCELERATION * PERIOD * (1 + 1e-6) + 1e-9)
    rest = first_speed * abs(first_speed) / (2 * ACCELERATION[0])
    assert np.min(np.abs(path - [rest, 0.0]).max(axis=1)) < 0.01  # where it has come to rest


def test_a_trajectory_is_followed_to_its_end_and_an_offset_at_its_start_fades_out() -> None:
    times = np.array([0.0, 1.0, 2.0])
    positions = np.array([[0.0, 0.0], [0.5, -0.2], [1.0, 0.0]])
    trajectory = JointTrajectory(("a", "b"), times, positions, np.array([[0.0, 0.0], [0.5, 0.0], [0.0, 0.0]]))
    course = Follow(trajectory, np.array([0.0, 0.04]), 0.25)
    path, velocity = play(course, 1.9)
    assert not course.finished
    assert course.time == pytest.approx(1.9)
    due = np.array([trajectory.sample(PERIOD * (k + 1))[0] for k in range(len(path))])
    off = path - due
    assert off[:, 0] == pytest.approx(0.0, abs=1e-9)
    assert 0.035 < off[0, 1] <= 0.04
    assert np.all(np.diff(off[:, 1]) <= 1e-9)
    assert off[15:, 1] == pytest.approx(0.0, abs=1e-9)
    assert np.diff(path, axis=0) / PERIOD == pytest.approx((velocity[:-1] + velocity[1:]) / 2, abs=0.02)
    play(course, 0.3)
    assert course.finished
    assert course.time == 2.0
    short = Follow(trajectory, np.array([0.0, 0.04]), 5.0)
    path, _ = play(short, 2.0)
    assert path[-1] == pytest.approx(positions[-1])  # an offset is gone by its end, however short it is
    in_motion = JointTrajectory(("a", "b"), times, positions, np.full((3, 2), 0.4))
    path, velocity = play(Follow(in_motion, np.zeros(2), 0.25), 2.5)
    assert path[-1] == pytest.approx(positions[-1])
    assert np.all(velocity[-25:] == 0.0)  # one that ends in motion is held at its end at rest


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_drifting_joint_keeps_its_velocity_and_turns_round_within_its_acceleration(sign: float) -> None:
    first = sign * np.array([-0.6, 0.0])
    course = Drift(np.zeros(2), first, sign * np.array([0.6, 1.5]), ACCELERATION, LOWER, UPPER)
    path, velocity = play(course, 1.5)
    changes = np.abs(np.diff(np.vstack([first, velocity]), axis=0))
    assert np.all(changes <= ACCELERATION * PERIOD + 1e-9)
    assert velocity[-1] == pytest.approx(sign * np.array([0.6, 1.5]))
    assert sign * path[-1, 0] == pytest.approx(-(0.6**2) / 4.0 + 0.6 * (1.5 - 0.3) + 0.6**2 / 4.0, abs=0.02)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_drifting_joint_slows_down_for_its_limit(sign: float) -> None:
    course = Drift(sign * np.array([2.0, 0.0]), np.zeros(2), sign * np.array([1.0, 0.1]), ACCELERATION, LOWER, UPPER)
    path, velocity = play(course, 4.0)
    assert sign * path[-1, 0] == pytest.approx(3.0, abs=1e-3)
    assert np.abs(path).max() <= 3.0
    assert np.abs(np.diff(path[:, 0], n=2)).max() < 1.05 * ACCELERATION[0] * PERIOD**2
    assert abs(velocity[-1, 0]) < 1e-2
    assert sign * path[-1, 1] == pytest.approx(0.4, abs=0.01)


def test_a_streamed_set_point_is_reached_after_its_interval_and_held() -> None:
    start, step = np.array([1.0, -2.0]), np.array([0.05, -0.05])
    course = Stream(start, start + step, 3 * PERIOD)
    path, velocity = play(course, 3 * PERIOD)
    assert path - start == pytest.approx(np.outer([1 / 3, 2 / 3, 1.0], step))
    assert velocity == pytest.approx(np.outer(np.ones(3), step / (3 * PERIOD)))
    assert not course.finished
    path, velocity = play(course, 3 * PERIOD)
    assert path == pytest.approx(np.tile(start + step, (3, 1)))
    assert np.all(velocity == 0.0)
    assert course.finished
