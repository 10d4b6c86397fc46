"""What own algorithms return is compared with their interface."""

from __future__ import annotations

import inspect
import math
from typing import Any

import numpy as np
import pytest

from bestman_bt.errors import WrongResultError
from bestman_bt.manipulation.motion_planning import MotionPlanner
from bestman_bt.messages import Path2D, Pose2D, Twist2D
from bestman_bt.navigation.global_planning import Costmap, Footprint, GlobalPlanner, PlanningFailure
from bestman_bt.navigation.local_planning import FollowerCommand, PathFollower
from bestman_bt.perception.detection import Detector
from bestman_bt.perception.grasp_pose import GraspPlanner
from bestman_bt.runtime.own_results import with_checked_results
from bestman_bt.world_model import SemanticMap

GOAL = Pose2D(1.0, 0.0, 0.0)


class Plans(GlobalPlanner):
    def __init__(self, found: Any) -> None:
        self.found = found

    def plan(self, start: Pose2D, goal: Pose2D, costmap: Costmap) -> Any:
        return self.found


class Follows(PathFollower):
    def __init__(self, found: Any) -> None:
        self.found = found

    def reset(self, path: Path2D, costmap: Costmap | None = None) -> None:
        return

    def compute(self, pose: Pose2D, velocity: Twist2D, dt: float) -> Any:
        return self.found


@pytest.fixture(scope="module")
def costmap() -> Costmap:
    walls = np.array([[-2.0, -2.0, 2.0, -2.0], [2.0, -2.0, 2.0, 2.0], [2.0, 2.0, -2.0, 2.0], [-2.0, 2.0, -2.0, -2.0]])
    return Costmap.from_map(
        SemanticMap(walls, {}), Footprint(np.array([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]]))
    )


def path(*points: tuple[float, float]) -> Path2D:
    return Path2D(np.array(points, dtype=float).reshape(-1, 2), GOAL)


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (None, "Plans.plan should return Path2D or PlanningFailure, got NoneType"),
        ([np.zeros(2)], "got list of ndarray"),
        (path((0.0, 0.0), (50.0, 50.0), (1.0, 0.0)), "leaves the map at (50.00, 50.00) m"),
        (path((0.0, 0.0), (math.nan, 0.0)), "Path2D with a number that is none (NaN)"),
        (path(), "Path2D without a point"),
    ],
)
def test_a_planner_that_returns_no_path_of_the_map_is_told(costmap: Costmap, found: Any, words: str) -> None:
    planner = with_checked_results(Plans(found), GlobalPlanner)
    with pytest.raises(WrongResultError) as raised:
        planner.plan(Pose2D(), GOAL, costmap)
    assert words in str(raised.value)
    assert str(raised.value).endswith(f"(at {__file__}:{inspect.getsourcelines(Plans.plan)[1]})")


def test_a_path_on_the_map_and_a_failure_pass(costmap: Costmap) -> None:
    for found in (path((0.0, 0.0), (1.0, 0.0)), PlanningFailure.no_path(Pose2D(), GOAL)):
        assert with_checked_results(Plans(found), GlobalPlanner).plan(Pose2D(), GOAL, costmap) is found


@pytest.mark.parametrize("found", [None, FollowerCommand(Twist2D(math.inf, 0.0, 0.0), False, 1.0)])
def test_a_follower_that_commands_nothing_or_without_end_is_told(found: Any) -> None:
    follower = with_checked_results(Follows(found), PathFollower)
    follower.reset(path((0.0, 0.0)))
    with pytest.raises(WrongResultError, match=r"Follows\.compute (should return Foll|returned the vel)"):
        follower.compute(Pose2D(), Twist2D(0.0, 0.0, 0.0), 0.05)


@pytest.mark.parametrize(
    ("base", "method", "words"),
    [
        (Detector, "detect", "DetectedScene"),
        (GraspPlanner, "plan", "tuple of GraspCandidate"),
        (MotionPlanner, "plan", "MotionPlan"),
    ],
)
def test_each_interface_is_checked_by_its_annotations(base: type, method: str, words: str) -> None:
    made = type("Mine", (base,), {method: lambda self, *arguments: [3]})()
    with pytest.raises(WrongResultError, match=rf"Mine\.{method} should return {words}, got list of int"):
        getattr(with_checked_results(made, base), method)()
