"""What the skills come to believe from one look at the table, against the truth."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from behaviours.manipulation.grasp_candidates import grasp_candidates
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import FAILURE, SUCCESS
from bestman_bt.messages import Pose
from bestman_bt.runtime.robot_session import RobotSession, open_session
from hal.simulation.ground_truth import GroundTruth
from tests.behaviours.at_the_table import failures_of, standing_at_a_table, tick, tree_of

LOOK = """<Sequence>
  <LookAt surface="table"/>
  <DetectObject object="cup" surface="table" pose="{detected}"/>
  <LookAt object="cup"/>
  <EstimatePose object="cup" pose="{estimated}"/>
</Sequence>"""


@pytest.fixture(scope="module")
def looked() -> Iterator[tuple[RobotSession, GroundTruth, dict[str, Any]]]:
    """A robot that has looked at the table, the truth, and what the look gave."""
    truths: list[GroundTruth] = []
    with open_session(
        load_run("fetch_cup", seed=1, settings=standing_at_a_table(75.0)),
        lambda robot: truths.append(GroundTruth(robot)),
    ) as opened:
        tree = opened.load(tree_of(LOOK))
        assert tick(tree, 100) == SUCCESS
        yield opened, truths[0], dict(tree.blackboard.items())


def test_the_pose_of_the_cup_is_within_a_centimetre_of_the_truth(looked) -> None:
    _, truth, found = looked
    for name in ("detected", "estimated"):
        assert np.linalg.norm(found[name].position - truth.object_pose("cup").position) < 0.01


def test_everything_on_the_table_is_believed_and_nothing_else(looked) -> None:
    robot, truth, _ = looked
    on_table = {name for name in truth.object_names if "table" in truth.supports(name)}
    assert set(robot.skills.world.objects) == on_table
    assert "table/surface" in robot.skills.world.obstacles


@pytest.mark.parametrize("leaf", ['<ObjectVisible object="cup" max_age="60"/>', '<Reachable object="cup"/>'])
def test_conditions_hold_for_what_was_seen(looked, leaf: str) -> None:
    assert tick(looked[0].load(tree_of(leaf))) == SUCCESS


def test_what_was_seen_long_ago_is_not_visible_any_more(looked) -> None:
    robot, _, _ = looked
    robot.robot.clock.sleep(0.3)
    assert tick(robot.load(tree_of('<ObjectVisible object="cup" max_age="0.2"/>'))) == FAILURE
    assert "s ago" in failures_of(robot)[0][1]


@pytest.mark.parametrize(("off", "status"), [(0.012, SUCCESS), (0.05, FAILURE)])
def test_an_object_is_at_a_goal_within_its_tolerance(looked, off: float, status: int) -> None:
    robot, truth, _ = looked
    x, y, z = truth.object_pose("cup").position
    tree = robot.load(tree_of(f'<ObjectAt object="cup" goal="{x + off};{y};{z}" tolerance="0.02"/>'))
    assert tick(tree) == status


@pytest.mark.slow
def test_there_is_room_where_the_table_is_empty_and_none_where_the_can_stands(looked) -> None:
    robot, truth, found = looked
    body = '<FindPlacePose object="cup" surface="table" goal="{there}" pose="{place}"/>'
    beside = found["estimated"].position + truth.furniture_pose("table").rotation @ [-0.1, 0.15, 0.0]
    tree = robot.load(tree_of(body))
    tree.blackboard.set("there", Pose(beside))
    assert tick(tree, 100) == SUCCESS
    place = tree.blackboard.get("place")
    assert place.position[:2] == pytest.approx(beside[:2], abs=1e-6)
    assert place.position[2] == pytest.approx(truth.object_pose("cup").position[2], abs=0.005)
    tree.blackboard.set("there", truth.object_pose("can"))
    assert tick(tree, 100) == FAILURE
    ((code, why),) = failures_of(robot)
    assert code == "goal_taken"
    assert "of the 12 cm disc at the goal is taken" in why


def test_planned_grasps_fit_the_cup_and_come_best_first(looked) -> None:
    robot, _, _ = looked
    tree = robot.load(tree_of('<PlanGrasp object="cup" grasps="{grasps}" count="3"/>'))
    assert tick(tree, 100) == SUCCESS
    grasps = tree.blackboard.get("grasps")
    assert 1 <= len(grasps) <= 3
    assert all(0.05 < grasp.candidate.width < 0.08 for grasp in grasps)


def test_grasps_come_from_the_given_direction_alone(looked) -> None:
    robot, _, _ = looked
    belief = robot.skills.world.objects["cup"]
    offered = {one.approach for one in grasp_candidates(robot.skills, belief)}
    assert offered == {"top", "side"}
    tree = robot.load(tree_of('<PlanGrasp object="cup" grasps="{grasps}" count="8" approach="top"/>'))
    assert tick(tree, 100) == SUCCESS
    assert {grasp.candidate.approach for grasp in tree.blackboard.get("grasps")} == {"top"}
    assert {one.approach for one in grasp_candidates(robot.skills, belief, "side")} == {"side"}


def test_each_time_it_is_asked_again_another_stand_is_found(looked) -> None:
    robot, _, _ = looked
    tree = robot.load(tree_of('<FindStandPose object="cup" surface="table" stand="{stand}"/>'))
    stands = []
    for _ in range(2):
        assert tick(tree, 100) == SUCCESS
        stands.append(tree.blackboard.get("stand"))
    assert stands[0].distance_to(stands[1]) > 0.05
    assert all(stand.distance_to(robot.skills.world.objects["cup"].pose.to_pose2d()) < 1.0 for stand in stands)
