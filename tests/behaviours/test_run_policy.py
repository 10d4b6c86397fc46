"""RunPolicy on the simulated robot: it reaches, and a policy that would do harm moves nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.manipulation.policy.base import ActionChunk, Observation, Policy
from bestman_bt.manipulation.policy.errors import PolicyUnreachableError
from bestman_bt.manipulation.policy.features import pose_error
from bestman_bt.manipulation.policy.specification import ActionSpace, PolicySpecification
from bestman_bt.messages import Pose
from bestman_bt.runtime.policies import find_policy
from bestman_bt.runtime.robot_session import RobotSession, session
from bestman_bt.world_model.world_model import HeldObject
from tests.behaviours.at_the_table import PERIOD, failures_of, fastest, tick, tree_of

OPEN_FLOOR = ("scene.robot_start.x=[1.0, 1.0]", "scene.robot_start.y=[-1.0, -1.0]", "scene.robot_start.yaw=[1.9, 1.9]")
FAR = Pose.from_xyz_rpy((0.5, 0.29, 0.84), (np.pi, 0.0, 0.3))
GOAL = Pose.from_xyz_rpy((0.55, 0.15, 0.95), (np.pi, 0.0, 0.2))
WIDE = "-1;-1;0;1.2;1;2"


@pytest.fixture(scope="module")
def opened() -> Iterator[RobotSession]:
    with session(seed=1, settings=OPEN_FLOOR) as robot:
        yield robot


@pytest.fixture
def robot(opened: RobotSession) -> RobotSession:
    """At the home posture, with the shipped policies."""
    skills = opened.skills
    skills.policies = find_policy
    handle = skills.arm.move_to(skills.robot.posture("home", skills.arm_model.joint_names))
    while not handle.done:
        skills.clock.sleep(0.05)
    skills.clock.sleep(0.2)
    return opened


class Scripted(Policy):
    """Gives the chunk that ``answer`` makes of the observation, again and again."""

    def __init__(self, session: RobotSession, answer: Callable[[Observation], ActionChunk], **other: object) -> None:
        fields: dict = {"joint_names": session.skills.arm_model.joint_names, "space": "joint_deltas", "horizon": 0}
        fields |= {"dt": 0.1, "workspace": ((0.2, -0.5, 0.7), (0.8, 0.5, 1.4))}
        self._specification = PolicySpecification(**(fields | other))
        self._answer = answer
        self.closed = False
        session.skills.policies = lambda name, folders: self

    @property
    def specification(self) -> PolicySpecification:
        return self._specification

    def reset(self) -> None:
        self.closed = False

    def act(self, observation: Observation) -> ActionChunk:
        return self._answer(observation)

    def close(self) -> None:
        self.closed = True


def deltas(step: float, joint: int = 0, count: int = 10) -> Callable[[Observation], ActionChunk]:
    actions = np.zeros((count, 7))
    actions[:, joint] = step
    return lambda observation: ActionChunk(actions, 0.1, ActionSpace.JOINT_DELTAS)


def load(robot: RobotSession, goal: Pose | None = GOAL, **ports: object):
    given = " ".join(f'{name}="{value}"' for name, value in ({"policy": "reach_diff_panda"} | ports).items())
    bound = "" if goal is None else 'goal="{goal}"'
    tree = robot.load(tree_of(f"<RunPolicy {given} {bound}/>"))
    if goal is not None:
        tree.blackboard.set("goal", robot.skills.map_from_base @ goal)
    return tree


def run(robot: RobotSession, goal: Pose | None = GOAL, **ports: object) -> int:
    return tick(load(robot, goal, **ports), 800)


def refused(robot: RobotSession, goal: Pose | None = GOAL, **ports: object) -> tuple[str, str]:
    """Code and words of a failure in which the arm did not move."""
    before = robot.skills.arm_positions()
    assert run(robot, goal, **ports) == FAILURE
    np.testing.assert_allclose(robot.skills.arm_positions(), before, atol=2e-3)
    return failures_of(robot)[0]


def test_the_shipped_policy_brings_the_tool_to_the_goal(robot: RobotSession) -> None:
    assert run(robot, policy="reach_diff_panda", position_tolerance=0.005) == SUCCESS
    robot.skills.clock.sleep(0.3)
    error = pose_error(GOAL, robot.skills.base_from_tool())
    assert np.linalg.norm(error[:3]) < 0.008
    assert np.linalg.norm(error[3:]) < 0.1


@pytest.mark.slow
def test_it_does_not_stop_where_one_chunk_meets_the_next(robot: RobotSession) -> None:
    """By encoders: once it has gathered speed the arm keeps moving, several chunks long, until it is near its goal."""
    tree = load(robot, FAR, policy="reach_diff_panda")
    postures, left = [robot.skills.arm_positions()], []
    while tree.tick_once() == RUNNING:
        tree.sleep(PERIOD)
        postures.append(robot.skills.arm_positions())
        left.append(np.linalg.norm(FAR.position - robot.skills.base_from_tool().position))
    speeds = np.abs(np.diff(postures, axis=0)).max(axis=1) / PERIOD
    gathered = int(np.argmax(speeds > 0.5))
    under_way = speeds[gathered : int(np.argmax(np.array(left) < 0.06))]
    assert len(under_way) > 0.6 / PERIOD
    assert under_way.min() > 0.5
    assert (speeds <= 0.5 * 1.1 * max(robot.skills.arm_model.velocity)).all()


def test_halted_in_motion_it_comes_to_rest_and_lets_go_of_the_policy(robot: RobotSession) -> None:
    policy = Scripted(robot, deltas(0.03))
    tree = load(robot)
    while fastest(robot) < 0.1:
        assert tick(tree) == RUNNING
        tree.sleep(0.05)
    tree.halt()
    robot.robot.clock.sleep(0.5)
    assert fastest(robot) < 0.01
    assert policy.closed


def test_a_policy_that_does_nothing_has_stalled(robot: RobotSession) -> None:
    Scripted(robot, deltas(0.0))
    code, why = refused(robot)
    assert code == "stalled"
    assert "from the goal" in why


@pytest.mark.slow
def test_a_policy_that_dithers_runs_into_the_timeout(robot: RobotSession) -> None:
    signs = iter(int(i % 2 == 0) * 2 - 1 for i in range(10000))
    Scripted(robot, lambda observation: deltas(0.01 * next(signs))(observation))
    started = robot.skills.clock.now()
    assert run(robot, timeout=4.0) == FAILURE
    assert failures_of(robot)[0][0] == "timeout"
    assert 4.0 <= robot.skills.clock.now() - started < 6.0


@pytest.mark.slow
def test_time_that_is_up_stops_the_arm_in_the_middle_of_a_chunk(robot: RobotSession) -> None:
    Scripted(robot, deltas(0.004, count=100))
    started = robot.skills.clock.now()
    assert run(robot, timeout=2.0) == FAILURE
    assert failures_of(robot)[0][0] == "timeout"
    assert robot.skills.clock.now() - started < 2.5
    robot.robot.clock.sleep(0.5)
    assert fastest(robot) < 0.01


def test_a_chunk_that_would_leave_the_workspace_moves_nothing(robot: RobotSession) -> None:
    Scripted(robot, deltas(0.2))
    code, why = refused(robot)
    assert code == "workspace"
    assert "would leave the workspace at" in why


def test_a_chunk_that_would_touch_the_robot_itself_moves_nothing(robot: RobotSession) -> None:
    Scripted(robot, deltas(0.1, joint=1, count=20))
    code, why = refused(robot, workspace=WIDE)
    assert code == "collision"
    assert "column_link with panda_" in why


def test_a_policy_that_gives_nan_or_jumps_moves_nothing(robot: RobotSession) -> None:
    Scripted(robot, lambda observation: ActionChunk(np.full((2, 7), np.nan), 0.1, ActionSpace.JOINT_DELTAS))
    assert refused(robot)[0] == "bad_action"
    Scripted(robot, lambda observation: ActionChunk(np.full((2, 7), 0.1), 1e-4, ActionSpace.JOINT_DELTAS))
    code, why = refused(robot, workspace=WIDE)
    assert code == "bad_action"
    assert "jumps" in why


def test_a_server_that_is_gone_is_reported_by_its_code(robot: RobotSession) -> None:
    def lost(observation: Observation) -> ActionChunk:
        raise PolicyUnreachableError("ws://robot:8000 gave no answer")

    Scripted(robot, lost)
    assert refused(robot) == ("policy_unreachable", "ws://robot:8000 gave no answer")


@pytest.mark.parametrize(
    ("other", "goal", "ports", "code"),
    [
        ({}, Pose.from_xyz_rpy((0.55, 0.0, 2.5)), {}, "workspace"),
        ({}, None, {}, "no_goal"),
        ({}, GOAL, {"object": "can"}, "not_found"),
        ({}, GOAL, {"workspace": "1;2;3"}, "bad_input"),
        ({"workspace": None}, GOAL, {}, "no_workspace"),
        ({"robot": "another"}, GOAL, {}, "other_robot"),
        ({"joint_names": ("a", "b")}, GOAL, {}, "other_robot"),
        ({"images": {"ceiling": (48, 64)}}, GOAL, {}, "no_camera"),
        ({"goal_size": 3}, GOAL, {}, "other_goal"),
    ],
)
def test_what_cannot_go_well_is_refused_with_its_reason(
    robot: RobotSession, other: dict, goal: Pose | None, ports: dict, code: str
) -> None:
    Scripted(robot, deltas(0.01), **other)
    assert refused(robot, goal, **ports)[0] == code


def test_an_unknown_policy_is_answered_by_the_closest(robot: RobotSession) -> None:
    tree = load(robot, policy="{which}")
    tree.blackboard.set("which", "reach_dif_panda")
    assert tick(tree, 800) == FAILURE
    code, why = failures_of(robot)[0]
    assert code == "policy_unusable"
    assert "did you mean 'reach_diff_panda'" in why


def test_a_hand_that_is_full_is_not_opened_for_a_policy(robot: RobotSession) -> None:
    Scripted(robot, deltas(0.0), moves_gripper=True, open_width=0.08)
    model = robot.skills.world.models["cup"]
    robot.skills.held = HeldObject("cup", model, Pose(), 0.066)
    try:
        assert refused(robot)[0] == "hand_not_empty"
    finally:
        robot.skills.held = None


@pytest.mark.slow
def test_closing_in_the_air_and_going_up_is_no_lift(robot: RobotSession) -> None:
    """The gripper closes as told and the tool rises: without anything in the hand that is not success."""
    up = deltas(-0.02, joint=1)
    shut = np.zeros(10)
    Scripted(
        robot, lambda observation: replace(up(observation), gripper_widths=shut), moves_gripper=True, open_width=0.08
    )
    assert run(robot, success="lifted", lift=0.03, timeout=3.0, workspace=WIDE) == FAILURE
    assert failures_of(robot)[0][0] in ("timeout", "collision")
    assert robot.skills.held is None


@pytest.mark.slow
def test_without_a_goal_it_ends_when_the_gripper_holds_something(robot: RobotSession) -> None:
    """In empty air it never does: the gripper closes as told, and that does not count as holding."""
    width = np.zeros(10)
    Scripted(
        robot, lambda observation: ActionChunk(np.zeros((10, 7)), 0.1, ActionSpace.JOINT_DELTAS, width), goal_size=0
    )
    gripper = robot.skills.gripper
    handle = gripper.open()
    while not handle.done:
        robot.skills.clock.sleep(0.05)
    assert refused(robot, None, success="holding")[0] == "stalled"
    assert gripper.width() < 0.004
