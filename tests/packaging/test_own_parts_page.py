"""Every example of the page "Put your own in" does what it says, as it is written there."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.rendered_table import random_table
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import load_tree
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.evaluation.result import Outcome
from bestman_bt.facts.predicate import Beliefs
from bestman_bt.manipulation.motion_planning.base import MotionPlanningError
from bestman_bt.messages import Box, Path2D, PlacedShape, Pose, Pose2D, Twist2D
from bestman_bt.navigation.global_planning.base import PlanningFailure
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.perception.grasp_pose.base import GraspTarget
from bestman_bt.registry import ALGORITHMS, BUILDERS, PLANNERS, PREDICATES, undone
from bestman_bt.robot_model.model import GripperModel
from bestman_bt.runtime.algorithms import Algorithms
from bestman_bt.runtime.resolved_config import ResolvedConfig, prepare
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.symbolic.problem import Fact, Operator, PlanningProblem, Unsolvable
from bestman_bt.world_model.semantic_map import SemanticMap
from tests.manipulation.motion_planning.joint_worlds import TWO, JointWorld
from tests.robot_models import base_model

PAGE = Path(__file__).parents[2] / "docs" / "own_parts.md"
EXAMPLES = dict(re.findall(r"^```python\n# (\w+\.py)\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL))
CHOSEN = {
    "global_planning": "straight",
    "local_planning": "turn_and_go",
    "detection": "every_model",
    "grasp_pose": "from_above",
    "motion_planning": "over_the_middle",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The examples as files; what they have registered is forgotten afterwards."""
    folder = tmp_path_factory.mktemp("examples")
    for name, text in EXAMPLES.items():
        (folder / name).write_text(text)
    with undone(ALGORITHMS, PLANNERS, BUILDERS, PREDICATES):
        yield folder


@pytest.fixture(scope="module")
def setup(folder: Path) -> ResolvedConfig:
    """A run with all examples chosen."""
    settings = [f"algorithms.{slot}.algorithm={name}" for slot, name in CHOSEN.items()]
    settings.append("algorithms.global_planning.spacing=0.1")
    plugins = [str(folder / name) for name in EXAMPLES if name != "greet.py"]
    return prepare(load_run("fetch_cup", settings=settings, plugins=plugins, tree=folder / "greet.py"))


@pytest.fixture(scope="module")
def algorithms(setup: ResolvedConfig) -> Any:
    return Algorithms(setup.config, setup.robot_model)


@pytest.fixture(scope="module")
def costmap() -> Costmap:
    walls = [(-1, -2, 5, -2), (5, -2, 5, 2), (5, 2, -1, 2), (-1, 2, -1, -2), (2, -2, 2, 0)]
    corners = np.array([[-0.25, -0.25], [0.25, -0.25], [0.25, 0.25], [-0.25, 0.25]])
    return Costmap.from_map(SemanticMap(np.array(walls, dtype=float), {}), Footprint(corners))


def test_no_example_is_long() -> None:
    assert len(EXAMPLES) == 9
    assert max(len(text.splitlines()) for text in EXAMPLES.values()) <= 33


def test_the_tree_has_its_own_skill(setup: ResolvedConfig) -> None:
    tree = load_tree(Path(setup.config.task.tree), setup.registry)
    assert [node.name for node in tree.nodes] == ["greet", "Nod", "again"]


def test_the_global_planner_drives_straight_or_reports_that_it_cannot(algorithms: Any, costmap: Costmap) -> None:
    planner = algorithms.global_planning
    path = planner.plan(Pose2D(0.0, 1.0, 0.0), Pose2D(4.0, 1.0, 1.0), costmap)
    assert isinstance(path, Path2D)
    assert np.linalg.norm(np.diff(path.points, axis=0), axis=1).max() <= 0.1 + 1e-9
    np.testing.assert_allclose(path.points[[0, -1]], [[0.0, 1.0], [4.0, 1.0]])
    assert isinstance(planner.plan(Pose2D(0.0, -1.0, 0.0), Pose2D(4.0, -1.0, 0.0), costmap), PlanningFailure)


def test_the_follower_ends_in_the_goal(setup: ResolvedConfig, costmap: Costmap) -> None:
    follower, dt = Algorithms(setup.config, setup.robot_model).local_planning, 0.05
    follower.configure(base_model(costmap.footprint.corners, max_vx=0.5, max_wz=1.0, max_acceleration=0.5))
    goal = Pose2D(2.0, 1.0, math.pi / 2)
    follower.reset(Path2D(np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 1.0]]), goal))
    pose, twist = Pose2D(0.0, 0.0, 0.5), Twist2D()
    for _ in range(1000):
        command = follower.compute(pose, twist, dt)
        assert abs(command.twist.vx - twist.vx) <= 0.5 * dt + 1e-9 or command.done
        twist = command.twist
        pose = pose @ Pose2D(twist.vx * dt, 0.0, twist.wz * dt)
        if command.done:
            break
    assert command.done
    assert pose.distance_to(goal) < 0.01
    assert abs(pose.theta - goal.theta) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 4])
