"""How a following ends that does not get where it should: jams, obstacles, the arm's limits, too little time."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.control.arm.arm_controller import ArmController, ArmMoving
from bestman_bt.control.arm.constraint_following import FollowEnd, FollowGoal, Following
from bestman_bt.control.arm.joint_axis import JointAxis
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.messages import MotionErrorCode, Pose2D
from hal.api import Arm

DRAWER = ("drawer_chest/drawer_3", Pose2D(-0.88, -0.6, -0.4))


def test_a_drawer_that_jams_half_way_is_reported_within_the_force_limit_and_how_far_it_came(stand_before):
    scene = stand_before(*DRAWER, finger_friction=2.0, flip=True)  # the hand does not slip before the jam is felt
    scene.grasp()
    handle = scene.arm.follow_constraint(
        scene.handle.opening_direction, FollowGoal(distance=0.25, max_pull=30.0), grip=scene.gripper.watch_slip()
    )
    while scene.opened < 0.10:
        scene.robot.clock.sleep(0.05)
    body, joint = scene.robot.simulation.built.articulations[scene.joint]
    scene.robot.simulation.engine.turn(body, [joint], [0.0], [500.0])
    ended = scene.wait(handle)
    assert (ended.failure.code, ended.result.end) == (MotionErrorCode.BLOCKED, FollowEnd.JAMMED)
    assert ended.result.peak_pull < 50.0
    assert abs(ended.result.distance - scene.opened) < 0.01


def test_a_hand_that_is_led_the_wrong_way_meets_an_obstacle(stand_before):
    scene = stand_before(*DRAWER, flip=True)
    scene.grasp()
    forward = scene.handle.opening_direction
    across = forward + np.cross([0.0, 0.0, 1.0], forward)
    axis = JointAxis("prismatic", scene.handle.pose.position, across / np.linalg.norm(across), 0.0, 0.0)
    ended = scene.wait(
        scene.arm.follow_constraint(
            across, FollowGoal(distance=0.25, max_pull=200.0, max_side=12.0, axis=axis, learns=False)
        )
    )
    assert (ended.failure.code, ended.result.end) == (MotionErrorCode.COLLISION, FollowEnd.OBSTACLE)


@pytest.mark.slow
def test_the_arm_s_own_limit_is_reported(stand_before):
    scene = stand_before(*DRAWER, flip=True)
    ended = scene.wait(scene.arm.follow_constraint(scene.handle.outward, FollowGoal(distance=2.0, speed=0.2)))
    assert (ended.failure.code, ended.result.end) == (MotionErrorCode.UNREACHABLE, FollowEnd.ARM_LIMIT)


@pytest.mark.slow
def test_a_following_has_a_time_limit(stand_before):
    scene = stand_before(*DRAWER, flip=True)
    hasty = Following(time_factor=0.01)
    kinematics = DampedLeastSquares(scene.robot.model)
    arm = ArmController(
        scene.robot.part("arm", Arm),
        scene.robot.clock,
        kinematics=kinematics,
        wrist=scene.wrist,
        moving=ArmMoving(following=hasty),
    )
    ended = scene.wait(arm.follow_constraint(scene.handle.outward, FollowGoal(distance=0.2, speed=0.02)))
    assert (ended.failure.code, ended.result.end) == (MotionErrorCode.TIMEOUT, FollowEnd.TIMEOUT)
    assert 0.05 < ended.result.distance < 0.15
