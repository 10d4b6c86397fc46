"""What own algorithms return is compared with their interface."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Mapping
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
import pytest

from bestman_bt.errors import WrongResultError
from bestman_bt.manipulation.motion_planning.base import MotionPlanner
from bestman_bt.manipulation.policy.base import Observation, Policy
from bestman_bt.manipulation.policy.errors import PolicyModelError
from bestman_bt.messages import Path2D, Pose, Pose2D, Twist2D
from bestman_bt.navigation.global_planning.base import GlobalPlanner, PlanningFailure
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.base import FollowerCommand, PathFollower
from bestman_bt.navigation.slam.base import Slam
from bestman_bt.navigation.slam.frontiers import ExplorationPlanner
from bestman_bt.perception.detection.base import Detector
from bestman_bt.perception.grasp_pose.base import GraspPlanner
from bestman_bt.runtime.algorithms import SLOTS
from bestman_bt.runtime.own_results import with_checked_results
from bestman_bt.runtime.policies import find_policy
from bestman_bt.world_model.semantic_map import SemanticMap

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
        (path(), "Path2D without points"),
    ],
)
def test_a_planner_that_returns_no_path_of_the_map_is_reported(costmap: Costmap, found: Any, words: str) -> None:
    planner = with_checked_results(Plans, GlobalPlanner)(found)
    with pytest.raises(WrongResultError) as raised:
        planner.plan(Pose2D(), GOAL, costmap)
    assert words in str(raised.value)
    assert str(raised.value).endswith(f"(at {__file__}:{inspect.getsourcelines(Plans.plan)[1]})")


def test_a_path_on_the_map_and_a_failure_pass(costmap: Costmap) -> None:
    for found in (path((0.0, 0.0), (1.0, 0.0)), PlanningFailure.no_path(Pose2D(), GOAL)):
        assert with_checked_results(Plans, GlobalPlanner)(found).plan(Pose2D(), GOAL, costmap) is found


@pytest.mark.parametrize("found", [None, FollowerCommand(Twist2D(math.inf, 0.0, 0.0), False, 1.0)])
def test_a_follower_that_commands_nothing_or_without_end_is_reported(found: Any) -> None:
    follower = with_checked_results(Follows, PathFollower)(found)
    follower.reset(path((0.0, 0.0)))
    with pytest.raises(WrongResultError, match=r"Follows\.compute (should return Foll|returned the vel)"):
        follower.compute(Pose2D(), Twist2D(0.0, 0.0, 0.0), 0.05)


@pytest.mark.parametrize(
    ("base", "method", "words"),
    [
        (Detector, "detect", "DetectedScene"),
        (GraspPlanner, "plan", "tuple of GraspCandidate"),
        (MotionPlanner, "plan", "MotionPlan"),
        (ExplorationPlanner, "tour", "list of FrontierView"),
    ],
)
def test_each_interface_is_checked_by_its_annotations(base: type, method: str, words: str) -> None:
    methods = dict.fromkeys([*base.__abstractmethods__, method], lambda self, *arguments: [3])
    made = type("Mine", (base,), methods)
    with pytest.raises(WrongResultError, match=rf"Mine\.{method} should return {words}, got list of int"):
        getattr(with_checked_results(made, base)(), method)()


@pytest.mark.parametrize(
    ("costs", "refused"),
    [({"grass": 0.5}, False), ({"grass": math.nan}, True), ({"grass": 0.5, "sand": np.array([0.0, math.nan])}, True)],
)
def test_a_mapping_that_contains_nan_is_refused(costs: Mapping[str, Any], refused: bool) -> None:
    class Terrain:
        def costs(self) -> Mapping[str, Any]:
            return {}

    class Rough(Terrain):
        def costs(self) -> Mapping[str, Any]:
            return costs

    terrain = with_checked_results(Rough, Terrain)()
    if refused:
        with pytest.raises(WrongResultError, match=r"Rough\.costs returned a dict that contains NaN"):
            terrain.costs()
    else:
        assert terrain.costs() == costs


def test_properties_of_an_interface_are_checked_too() -> None:
    class Lost(Slam):
        reset = predict = add = grid = trajectory = lambda self, *arguments: None

        @property
        def estimate(self) -> Any:
            return (0.0, 0.0, math.nan)

    slam = with_checked_results(Lost, Slam)()
    line = inspect.getsourcelines(Lost.__dict__["estimate"].fget)[1]
    with pytest.raises(WrongResultError, match=rf"Lost\.estimate should return .*got tuple of float \(at .*:{line}\)"):
        _ = slam.estimate


def test_what_is_annotated_is_found_for_each_slot() -> None:
    for base in {slot.base for slot in SLOTS.values()} | {Policy}:
        methods = [name for name, value in vars(base).items() if isinstance(value, FunctionType | property)]
        own = {name: (lambda self: None) for name in methods if not name.startswith("_")}
        checked = with_checked_results(type("Mine", (base,), own), base)
        assert all(vars(checked)[name].__wrapped__ is method for name, method in own.items())


def test_a_policy_of_a_users_own_is_named_by_its_file_and_checked(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(OWN_POLICY)
    policy = find_policy("mine.py:Mine", [tmp_path])
    assert policy.specification.joint_names == ("a",)
    policy.reset()
    with pytest.raises(
        WrongResultError, match=r"Mine\.act should return ActionChunk, got ndarray \(at .*mine\.py:17\)"
    ):
        policy.act(Observation(np.zeros(1), Pose()))
    for name, words in (
        ("mine.py:Mime", "mine.py has no class 'Mime'; did you mean 'Mine'?"),
        ("mine.py:Unfinished", "mine.py:21: Unfinished does not define act, as a Policy has to"),
        ("their.py:Mine", "no such file: their.py"),
    ):
        with pytest.raises(PolicyModelError, match=f"{re.escape(words)}$"):
            find_policy(name, [tmp_path])


OWN_POLICY = """import numpy as np

from bestman_bt.manipulation.policy.base import Policy
from bestman_bt.manipulation.policy.specification import PolicySpecification


class Mine(Policy):
    @property
    def specification(self):
        return PolicySpecification(("a",), "joint_positions", 8, 0.1)

    def reset(self):
        return

    # the actions alone, without their chunk

    def act(self, observation):
        return np.zeros((8, 1))


class Unfinished(Mine):
    act = Policy.act
"""
