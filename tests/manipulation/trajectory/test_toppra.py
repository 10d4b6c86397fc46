from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.motion_planning.checked_edges import dense_points
from bestman_bt.manipulation.trajectory.base import SpeedScale, TrajectoryError
from bestman_bt.manipulation.trajectory.ruckig import RuckigStateToState
from bestman_bt.manipulation.trajectory.toppra import Toppra

# Sharp corners, a reversal and a repeated waypoint.
CORNERS = np.array(
    [
        [0.0, -0.5, 0.0, -2.2, 0.0, 1.8, 0.785],
        [1.0, 0.5, 0.0, -1.2, 0.0, 1.8, 0.785],
        [1.0, 0.5, 0.0, -1.2, 0.0, 1.8, 0.785],
        [1.0, 0.5, 1.0, -1.2, 0.5, 1.0, 0.785],
        [0.2, 0.0, 0.0, -2.0, 0.0, 1.8, -0.5],
        [0.6, 0.2, 0.4, -1.7, 0.2, 1.5, 0.0],
    ]
)


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("scale", [SpeedScale(0.5, 0.35), SpeedScale(1.0, 1.0), SpeedScale(0.1, 1.0)])
@pytest.mark.parametrize("min_grid", [40, 200])
def test_the_executed_motion_keeps_three_percent_of_every_limit(arm, scale, min_grid):
    timing = Toppra(min_grid=min_grid, grid_per_waypoint=1)
    trajectory = timing.parametrize(CORNERS, arm, scale)
    times = np.linspace(0.0, trajectory.duration, 4000)
    velocities = np.array([trajectory.sample(time)[1] for time in times])
    accelerations = np.diff(trajectory.velocities, axis=0) / np.diff(trajectory.times)[:, None]
    assert np.max(np.abs(velocities) / (arm.velocity * scale.velocity)) <= 1.03
    assert np.max(np.abs(accelerations) / (arm.acceleration * scale.acceleration)) <= 1.03


def test_the_motion_is_about_as_fast_as_the_limits_allow(arm):
    """One joint that moves far: it reaches its cruising speed and needs hardly longer than a trapezoid."""
    start, goal = np.zeros(7), np.zeros(7)
    start[3] = goal[3] = -1.5
    goal[0] = 2.0
    trajectory = Toppra().parametrize([start, goal], arm, SpeedScale(0.5, 0.5))
    speed, rate = arm.velocity[0] * 0.5, arm.acceleration[0] * 0.5
    assert trajectory.duration == pytest.approx(2.0 / speed + speed / rate, rel=0.05)


def test_the_motion_starts_and_ends_at_rest_at_the_ends_of_the_path_and_stays_on_it(arm):
    trajectory = Toppra().parametrize(CORNERS, arm)
    assert np.array_equal(trajectory.positions[[0, -1]], CORNERS[[0, -1]])
    assert np.array_equal(trajectory.velocities[[0, -1]], np.zeros((2, 7)))
    on_path = np.array(list(dense_points(CORNERS, 0.002)))
    farthest = max(np.min(np.linalg.norm(on_path - q, axis=1)) for q in trajectory.positions[::3])
    assert farthest < 0.02


def test_samples_come_at_the_asked_rate(arm):
    trajectory = Toppra(rate=50.0).parametrize(CORNERS, arm)
    assert trajectory.joint_names == arm.joint_names
    assert np.max(np.diff(trajectory.times)) <= 0.02
    assert len(trajectory.times) == pytest.approx(trajectory.duration * 50, abs=2)


def test_a_path_without_motion_gives_one_sample(arm, ready):
    for path in ([ready], [ready, ready]):
        trajectory = Toppra().parametrize(path, arm)
        assert trajectory.duration == 0.0
        assert np.array_equal(trajectory.positions, [ready])


def test_a_very_short_path_is_timed(arm, ready):
    trajectory = Toppra().parametrize([ready, ready + 1e-4], arm)
    assert 0.0 < trajectory.duration < 0.1
    assert np.allclose(trajectory.positions[-1], ready + 1e-4)


@pytest.mark.parametrize("place", [0, 2])
def test_waypoints_beside_an_end_do_not_slow_the_motion_down(arm, ready, place):
    """As where a planner's last sample is next to the goal: nearer to the end than to the waypoint between them."""
    first, second = np.eye(7)[:2]
    goal = ready + 0.5 * first
    path = [ready, goal, goal + 1.01e-4 * first, goal + 1e-5 * first + 3e-5 * second][:: 1 if place else -1]
    trajectory = Toppra().parametrize(path, arm)
    assert np.array_equal(trajectory.positions[[0, -1]], [path[0], path[-1]])
    assert trajectory.duration == pytest.approx(Toppra().parametrize([path[0], path[-1]], arm).duration, rel=0.005)


def test_a_path_outside_the_position_limits_is_refused_by_joint(arm, ready):
    beyond = ready.copy()
    beyond[3] = 0.3
    with pytest.raises(TrajectoryError, match=r"panda_joint4 to 0\.3000, allowed"):
        Toppra().parametrize([ready, beyond], arm)


def test_bad_requests_are_refused_by_name(arm, ready):
    with pytest.raises(ManipulationError, match=r"path should have shape \(N, 7\) but has \(2, 6\)"):
        Toppra().parametrize([ready[:6], ready[:6]], arm)
    with pytest.raises(ManipulationError, match="path should be finite"):
        Toppra().parametrize([ready, ready * np.nan], arm)
    with pytest.raises(TrajectoryError, match=r"velocity should be above 0 and at most 1 but is 1\.5"):
        SpeedScale(velocity=1.5)


@pytest.mark.parametrize("name", ["velocity", "acceleration"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize(
    "timing", [Toppra().parametrize, lambda path, limits: RuckigStateToState().plan(*path, limits)]
)
def test_limits_that_allow_no_motion_are_named(arm, name, value, timing):
    given = {key: np.array(getattr(arm, key)) for key in ("lower", "upper", "velocity", "acceleration")}
    given[name][2] = value
    limits = SimpleNamespace(joint_names=arm.joint_names, **given)
    with pytest.raises(TrajectoryError, match=f"the {name} limit of panda_joint3 should be above 0 and finite but is"):
        timing(CORNERS[:2], limits)
