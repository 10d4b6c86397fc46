from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics.arc_path import ArcSearch
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.trajectory.base import SpeedScale
from bestman_bt.manipulation.trajectory.toppra import Toppra
from bestman_bt.messages import Pose
from tests.manipulation.kinematics.door_stations import door_stations
from tests.rigs.limit_usage import limit_usage


@pytest.fixture(scope="module")
def door():
    """In front of the fixed Panda, to its left, hinge on the far side: the tool comes towards the robot."""
    return door_stations(Pose(np.array([0.6, -0.1, 0.45])), 0.35, 1)


@pytest.fixture(scope="module")
def grasped(kinematics, ready, door):
    return kinematics.solve(door[0][5], ready, np.random.default_rng(0)).best


def test_the_path_follows_every_station_on_one_branch_within_the_limits(kinematics, arm, door, grasped):
    arc = ArcSearch().path(kinematics, door, grasped, arm)
    assert arc.complete
    assert arc.fraction == 1.0
    assert len(arc.path) == len(door)
    for q, option, poses in zip(arc.path, arc.options, door, strict=True):
        tool = kinematics.tool_pose(q)
        assert np.allclose(tool.position, poses[option].position, atol=1e-4)
        assert abs(tool.quaternion @ poses[option].quaternion) > 1 - 1e-6
    assert np.abs(np.diff(arc.path, axis=0)).max() <= 0.4
    assert np.abs(np.diff(arc.options)).max() <= 1
    assert np.all(arc.path >= arm.lower)
    assert np.all(arc.path <= arm.upper)
    assert 0.0 < arc.margin <= 1.0


def test_a_hand_that_may_turn_gets_farther_than_one_that_may_not(kinematics, arm, ready):
    door = door_stations(Pose(np.array([0.6, -0.1, 0.45])), 0.4, 1, sweep=math.radians(85))
    start = kinematics.solve(door[0][5], ready, np.random.default_rng(0)).best
    stiff = ArcSearch().path(kinematics, [[poses[5]] for poses in door], start, arm)
    free = ArcSearch().path(kinematics, door, start, arm)
    assert free.fraction > stiff.fraction + 0.3


def test_redundancy_keeps_the_joints_from_their_limits(kinematics, arm, door, grasped):
    pushed = ArcSearch().path(kinematics, door, grasped, arm)
    least = ArcSearch(centring=0.0).path(kinematics, door, grasped, arm)
    assert pushed.margin >= least.margin


def test_an_arc_out_of_reach_ends_where_the_arm_does(kinematics, arm, ready):
    start = kinematics.tool_pose(ready)
    line = [[Pose(np.add(start.position, [0.03 * i, 0, 0]), start.quaternion)] for i in range(40)]
    arc = ArcSearch().path(kinematics, line, ready, arm)
    assert not arc.complete
    assert 0.1 < arc.fraction < 0.9
    assert arc.failure == f"no smooth inverse kinematics at station {len(arc.path)} of 40"
    reached = kinematics.tool_pose(arc.path[-1])
    assert np.allclose(reached.position, line[len(arc.path) - 1][0].position, atol=1e-4)


def test_the_validity_check_is_asked_station_by_station(kinematics, arm, door, grasped):
    arc = ArcSearch().path(kinematics, door, grasped, arm, is_free=lambda q, station: station < 7)
    assert len(arc.path) == 7
    assert "refused by the validity check at station 7" in arc.failure


def test_a_start_elsewhere_reaches_nothing_and_reports_it(kinematics, arm, door, grasped):
    away = grasped.copy()
    away[0] += 0.9
    arc = ArcSearch().path(kinematics, door, away, arm)
    assert arc.path.shape == (0, 7)
    assert arc.fraction == 0.0
    assert "station 0" in arc.failure


def test_a_stretched_arm_is_followed_into_and_out_of_its_singularity_or_refused_smoothly(kinematics, arm):
    """Near the edge of the workspace steps grow without bound: none of them may jump."""
    stretched = np.array([0.0, 0.7, 0.0, -0.12, 0.0, 1.2, 0.785])
    tool = kinematics.tool_pose(stretched)
    line = [[Pose(np.add(tool.position, [0.0, 0.01 * i, 0.004 * i]), tool.quaternion)] for i in range(25)]
    arc = ArcSearch().path(kinematics, line, stretched, arm)
    assert len(arc.path) >= 1
    assert np.abs(np.diff(arc.path, axis=0)).max(initial=0.0) <= 0.4
    assert np.isfinite(arc.path).all()


def test_bad_requests_are_refused_by_name(panda, kinematics, arm, door, grasped):
    with pytest.raises(ManipulationError, match="at least one station"):
        ArcSearch().path(kinematics, [], grasped, arm)
    with pytest.raises(ManipulationError, match="at least one tool pose"):
        ArcSearch().path(kinematics, [door[0], []], grasped, arm)
    with pytest.raises(ManipulationError, match=r"start of an arc should be 7 .* \(6,\)"):
        ArcSearch().path(kinematics, door, grasped[:6], arm)
    with pytest.raises(ManipulationError, match="start of an arc should be finite"):
        ArcSearch().path(DampedLeastSquares(panda), door, grasped * np.nan, arm)
    with pytest.raises(ManipulationError, match="stations should be finite"):
        ArcSearch().path(kinematics, [[Pose(np.array([np.nan, 0, 0]))]], grasped, arm)


def test_the_timed_arc_keeps_the_limits_and_the_bar_on_its_circle(kinematics, arm, ready):
    door = door_stations(Pose(np.array([0.6, -0.1, 0.45])), 0.35, 1, sweep=math.radians(60), stations=30)
    arc = ArcSearch().path(kinematics, door, kinematics.solve(door[0][5], ready, np.random.default_rng(0)).best, arm)
    trajectory = Toppra().parametrize(arc.path, arm, SpeedScale(0.2, 0.2))
    assert limit_usage(trajectory, arm).within(0.21)
    radius = np.hypot(0.05, 0.35)
    for time in np.linspace(0.0, trajectory.duration, 200):
        from_hinge = kinematics.tool_pose(trajectory.sample(time)[0]).position - [0.6, -0.1, 0.45]
        assert abs(np.hypot(*from_hinge[:2]) - radius) < 2e-3
        assert abs(from_hinge[2]) < 2e-3
