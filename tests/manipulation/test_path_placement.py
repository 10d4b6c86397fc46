from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.manipulation.base_placement import PathPlacements, ReachingArm, placements_around
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.kinematics.reachability_map import ReachabilitySampling
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.robot_model.model import ArmModel
from tests.manipulation.kinematics.door_stations import door_stations

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def mobile(diff_panda):
    limits = diff_panda.of(ArmModel)["arm"]
    kinematics = DampedLeastSquares(diff_panda)
    map_ = ReachabilitySampling(samples=200_000).build(kinematics, limits)
    return kinematics, limits, diff_panda.posture("home", limits.joint_names), map_


@pytest.mark.parametrize(("radius", "height", "side"), [(0.45, 1.0, 1), (0.55, 1.3, -1), (0.35, 0.7, 1)])
def test_a_door_is_opened_by_eighty_degrees_from_each_ranked_stand(mobile, radius, height, side, rng):
    kinematics, limits, home, map_ = mobile
    hinge = Pose.from_xyz_rpy((3.0, 1.0, height), (0, 0, 0.4))
    door = door_stations(hinge, radius, side)
    candidates = [
        stand
        for stand in placements_around(door[9][5].position)
        if hinge.inverse().apply([stand.x, stand.y, 0])[0] < -0.35
    ]
    ranked = PathPlacements(enough=4, starts=4).rank(candidates, door, ReachingArm(kinematics, limits, home, rng, map_))
    assert len(ranked) >= 3
    assert [stand.score for stand in ranked] == sorted((stand.score for stand in ranked), reverse=True)
    for stand in ranked:
        assert stand.arc.complete
        assert np.abs(np.diff(stand.arc.path, axis=0)).max() <= 0.4
        assert stand.arc.margin > 0.0
        for q, option, poses in zip(stand.arc.path, stand.arc.options, door, strict=True):
            tool = stand.pose.to_pose() @ kinematics.tool_pose(q)
            assert np.allclose(tool.position, poses[option].position, atol=1e-3)
            assert abs(tool.quaternion @ poses[option].quaternion) > 1 - 1e-5


def test_without_a_map_the_distance_orders_the_stands_and_equal_input_gives_equal_stands(mobile):
    kinematics, limits, home, _ = mobile
    door = door_stations(Pose(np.array([0.0, 0.0, 0.9])), 0.4, 1)
    candidates = [stand for stand in placements_around(door[9][5].position) if stand.x < -0.35]
    first, again = (
        PathPlacements(enough=1).rank(candidates, door, ReachingArm(kinematics, limits, home, np.random.default_rng(5)))
        for _ in range(2)
    )
    assert len(first) == 1
    assert first[0].pose == again[0].pose
    assert np.array_equal(first[0].arc.path, again[0].arc.path)


def test_stands_and_arm_positions_that_are_not_free_are_left_out(mobile, rng):
    kinematics, limits, home, map_ = mobile
    door = door_stations(Pose(np.array([0.0, 0.0, 0.9])), 0.4, 1)
    candidates = [stand for stand in placements_around(door[9][5].position) if stand.x < -0.35]
    ranked = PathPlacements(enough=1).rank(
        candidates, door, ReachingArm(kinematics, limits, home, rng, map_), is_base_free=lambda stand: stand.y > 0.5
    )
    assert ranked
    assert all(stand.pose.y > 0.5 for stand in ranked)
    few = PathPlacements(most=3)
    refuse = lambda stand: lambda q, station: station < 12  # noqa: E731
    assert few.rank(candidates, door, ReachingArm(kinematics, limits, home, rng, map_), is_free_at=refuse) == ()
    partial = PathPlacements(most=3, min_fraction=0.5).rank(
        candidates, door, ReachingArm(kinematics, limits, home, rng, map_), is_free_at=refuse
    )
    assert partial
    assert all(stand.arc.fraction == pytest.approx(12 / 18) for stand in partial)
    assert "refused by the validity check" in partial[0].arc.failure


def test_nothing_is_found_out_of_reach(mobile, rng):
    kinematics, limits, home, map_ = mobile
    door = door_stations(Pose(np.array([0.0, 0.0, 2.6])), 0.4, 1)
    assert (
        PathPlacements().rank(placements_around([0, 0]), door, ReachingArm(kinematics, limits, home, rng, map_)) == ()
    )


def test_stands_lie_round_the_target_and_look_at_it():
    stands = placements_around([2.0, 1.0], (0.5, 0.7), (0.0, math.pi / 2), (0.0,))
    assert len(stands) == 4
    assert stands[0] == Pose2D(2.5, 1.0, stands[0].theta)
    for stand in stands:
        assert np.allclose(stand.inverse().apply([2.0, 1.0])[1], 0.0, atol=1e-9)
        assert stand.inverse().apply([2.0, 1.0])[0] > 0.4


def test_bad_requests_are_refused_by_name(mobile, rng):
    kinematics, limits, home, _ = mobile
    with pytest.raises(ManipulationError, match="at least one station"):
        PathPlacements().rank([], [], ReachingArm(kinematics, limits, home, rng))
    with pytest.raises(ManipulationError, match="reference should be finite"):
        PathPlacements().rank([], [[Pose()]], ReachingArm(kinematics, limits, home * np.nan, rng))


def test_which_stands_are_in_reach_does_not_depend_on_how_many_are_asked_about(mobile):
    kinematics, _, _, map_ = mobile
    door = door_stations(Pose(np.array([0.0, 0.0, 0.9])), 0.4, 1)
    stands = placements_around(door[9][5].position, distances=(0.6, 1.1), turns=(0.0, 0.5))
    together = PathPlacements().promising(stands, door, kinematics, map_)
    alone = [stand for stand in stands if PathPlacements().promising([stand], door, kinematics, map_)]
    assert 0 < len(alone) < len(stands)
    assert set(together) == set(alone)
