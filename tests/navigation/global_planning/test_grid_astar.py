from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Box, Path2D, PlacedShape, Pose, Pose2D
from bestman_bt.navigation.global_planning.base import PlanningFailure, PlanningFailureReason
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.world_model.world_model import Obstacle

START = Pose2D(0.0, 0.0, 0.3)
AT_TABLE = Pose2D(3.0 - 0.28 - 0.06, -0.9, 0.0)
AT_COUNTER = Pose2D(2.9, 1.9 - 0.28 - 0.06, math.pi / 2)
FAR_CORNER = Pose2D(-0.3, -1.5, 0.0)


def poses_along(path: Path2D) -> np.ndarray:
    """Every place and heading that a base passes which turns at the corners, (N, 3)."""
    poses = []
    deltas = np.diff(path.points, axis=0)
    headings = np.arctan2(deltas[:, 1], deltas[:, 0]) + np.where(path.reverse, math.pi, 0.0)
    for i, (point, delta) in enumerate(zip(path.points, deltas, strict=False)):
        along = point + np.linspace(0, 1, 60)[:, None] * delta
        poses.append(np.column_stack([along, np.full(60, headings[i])]))
        heading_next = headings[i + 1] if i + 1 < len(headings) else path.goal.theta
        turn = (heading_next - headings[i] + math.pi) % (2 * math.pi) - math.pi
        corner = np.broadcast_to(path.points[i + 1], (30, 2))
        poses.append(np.column_stack([corner, headings[i] + turn * np.linspace(0, 1, 30)]))
    return np.vstack(poses)


@pytest.mark.parametrize(
    ("start", "goal"), [(START, AT_TABLE), (AT_TABLE, AT_COUNTER), (AT_COUNTER, FAR_CORNER), (FAR_CORNER, START)]
)
def test_the_footprint_touches_nothing_along_a_path(costmap, start, goal):
    path = GridAStar().plan(start, goal, costmap)
    assert isinstance(path, Path2D)
    assert costmap.footprint_clearance(poses_along(path)).min() > 0.0


def test_a_path_begins_at_the_start_and_ends_at_the_goal(costmap):
    path = GridAStar().plan(START, AT_TABLE, costmap)
    np.testing.assert_allclose(path.points[[0, -1]], [START.xy, AT_TABLE.xy])
    assert path.goal == AT_TABLE


def test_a_stand_pose_is_entered_straight_along_its_heading(costmap):
    path = GridAStar().plan(START, AT_TABLE, costmap)
    last = path.points[-1] - path.points[-2]
    assert math.atan2(last[1], last[0]) == pytest.approx(AT_TABLE.theta)
    assert np.linalg.norm(last) == pytest.approx(0.4, abs=0.03)


def test_furniture_is_left_by_backing_out(costmap):
    path = GridAStar().plan(AT_TABLE, AT_COUNTER, costmap)
    assert path.reverse.tolist() == [True] + [False] * (len(path.points) - 2)


def test_a_base_inside_a_margin_may_back_out_of_it(costmap):
    too_close = Pose2D(AT_TABLE.x + 0.03, AT_TABLE.y, 0.02)
    assert costmap.clearance_at(too_close) < 0.0
    assert isinstance(GridAStar().plan(too_close, AT_COUNTER, costmap), Path2D)


def test_in_the_open_a_path_is_straight(costmap):
    path = GridAStar().plan(Pose2D(-0.3, -1.8, 0.0), Pose2D(0.9, -0.6, 0.0), costmap)
    assert path.length == pytest.approx(math.hypot(1.2, 1.2), rel=0.02)


def test_a_door_narrower_than_the_turning_circle_is_still_passed(kitchen, footprint):
    sides = [
        Obstacle(name, (PlacedShape(Box((0.1, 0.2, 2.0)), Pose.from_xyz_rpy((1.55, y, 1.0))),), 0.0)
        for name, y in (("left", 0.1 + 0.735), ("right", 0.02))
    ]
    costmap = Costmap.from_map(kitchen, footprint, sides)
    path = GridAStar().plan(START, AT_TABLE, costmap)
    assert isinstance(path, Path2D)
    assert 2 * costmap.footprint.circumscribed_radius > 0.735 - 0.12
    assert costmap.footprint_clearance(poses_along(path)).min() > 0.0


def test_a_closed_door_leaves_no_path(kitchen, footprint):
    door = Obstacle("door", (PlacedShape(Box((0.04, 0.95, 2.0)), Pose.from_xyz_rpy((1.55, 0.475, 1.0))),), 0.0)
    failure = GridAStar().plan(START, AT_TABLE, Costmap.from_map(kitchen, footprint, [door]))
    assert isinstance(failure, PlanningFailure)
    assert failure.reason is PlanningFailureReason.NO_PATH


@pytest.mark.parametrize(
    ("start", "goal", "reason"),
    [
        (START, Pose2D(3.4, -0.9, 0.0), PlanningFailureReason.GOAL_BLOCKED),
        (START, Pose2D(1.55, -1.0, 0.0), PlanningFailureReason.GOAL_BLOCKED),
        (START, Pose2D(AT_TABLE.x, AT_TABLE.y, math.radians(30)), PlanningFailureReason.GOAL_BLOCKED),
        (START, Pose2D(20.0, 0.0, 0.0), PlanningFailureReason.GOAL_OUTSIDE),
        (Pose2D(20.0, 0.0, 0.0), START, PlanningFailureReason.START_OUTSIDE),
        (Pose2D(3.4, -0.9, 0.0), START, PlanningFailureReason.START_BLOCKED),
    ],
)
def test_what_cannot_be_planned_is_answered_with_the_reason(costmap, start, goal, reason):
    failure = GridAStar().plan(start, goal, costmap)
    assert isinstance(failure, PlanningFailure)
    assert failure.reason is reason


def test_equal_questions_have_equal_answers(costmap):
    first, second = (GridAStar().plan(START, AT_COUNTER, costmap) for _ in range(2))
    np.testing.assert_array_equal(first.points, second.points)


@pytest.mark.parametrize(
    ("ahead", "aside", "turned", "goes_on"),
    [(-0.41, 0.003, 2.0, True), (-0.3, 0.003, 0.4, True), (-0.06, 0.003, 0.4, False), (-0.06, -0.003, 0.2, True),
     (-0.06, 0.01, 0.2, False), (-0.3, 0.03, 0.2, False), (-0.6, 0.0, 0.0, False)],
)  # fmt: skip
def test_on_the_straight_way_into_a_goal_the_base_goes_on(costmap, ahead, aside, turned, goes_on):
    start = AT_TABLE @ Pose2D(ahead, aside, turned)
    path = GridAStar().plan(start, AT_TABLE, costmap)
    assert isinstance(path, Path2D)
    assert (len(path.points) == 2) == goes_on


def test_the_straight_way_into_a_goal_is_no_reason_to_touch_something(kitchen, footprint):
    place = AT_TABLE @ Pose2D(-0.09, 0.32, 0.0)
    crate = Obstacle("crate", (PlacedShape(Box((0.06, 0.06, 1.0)), Pose.from_xyz_rpy((place.x, place.y, 0.5))),), 0.0)
    path = GridAStar().plan(
        AT_TABLE @ Pose2D(-0.3, -0.01, 0.25), AT_TABLE, Costmap.from_map(kitchen, footprint, [crate])
    )
    assert isinstance(path, PlanningFailure) or len(path.points) > 2
