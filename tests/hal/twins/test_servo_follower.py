"""A controller's set-points: what it follows, and what it takes for a jump."""

from __future__ import annotations

import numpy as np
import pytest

from hal.twins.servo_follower import ServoFollower

SPEED = np.array([3.0, 1.0])
STEP = 1 / 240


def test_it_follows_within_the_speed_of_the_joints_and_arrives() -> None:
    follower = ServoFollower(np.zeros(2), SPEED)
    follower.take(10.0, np.array([0.06, -0.03]))
    places = [follower.advance(STEP) for _ in range(120)]
    assert places[-1] == pytest.approx([0.06, -0.03], abs=1e-5)
    assert np.all(np.abs(np.diff(places, axis=0)) <= SPEED * STEP + 1e-9)
    assert not follower.moving
    assert not follower.too_fast


@pytest.mark.parametrize(("way", "too_fast"), [(0.06, False), (0.07, True), (-0.07, True)])
def test_a_set_point_that_the_joints_cannot_reach_in_time_is_a_jump(way: float, too_fast: bool) -> None:
    """At 3 rad/s, half as much again in 10 ms and 0.02 rad: 0.065 rad."""
    follower = ServoFollower(np.zeros(2), SPEED)
    follower.take(10.0, np.zeros(2))
    for _ in range(2):
        follower.advance(STEP)
    follower.take(10.01, np.array([way, 0.0]))
    assert follower.too_fast is too_fast
    follower.take(10.02, np.array([way, 0.0]))
    assert follower.too_fast is too_fast  # it is remembered


def test_set_points_that_were_held_up_together_are_no_jump() -> None:
    """As they have arrived: a world that lags behind takes them all in one step."""
    follower = ServoFollower(np.zeros(2), SPEED)
    for number in range(6):
        follower.take(10.0 + 0.03 * number, np.array([0.09 * number, 0.0]))
    assert not follower.too_fast


@pytest.mark.parametrize(("gap", "too_fast"), [(0.05, False), (0.2, True)])
def test_of_set_points_that_are_found_together_each_may_have_come_after_all_of_the_time(
    gap: float, too_fast: bool
) -> None:
    follower = ServoFollower(np.zeros(2), SPEED)
    follower.take(10.0, np.zeros(2))
    follower.take(10.08, *(np.array([3.0 * at, 0.0]) for at in (0.01, 0.01 + gap, 0.02 + gap)))
    assert follower.too_fast is too_fast
    assert follower.moving


def test_after_a_pause_a_jump_is_one_all_the_same() -> None:
    follower = ServoFollower(np.zeros(2), SPEED)
    follower.take(10.0, np.zeros(2))
    follower.take(20.0, np.array([0.6, 0.0]))
    assert follower.too_fast
