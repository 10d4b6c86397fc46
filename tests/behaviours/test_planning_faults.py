"""Faults of planning as skills tell them: starts and goals in collision, out of reach, numbers that are none."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.engine import FAILURE, SUCCESS
from bestman_bt.messages import Box, MotionErrorCode, PlacedShape, Pose, Pose2D
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.world_model.world_model import Obstacle
from tests.behaviours.at_the_table import failures_of, fastest, tick, tree_of
from tests.behaviours.scripted import codes, load, run, scripted_skills
from tests.behaviours.truth import succeeds, why_not


@pytest.fixture
def arm(bystander: RobotSession):
    """A robot whose beliefs are as before afterwards."""
    skills = bystander.skills
    obstacles = dict(skills.world.obstacles)
    yield bystander
    skills.world.obstacles = obstacles


def believe_board(session: RobotSession, below: float, size: float = 0.3) -> None:
    """A board that nobody has put there, its upper side ``below`` metres under the tool (less: into the fingers)."""
    skills = session.skills
    tool = (skills.map_from_base @ skills.base_from_tool()).position
    place = Pose(tool - np.array([0.0, 0.0, below + 0.01]))
    skills.world.obstacles["board"] = Obstacle(
        "board", (PlacedShape(Box((size, size, 0.02)), place),), skills.clock.now()
    )


def free_now(session: RobotSession) -> bool:
    skills = session.skills
    return skills.arm_world(skills.planning_scene()).is_free(skills.arm_positions())


@pytest.mark.slow
def test_an_arm_that_is_believed_to_touch_something_moves_out_of_it_first(arm: RobotSession) -> None:
    assert succeeds(arm, '<MoveArm posture="home"/>')
    before = arm.skills.arm_positions()
    believe_board(arm, below=0.004)
    assert not free_now(arm)
    failures = len(arm.skills.failures)
    assert succeeds(arm, '<MoveArm posture="carry"/>')
    assert free_now(arm)
    assert len(arm.skills.failures) == failures
    assert np.abs(arm.skills.arm_positions() - before).max() > 0.3


@pytest.mark.slow
def test_an_arm_deep_in_what_is_believed_refuses_and_stays(arm: RobotSession) -> None:
    assert succeeds(arm, '<MoveArm posture="home"/>')
    before = arm.skills.arm_positions()
    believe_board(arm, below=-0.06)
    code, words = why_not(arm, '<MoveArm posture="carry"/>')
    assert code == "start_in_collision"
    assert "board with panda_leftfinger" in words
    assert "lead out of it" in words or "leads out of it" in words or "too far" in words
    assert np.abs(arm.skills.arm_positions() - before).max() < 0.005


def test_a_posture_in_what_is_believed_is_refused_with_the_pair(arm: RobotSession) -> None:
    assert succeeds(arm, '<MoveArm posture="home"/>')
    believe_board(arm, below=0.0)
    board = arm.skills.world.obstacles.pop("board")
    assert succeeds(arm, '<MoveArm posture="carry"/>')
    arm.skills.world.obstacles["board"] = board
    before = arm.skills.arm_positions()
    code, words = why_not(arm, '<MoveArm posture="home"/>')
    assert code == "goal_in_collision"
    assert "board with" in words
    assert np.abs(arm.skills.arm_positions() - before).max() < 0.005


def test_a_place_out_of_the_arms_reach_is_refused(arm: RobotSession) -> None:
    code, words = why_not(arm, '<FindStandPose surface="table" goal="9;9;0.8" stand="{s}"/>')
    assert code == "no_stand"
    assert "lets the arm reach its target" in words


@pytest.mark.parametrize(
    "body",
    [
        '<NavigateTo goal="{flat}"/>',
        '<LookAt point="{pose}"/>',
        '<FindStandPose surface="table" goal="{pose}" stand="{s}"/>',
        '<Push object="can" goal="{pose}"/>',
        '<Retreat distance="{none}"/>',
        '<RunPolicy policy="reach_diff_panda" goal="{pose}"/>',
        '<RunPolicy policy="reach_diff_panda" goal="0.5;0.1;0.9" timeout="{none}"/>',
        '<IsOpen articulation="{door}" at_least="{none}"/>',
        '<IsOpen articulation="{door}" at_most="{none}"/>',
        '<ObjectAt object="cup" goal="{pose}"/>',
    ],
    ids=["NavigateTo", "LookAt", "FindStandPose", "Push", "Retreat", "RunPolicy", "timeout", "IsOpen", "shut", "At"],
)
def test_numbers_that_are_none_are_refused_and_nothing_moves(arm: RobotSession, body: str) -> None:
    tree = arm.load(tree_of(body))
    tree.blackboard.set("pose", Pose([np.nan, 0.0, 0.8]))
    tree.blackboard.set("flat", Pose2D(1.0, np.nan, 0.0))
    tree.blackboard.set("none", np.nan)
    tree.blackboard.set("door", "table/none")
    assert tick(tree, 200) == FAILURE
    ((code, words),) = failures_of(arm)
    assert code == "bad_input", words
    assert "nan" in words
    assert fastest(arm) < 0.01


@pytest.mark.parametrize(("refused", "planned", "status"), [(2, 3, SUCCESS), (3, 3, FAILURE)])
def test_where_another_arm_rests_in_the_way_it_is_planned_again_twice(refused: int, planned: int, status: int) -> None:
    skills = scripted_skills()
    skills.arm.for_planning = lambda joints: joints
    skills.arm.ends["follow"] = [MotionErrorCode.OTHER_ARM_IN_THE_WAY] * refused
    tree = load(skills, '<MoveArm posture="home"/>')
    assert run(skills, tree) == status
    paths = [command[1] for command in skills.arm.asked]
    assert len({id(path) for path in paths}) == planned, "each of them planned anew"
    assert codes(skills) == (["other_arm_in_the_way"] if status == FAILURE else [])