def test_a_base_arrives_by_the_follower(folder: Path, seed: int) -> None:
    chosen = ["algorithms.local_planning.algorithm=turn_and_go"]
    plugins = [str(folder / "turn_and_go.py")]
    result = run_episode(load_run("navigate_kitchen", seed=seed, settings=chosen, plugins=plugins))
    assert result.outcome is Outcome.SUCCESS, result.failure


def test_the_detector_finds_what_stands_on_the_table(algorithms: Any) -> None:
    table = random_table(2)
    models = [thing.model for thing in table.objects]
    scene = algorithms.detection.detect(table.view, table.region, models, np.random.default_rng(0))
    assert {detection.name for detection in scene.detections} & {model.name for model in models}


def test_the_grasp_planner_takes_a_box_across_its_smaller_side(setup: ResolvedConfig, algorithms: Any) -> None:
    (gripper,) = setup.robot_model.of(GripperModel).values()
    box = PlacedShape(Box((0.06, 0.04, 0.1)), Pose.from_xyz_rpy((0.5, 0.1, 0.8), (0.0, 0.0, 0.3)))
    best, other = algorithms.grasp_pose.plan(GraspTarget(box), gripper, 0.75)
    assert (best.width, other.width) == (0.04, 0.06)
    np.testing.assert_allclose(best.grasp.rotation[:, 2], [0.0, 0.0, -1.0], atol=1e-9)
    assert abs(best.grasp.rotation[:2, 1] @ [-math.sin(0.3), math.cos(0.3)]) == pytest.approx(1.0)
    assert best.pre_grasp.position[2] > best.lift.position[2] > best.grasp.position[2] > 0.75
    top = 0.85
    assert top - best.grasp.position[2] < gripper.part.finger_depth - 0.008


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 21])
def test_things_are_placed_by_the_grasp_planner(folder: Path, seed: int) -> None:
    chosen = [f"algorithms.grasp_pose.algorithm={folder / 'from_above.py'}:FromAbove"]
    result = run_episode(load_run("pick_place_table", seed=seed, robot="diff_panda", settings=chosen))
    assert result.outcome is Outcome.SUCCESS, result.failure


def test_the_motion_planner_goes_around_a_wall(algorithms: Any) -> None:
    planner = algorithms.motion_planning.planner
    world = JointWorld(lambda q: not (abs(q[0]) < 0.1 and q[1] < 1.0))
    plan = planner.plan([-1.0, 0.0], [[1.0, 0.0]], world, TWO, np.random.default_rng(1))
    assert len(plan.path) == 3
    np.testing.assert_allclose(plan.path[[0, -1]], [[-1.0, 0.0], [1.0, 0.0]])
    closed = JointWorld(lambda q: abs(q[0]) > 0.1)
    with pytest.raises(MotionPlanningError, match="no way over one posture"):
        planner.plan([-1.0, 0.0], [[1.0, 0.0]], closed, TWO, np.random.default_rng(1))


def steps(goal: str) -> PlanningProblem:
    operators = tuple(
        Operator(f"Step{n}", add=(Fact(f"at{n + 1}"),), pre=parse_literals(f"at{n}"), cost=n + 1.0) for n in range(3)
    )
    return PlanningProblem({}, frozenset({Fact("at0")}), parse_literals(goal), operators)


def test_the_task_planner_plans_and_the_builder_retries_each_action(setup: ResolvedConfig) -> None:
    planner, builder = PLANNERS.resolve("shortest")(), BUILDERS.resolve("stubborn")()
    problem = steps("at2")
    plan = planner.plan(problem)
    assert [str(action) for action in plan.actions] == ["Step0()", "Step1()"]
    with pytest.raises(Unsolvable):
        planner.plan(steps("at9"))
    root = builder.build(plan, problem.goal).document().root
    tags = [element.tag for element in root.iter()]
    assert tags.count("RetryUntilSuccessful") == 2
    assert tags[-1] == "Holds"


def test_the_predicate_is_asked_of_beliefs(setup: ResolvedConfig) -> None:
    tall = PREDICATES.resolve("tall")
    heights = {name: np.ptp(model.bounds()[:, 2]) for name, model in setup.world_model.models.items()}
    beliefs = Beliefs(setup.world_model)
    assert {name for name in heights if tall.holds(beliefs, name)} == {n for n, h in heights.items() if h > 0.15}
