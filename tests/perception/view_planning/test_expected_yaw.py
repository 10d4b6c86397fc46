from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Box, CameraIntrinsics, PlacedShape, Pose, YawSet
from bestman_bt.perception.pose_estimation.base import PoseHypothesis
from bestman_bt.perception.view_planning import ExpectedYaw, looking_at
from bestman_bt.scene.object_file import read_object

K = CameraIntrinsics(640, 480, 433.0, 433.0, 320.0, 239.0)
PLANNER = ExpectedYaw()


def believed(name: str, arcs: tuple[tuple[float, float], ...], yaw: float = 0.0) -> PoseHypothesis:
    model = read_object(name)
    pose = Pose.from_xyz_rpy((0.6, 0.1, 0.8), (0.0, 0.0, yaw))
    return PoseHypothesis(model, pose, 0.9, np.eye(6) * 1e-6, YawSet(arcs), 0.001, 1.0, 0.9, 0.0, 0.0)


def test_candidates_look_at_the_object_upright_and_from_near_enough() -> None:
    mug = believed("mug", ((0.0, 0.5),))
    views = PLANNER.candidates(mug, K)
    assert len(views) == 60
    for view in views:
        x, y, z = view.inverse().apply(mug.pose.position)
        assert 0.25 < z < 0.5
        assert math.hypot(x, y) < 0.002
        assert view.position[2] > mug.pose.position[2]
        # The image's y axis points down.
        assert view.rotation[2, 1] < -0.3


def test_a_large_object_is_looked_at_from_farther_away() -> None:
    far = PLANNER.candidates(believed("cereal_box", ()), K)
    near = PLANNER.candidates(believed("tin", ()), K)
    assert min(np.linalg.norm(v.position - [0.6, 0.1, 0.8]) for v in far) > 0.35
    assert min(np.linalg.norm(v.position - [0.6, 0.1, 0.8]) for v in near) < 0.32


def test_the_view_that_shows_the_handle_is_ranked_before_the_one_that_hides_it() -> None:
    mug = believed("mug", ((0.0, 0.6),))
    hides = looking_at(mug.pose.position, math.pi, math.radians(25.0), 0.4)
    shows = looking_at(mug.pose.position, math.pi / 2, math.radians(45.0), 0.4)
    first, second = PLANNER.rank(mug, [hides, shows], K)
    assert first.index == 1
    assert first.expected_yaw_width < 0.3
    assert second.expected_yaw_width > 2 * first.expected_yaw_width


def test_a_view_behind_an_obstacle_promises_nothing() -> None:
    mug = believed("mug", ((0.0, 0.6),))
    views = [looking_at(mug.pose.position, side * math.pi / 2, math.radians(40.0), 0.4) for side in (1, -1)]
    wall = PlacedShape(Box((0.6, 0.02, 0.6)), Pose(mug.pose.position + np.array([0.0, 0.15, 0.0])))
    free = PLANNER.rank(mug, views, K)
    blocked = PLANNER.rank(mug, views, K, [wall])
    assert abs(free[0].expected_yaw_width - free[1].expected_yaw_width) < 0.1
    assert [view.index for view in blocked] == [1, 0]
    assert blocked[1].expected_yaw_width == pytest.approx(mug.yaw_set.width)
    assert blocked[1].visible_fraction < 0.05


def test_a_view_that_misses_the_object_promises_nothing() -> None:
    mug = believed("mug", ((0.0, 0.6),))
    past = looking_at(mug.pose.position + np.array([0.0, 2.0, 0.0]), 0.0, 0.5, 0.4)
    assert PLANNER.rank(mug, [past], K)[0].expected_yaw_width == pytest.approx(mug.yaw_set.width)


@pytest.mark.slow
def test_two_far_apart_yaws_are_distinguished_by_either_s_handle() -> None:
    mug = believed("mug", ((0.0, 0.1), (math.pi, 0.1)))
    best = PLANNER.rank(mug, PLANNER.candidates(mug, K), K)[0]
    assert best.expected_yaw_width <= mug.yaw_set.width / 2 + 1e-9


@pytest.mark.slow
def test_of_an_object_without_a_yaw_the_best_view_shows_most() -> None:
    bowl = believed("bowl", ())
    ranked = PLANNER.rank(bowl, PLANNER.candidates(bowl, K), K)
    assert {view.expected_yaw_width for view in ranked} == {0.0}
    fractions = [view.visible_fraction for view in ranked]
    assert fractions == sorted(fractions, reverse=True)


@pytest.mark.slow
def test_equal_input_gives_equal_ranks_and_no_candidate_gives_none() -> None:
    mug = believed("mug", ((0.3, 0.6),), 0.3)
    views = PLANNER.candidates(mug, K)[:20]
    one, other = PLANNER.rank(mug, views, K), ExpectedYaw().rank(mug, views, K)
    assert [(v.index, v.expected_yaw_width) for v in one] == [(v.index, v.expected_yaw_width) for v in other]
    assert PLANNER.rank(mug, [], K) == ()


def test_parameters_for_a_camera_on_a_mast_give_farther_views() -> None:
    planner = ExpectedYaw(distances=(0.9, 1.2), azimuths=6)
    mug = believed("mug", ((0.0, 0.6),))
    views = planner.candidates(mug, K)
    assert len(views) == 36
    assert all(0.85 < np.linalg.norm(view.position - mug.pose.position) < 1.25 for view in views)
