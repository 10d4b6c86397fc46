"""A motion that fails names its stage, the pose tried last, and the bodies, the joint or the distance: 14 causes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from behaviours.arm_motion import unreached
from behaviours.context import SkillContext
from behaviours.failure import NodeFailure
from behaviours.manipulation.base_placement import FindStandPose
from behaviours.skill import ArmNode, Skill, SkillCoroutine, SkillFailure
from bestman_bt.engine import FAILURE
from bestman_bt.manipulation.collision.planning_scene import AttachedObject, PlanningScene, SceneObstacle
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.messages import Box, Failure, MotionErrorCode, MotionObstacle, MotionStage, PlacedShape, Pose
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.visualization.scene_picture import scene_picture
from tests.behaviours.at_the_table import tick, tree_of

pytestmark = pytest.mark.slow

ALOFT = np.array([0.0, -0.785, 0.0, -2.0, 0.0, 1.571, 0.785])
ASIDE = np.array([1.2, -0.785, 0.0, -2.0, 0.0, 1.571, 0.785])
HURRIED = RRTConnect(max_checks=1500, attempts=1)


class Planted(ArmNode, Skill):
    """Fails with what was planted."""

    plant: Callable[[SkillContext], Any]

    def execute(self) -> SkillCoroutine[None]:
        yield from ()
        type(self).plant(self.skills)


def post(skills: SkillContext, positions: np.ndarray, size: float = 0.1, name: str = "post") -> SceneObstacle:
    """A box about the tool at ``positions``."""
    at = skills.kinematics.tool_pose(positions).position
    return SceneObstacle(name, (PlacedShape(Box((size, size, size)), Pose(at)),))


def plan(skills: SkillContext, start: Any, goal: Any, scene: PlanningScene, planner: RRTConnect = HURRIED) -> None:
    planner.plan(start, [goal], skills.arm_world(scene), skills.arm_model, np.random.default_rng(1))


def empty(skills: SkillContext) -> PlanningScene:
    return PlanningScene(skills.joints.positions())


def goal_in_collision(skills: SkillContext) -> None:
    plan(skills, ALOFT, ASIDE, empty(skills).adding(post(skills, ASIDE)))


def start_in_collision(skills: SkillContext) -> None:
    plan(skills, ALOFT, ASIDE, empty(skills).adding(post(skills, ALOFT)))


def held_object_in_collision(skills: SkillContext) -> None:
    tip = Pose(np.array([0.0, 0.0, 0.3]))
    stick = AttachedObject(
        "stick", (PlacedShape(Box((0.02, 0.02, 0.4)), Pose()),), skills.arm_model.tool_frame, tip, frozenset()
    )
    end = (skills.kinematics.tool_pose(ASIDE) @ Pose(np.array([0.0, 0.0, 0.45]))).position
    crate = SceneObstacle("crate", (PlacedShape(Box((0.08, 0.08, 0.08)), Pose(end)),))
    plan(skills, ALOFT, ASIDE, empty(skills).holding(stick).adding(crate))


def beyond_a_joint_limit(skills: SkillContext) -> None:
    plan(skills, ALOFT, ALOFT + np.array([0, 0, 0, 3.0, 0, 0, 0]), empty(skills))


def self_collision(skills: SkillContext) -> None:
    world = skills.arm_world(empty(skills))
    model, rng = skills.arm_model, np.random.default_rng(0)
    goal = next(q for q in rng.uniform(model.lower, model.upper, (2000, 7)) if not world.is_free(q))
    plan(skills, ALOFT, goal, empty(skills))


def path_blocked(skills: SkillContext) -> None:
    shoulder, reach = skills.kinematics.reach
    ahead = skills.kinematics.tool_pose((ALOFT + ASIDE) / 2).position - shoulder
    yaw = float(np.arctan2(ahead[1], ahead[0]))
    middle = shoulder + (0.35 + reach / 2) * np.array([np.cos(yaw), np.sin(yaw), 0.0])
    fence = Pose.from_xyz_rpy(middle, (0.0, 0.0, yaw))
    wall = SceneObstacle("fence", (PlacedShape(Box((reach, 0.02, 3.0)), fence),))
    plan(skills, ALOFT, ASIDE, empty(skills).adding(wall), RRTConnect(max_checks=300, attempts=1, max_iterations=3))


def narrow_and_out_of_time(skills: SkillContext) -> None:
    gate = post(skills, (ALOFT + ASIDE) / 2, 0.12, "gate")
    plan(skills, ALOFT, ASIDE, empty(skills).adding(gate), RRTConnect(wall_limit=1e-6))


def timed_motion_touches(skills: SkillContext) -> None:
    scene = empty(skills).adding(post(skills, (ALOFT + ASIDE) / 2))
    path = np.linspace(ALOFT, ASIDE, 20)
    skills.motion_planning.follow_path(path, skills.arm_world(scene), skills.arm_model)


def out_of_reach(skills: SkillContext) -> None:
    far = Pose.from_xyz_rpy((3.0, 0.0, 1.0), (np.pi, 0.0, 0.0))
    raise unreached(skills, SkillFailure("no_grasp", "no grasp is within reach"), [far])


def every_posture_collides(skills: SkillContext) -> None:
    world = skills.arm_world(empty(skills).adding(post(skills, ASIDE, 0.2, "lid")))
    raise unreached(skills, SkillFailure("no_grasp", "none is free"), [skills.kinematics.tool_pose(ASIDE)], world)


def contact_stopped_it(skills: SkillContext) -> None:
    raise SkillFailure.of(Failure(MotionErrorCode.COLLISION, "unexpected contact: 31 N", skills.arm.name))


def gripper_blocked(skills: SkillContext) -> None:
    raise SkillFailure.of(Failure(MotionErrorCode.FAULT, "is stuck: the width is 0.04 m", skills.gripper.name))


def off_its_set_point(skills: SkillContext) -> None:
    joint = skills.arm_model.joint_names[3]
    at = dict(zip(skills.arm_model.joint_names, skills.arm_positions().tolist(), strict=True))
    astray = MotionObstacle(MotionStage.EXECUTION, (), joint, 0.2, at)
    raise SkillFailure.of(Failure(MotionErrorCode.TRACKING, f"{joint} is off", skills.arm.name, obstacle=astray))


@dataclass(frozen=True)
class Named:
    """What has to be named: ``body`` in the first pair, ``joint``, or how far beyond, at least."""

    plant: Callable[[SkillContext], None]
    code: str
    stage: MotionStage
    body: str = ""
    joint: str = ""
    beyond: float = 0.0


CAUSES = [
    Named(goal_in_collision, "goal_in_collision", MotionStage.GOAL, "post"),
    Named(start_in_collision, "start_in_collision", MotionStage.START, "post"),
    Named(held_object_in_collision, "goal_in_collision", MotionStage.GOAL, "stick"),
    Named(beyond_a_joint_limit, "goal_out_of_limits", MotionStage.GOAL, joint="panda_joint4", beyond=0.9),
    Named(self_collision, "goal_in_collision", MotionStage.GOAL, "panda"),
    Named(path_blocked, "no_path", MotionStage.PATH, "fence"),
    Named(narrow_and_out_of_time, "timeout", MotionStage.PATH, "gate"),
    Named(timed_motion_touches, "timed_path_invalid", MotionStage.TIMED_MOTION, "post"),
    Named(out_of_reach, "no_grasp", MotionStage.REACH, beyond=1.0),
    Named(every_posture_collides, "no_grasp", MotionStage.REACH, "lid"),
    Named(contact_stopped_it, "collision", MotionStage.EXECUTION, "table"),
    Named(off_its_set_point, "tracking", MotionStage.EXECUTION, joint="panda_joint4", beyond=0.2),
    Named(gripper_blocked, "fault", MotionStage.EXECUTION, "table"),
]


def failure_of(robot: RobotSession, plant: Callable[[SkillContext], None]) -> NodeFailure:
    if Planted.__name__ not in robot.setup.registry:
        robot.setup.registry.register(Planted)
    Planted.plant = staticmethod(plant)
    assert tick(robot.load(tree_of("<Planted/>")), 100) == FAILURE
    return robot.skills.failures[-1]


@pytest.mark.parametrize("cause", CAUSES, ids=lambda cause: cause.plant.__name__)
def test_a_planted_cause_is_named(bystander: RobotSession, cause: Named) -> None:
    failure = failure_of(bystander, cause.plant)
    met = failure.obstacle
    assert met is not None
    assert (failure.error_code, met.stage) == (cause.code, cause.stage)
    if cause.body:
        assert any(cause.body in name for name in met.pairs[0])
    assert met.joint == cause.joint
    assert (met.beyond or 0.0) >= cause.beyond
    assert set(met.positions) == set(bystander.skills.arm_model.joint_names)


def test_a_base_that_finds_no_room_names_the_furniture(
    bystander: RobotSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FindStandPose, "_beside", lambda *_: [])
    assert tick(bystander.load(tree_of('<FindStandPose surface="table" stand="{stand}"/>')), 300) == FAILURE
    met = bystander.skills.failures[-1].obstacle
    assert (met.stage, met.pairs) == (MotionStage.STAND, (("base", "table"),))


def test_the_pair_is_red_in_both_views(bystander: RobotSession) -> None:
    skills = bystander.skills
    scene = empty(skills).adding(post(skills, ASIDE), post(skills, ALOFT, 0.05, "other"))
    bodies = skills.arm_world(scene).bodies(ASIDE)
    met = MotionObstacle(MotionStage.GOAL, (("panda_hand", "post"),))
    links = {name for name, _ in bodies} - {"post", "other"}
    rgb = scene_picture(bodies, links, met).astype(int)
    red = (rgb[..., 0] > rgb[..., 1] + 80) & (rgb[..., 0] > rgb[..., 2] + 80)
    half = rgb.shape[1] // 2
    assert red[60:, :half].sum() > 200
    assert red[60:, half:].sum() > 200
    plain = scene_picture(bodies, links, MotionObstacle(MotionStage.GOAL)).astype(int)
    assert not ((plain[..., 0] > plain[..., 1] + 80) & (plain[..., 0] > plain[..., 2] + 80)).any()
