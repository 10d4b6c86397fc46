"""What was taken from the side is carried where the head camera sees past it and the arm stays over the base."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from behaviours.arm_motion import move_free, with_held_margin
from behaviours.manipulation.move_arm import IN_VIEW, ROOM_TO_TURN, postures_beside
from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.collision.planning_scene import PlanningScene, SceneObstacle
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.manipulation.motion_planning.base import MotionPlanningError, PlanningErrorCode
from bestman_bt.messages import PlacedShape, Pose, Sphere
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.world_model.world_model import HeldObject


@pytest.mark.parametrize("roll", [0.0, math.pi], ids=["camera on one side", "camera on the other side"])
def test_a_cup_in_a_level_hand_is_carried_upright_out_of_view_and_over_the_base(
    bystander: RobotSession, roll: float
) -> None:
    skills = bystander.skills
    level = Pose.from_xyz_rpy((0.0, 0.0, 0.035), (0.0, np.pi / 2, 0.0)) @ Pose.from_xyz_rpy((0, 0, 0), (0, 0, roll))
    held = HeldObject("cup", skills.world.models["cup"], level.inverse(), 0.066)
    carry = skills.robot.posture("carry", skills.arm_model.joint_names)
    skills.held = held
    try:
        scene = skills.planning_scene()
        found, _ = postures_beside(skills, held, carry, skills.arm_world(scene))
    finally:
        skills.held = None
    assert found
    view = skills.arm_world(PlanningScene(scene.positions, beads(bystander), scene.attached))
    forward = ForwardKinematics(skills.robot)
    back, front, side = ROOM_TO_TURN
    for positions in found:
        assert view.colliding_pairs(positions) == ()
        base_from_object = skills.kinematics.tool_pose(positions) @ held.tool_from_object
        assert base_from_object.tilt < math.radians(0.5)
        joints = {**scene.positions, **dict(zip(skills.arm_model.joint_names, positions, strict=True))}
        for link in ("panda_link4", "panda_link5", "panda_link6", "panda_hand"):
            x, y, _ = forward.pose(link, joints).position
            assert back < x < front
            assert abs(y) < side


@pytest.mark.parametrize(("beside", "room"), [(0.02, 0.012), (0.15, 0.02)])
def test_what_reaches_far_from_the_hand_keeps_more_room(bystander: RobotSession, beside: float, room: float) -> None:
    skills = bystander.skills
    cup = skills.world.models["cup"]
    held = HeldObject("cup", cup, Pose.from_xyz_rpy((0.0, beside, 0.0), (0.0, 0.0, 0.0)), 0.01)
    skills.held = held
    try:
        attached = with_held_margin(skills.planning_scene(), held, skills.parameters.arm_motion).attached
    finally:
        skills.held = None
    assert max(cup.size) == pytest.approx(0.1), "it reaches 7 or 20 cm"
    assert attached is not None
    assert attached.padding == pytest.approx(room)


@pytest.mark.parametrize("code", [PlanningErrorCode.NO_PATH, PlanningErrorCode.START_IN_COLLISION])
def test_a_held_object_has_room_on_its_way_where_there_is_such_a_way(
    bystander: RobotSession, code: PlanningErrorCode
) -> None:
    skills, worlds = bystander.skills, list[CollisionWorld]()
    # Which worlds are planned in; the plans themselves are scripted.
    skill: Any = SimpleNamespace(
        skills=skills, compute=lambda _slot, _plan, _start, _goals, world, *_: worlds.append(world)
    )
    carry = skills.robot.posture("carry", skills.arm_model.joint_names)
    held = HeldObject("cup", skills.world.models["cup"], Pose(), 0.066)
    skills.held = held
    try:
        scene = skills.planning_scene()
        way = move_free(skill, [carry])
        next(way)
        way.throw(MotionPlanningError(code, "tight"))
        way.close()
    finally:
        skills.held = None
    owed = [skills.arm_world(one) for one in (with_held_margin(scene, held, skills.parameters.arm_motion), scene)]
    assert [world.fingerprint for world in worlds] == [world.fingerprint for world in owed]
    assert worlds[0].fingerprint != worlds[1].fingerprint


def beads(session: RobotSession) -> tuple[SceneObstacle, ...]:
    """Small balls on the way from the head camera to what it should see."""
    eye = session.skills.camera.base_from_camera().position
    middles = [eye + share * (np.array(point) - eye) for point in IN_VIEW for share in np.linspace(0.15, 0.85, 12)]
    return (SceneObstacle("beads", tuple(PlacedShape(Sphere(0.01), Pose(middle)) for middle in middles)),)
