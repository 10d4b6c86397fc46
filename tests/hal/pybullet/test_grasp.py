"""A grasp holds by friction, and only by friction."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bestman_bt.evaluation.audit import audit
from hal.pybullet.package import pybullet
from hal.pybullet.robot import PyBulletRobot

ALLOWED = [("fingers", "box"), ("fingers", "can"), ("box", "table"), ("can", "table")]


@pytest.mark.parametrize("name", ["box", pytest.param("can", marks=pytest.mark.slow)])
def test_an_object_stays_in_a_moving_hand_and_where_it_is_released(name, robot_model, table_worlds, operator) -> None:
    with PyBulletRobot(robot_model, table_worlds[name], seed=3) as robot:
        hand = operator(robot)
        hand.grasp(name)
        assert hand.gripper.state().object_held
        assert hand.gripper.width() == pytest.approx({"box": 0.04, "can": 0.066}[name], abs=0.003)
        gripped = hand.in_hand(name)
        hand.move_vertically(0.15)
        turned = hand.arm.positions()
        turned[0] += 0.6
        back = hand.arm.positions()
        hand.finish(hand.arm.move_to(turned, 0.4))
        hand.finish(hand.arm.move_to(back, 0.4))
        slip = gripped.inverse() @ hand.in_hand(name)
        assert np.linalg.norm(slip.position) < 0.002
        assert hand.gripper.state().object_held

        height = hand.truth.object_pose(name).position[2] - 0.80
        hand.move_vertically(0.002 - height)
        put_down = hand.truth.object_pose(name)
        hand.finish(hand.gripper.move(0.08, speed=0.02))
        assert hand.gripper.width() == pytest.approx(0.08, abs=0.0015)
        hand.move_vertically(0.12)
        robot.clock.sleep(0.5)
        left = hand.truth.object_pose(name)
        assert np.linalg.norm((left.position - put_down.position)[:2]) < 0.003
        assert left.tilt < np.radians(1.0)
        assert not hand.gripper.state().object_held

        judged = audit(robot.audit_record(), ALLOWED)
        assert judged.honest, judged.findings
        assert judged.collisions == ()
        assert judged.max_penetration_mm < 1.5
        assert judged.joint_limit_violations == judged.velocity_limit_violations == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["box", pytest.param("can", marks=pytest.mark.slow)])
def test_fingers_press_along_their_way_after_the_hand_has_turned(name, robot_model, table_worlds, operator) -> None:
    """Bullet keeps normals of contact as they were in the world: they have to be found afresh on the way."""
    with PyBulletRobot(robot_model, table_worlds[name], seed=3) as robot:
        hand = operator(robot)
        hand.grasp(name)
        hand.move_vertically(0.15)
        turned = hand.arm.positions()
        turned[0] += 1.5
        hand.finish(hand.arm.move_to(turned, 0.6))
        built, client = robot.simulation.built, robot.client
        sideways = []
        for finger in ("panda_leftfinger", "panda_rightfinger"):
            link = built.links[finger]
            closing = hand.truth.frame_pose(finger).rotation[:, 1]
            contacts = client.getContactPoints(bodyA=built.robot, bodyB=built.objects[name], linkIndexA=link)
            assert contacts
            sideways += [np.linalg.norm(np.cross(contact[7], closing)) for contact in contacts]
        assert max(sideways) < np.sin(np.radians(25.0))
        assert hand.gripper.state().object_held


def test_slippery_fingers_hold_nothing(robot_model, table_worlds, operator) -> None:
    """Two fingers of 40 N hold 2 * 40 N * 0.02 * 0.8 = 1.3 N; the box weighs 2 N."""
    slippery = dataclasses.replace(table_worlds["box"], finger_friction=0.02)
    with PyBulletRobot(robot_model, slippery, seed=3) as robot:
        hand = operator(robot)
        hand.grasp("box")
        hand.move_vertically(0.15)
        robot.clock.sleep(1.0)
        assert hand.truth.object_pose("box").position[2] < 0.81
        assert not hand.gripper.state().object_held
        assert hand.gripper.state().empty


@pytest.mark.slow
def test_an_object_that_sticks_to_the_opened_hand_is_seen(robot_model, table_worlds, operator) -> None:
    with PyBulletRobot(robot_model, table_worlds["box"], seed=3) as robot:
        hand = operator(robot)
        hand.grasp("box")
        built, client = robot.simulation.built, robot.client
        tool = client.getLinkState(built.robot, built.links["panda_hand"])[:2]
        box = client.getBasePositionAndOrientation(built.objects["box"])
        glue = pybullet.multiplyTransforms(*pybullet.invertTransform(*tool), *box)
        client.createConstraint(
            built.robot,
            built.links["panda_hand"],
            built.objects["box"],
            -1,
            pybullet.JOINT_FIXED,
            [0, 0, 0],
            glue[0],
            [0, 0, 0],
            glue[1],
        )
        hand.finish(hand.gripper.open())
        hand.move_vertically(0.1)
        assert hand.truth.object_pose("box").position[2] > 0.85
        judged = audit(robot.audit_record(), ALLOWED)
        assert judged.object_follows_open_hand >= 1
        assert judged.grasp_constraints == 1


@pytest.mark.slow
def test_a_held_object_that_is_lost_shows_in_the_state_of_the_gripper(robot_model, table_worlds, operator) -> None:
    with PyBulletRobot(robot_model, table_worlds["box"], seed=3) as robot:
        hand = operator(robot)
        hand.reach_over("box")
        hand.finish(hand.gripper.close())
        assert hand.gripper.state().empty
        assert not hand.gripper.state().object_held


@pytest.mark.slow
def test_an_arm_that_meets_an_obstacle_reports_that_it_cannot_follow(robot_model, table_worlds, operator) -> None:
    with PyBulletRobot(robot_model, table_worlds["box"], seed=3) as robot:
        hand = operator(robot)
        hand.reach_over("box")
        down = hand.arm.positions()
        down[1] += 1.2
        motion = hand.arm.move_to(np.clip(down, None, 1.76), 0.3)
        while not motion.done:
            robot.clock.sleep(0.05)
        assert motion.failure is not None
        assert motion.failure.code.value == "tracking"
        assert audit(robot.audit_record(), ALLOWED).collisions
