"""Doors and drawers in physics, pulled by their handles without knowing their joints."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.control.arm.constraint_following import FollowEnd, FollowGoal
from bestman_bt.messages import MotionErrorCode, Pose2D
from hal.api import MotionStatus

DRAWER = ("drawer_chest/drawer_3", Pose2D(-0.88, -0.6, -0.4))
FRIDGE = ("fridge/upper_door", Pose2D(-0.87, -0.349, 0.0))
MICROWAVE = ("microwave/door", Pose2D(-1.025, -0.2575, 0.4), 0.75)


def guess(scene, seed: int) -> np.ndarray:
    """The opening direction with the error that a map's guess has."""
    return scene.handle.opening_direction + np.random.default_rng(seed).normal(0.0, 0.05, 3)


def resting(scene) -> bool:
    scene.robot.clock.sleep(0.5)
    return float(np.abs(scene.robot.parts["arm"].velocities()).max()) < 0.01


@pytest.mark.slow
def test_a_drawer_opens_25_cm_and_is_found_to_slide(stand_before):
    scene = stand_before(*DRAWER, flip=True)
    scene.grasp()
    ended = scene.wait(
        scene.arm.follow_constraint(guess(scene, 1), FollowGoal(distance=0.25), grip=scene.gripper.watch_slip())
    )
    assert ended.status is MotionStatus.SUCCEEDED, ended.failure
    assert scene.opened > 0.24
    assert ended.result.axis.kind == "prismatic"
    assert float(ended.result.axis.direction @ scene.handle.opening_direction) > math.cos(math.radians(2.0))
    assert ended.result.peak_pull < 30.0
    assert resting(scene)


@pytest.mark.parametrize(
    ("door", "radius"),
    [pytest.param(FRIDGE, 0.56, marks=pytest.mark.slow), (MICROWAVE, 0.34)],
    ids=["fridge", "microwave"],
)
def test_a_door_opens_an_angle_about_the_hinge_that_is_found(stand_before, door, radius):
    scene = stand_before(*door, flip=door is FRIDGE)
    scene.grasp()
    handle = scene.arm.follow_constraint(guess(scene, 1), FollowGoal(angle=1.0), grip=scene.gripper.watch_slip())
    ended = scene.wait(handle)
    assert ended.status is MotionStatus.SUCCEEDED, ended.failure
    assert scene.opened > math.radians(50.0)
    motion = ended.result
    assert motion.axis.kind == "revolute"
    assert motion.axis.radius == pytest.approx(radius, rel=0.12)
    assert abs(motion.axis.direction[2]) > 0.98
    assert motion.angle == pytest.approx(scene.opened, abs=math.radians(5.0))


@pytest.mark.slow
def test_a_locked_door_is_reported_within_the_force_limit(stand_before):
    scene = stand_before(*FRIDGE, friction=200.0, flip=True)
    scene.grasp()
    ended = scene.wait(
        scene.arm.follow_constraint(scene.handle.opening_direction, FollowGoal(angle=1.0, max_pull=35.0))
    )
    assert (ended.status, ended.failure.code) == (MotionStatus.FAILED, MotionErrorCode.BLOCKED)
    assert "locked" in ended.failure.text
    assert ended.result.end is FollowEnd.LOCKED
    assert ended.result.peak_pull < 45.0
    assert scene.opened < 0.01
    assert resting(scene)


@pytest.mark.slow
def test_fingers_without_friction_lose_the_handle(stand_before):
    scene = stand_before(*DRAWER, finger_friction=0.001, flip=True)
    scene.grasp()
    ended = scene.wait(
        scene.arm.follow_constraint(
            scene.handle.opening_direction, FollowGoal(distance=0.25), grip=scene.gripper.watch_slip()
        )
    )
    assert ended.status is MotionStatus.FAILED
    assert (ended.failure.code, ended.result.end) == (MotionErrorCode.GUARDED, FollowEnd.GRIP_LOST)
    assert scene.opened < 0.05


@pytest.mark.slow
def test_a_following_that_is_cancelled_leaves_nothing_moving(stand_before):
    scene = stand_before(*DRAWER, flip=True)
    scene.grasp()
    handle = scene.arm.follow_constraint(scene.handle.opening_direction, FollowGoal(distance=0.25))
    scene.robot.clock.sleep(1.5)
    handle.cancel()
    assert handle.status is MotionStatus.CANCELED
    assert resting(scene)
    left = scene.opened
    scene.robot.clock.sleep(1.0)
    assert 0.005 < left < 0.2
    assert scene.opened == pytest.approx(left, abs=1e-3)


def test_a_newer_command_supersedes_a_following(stand_before):
    scene = stand_before(*DRAWER, flip=True)
    handle = scene.arm.follow_constraint(scene.handle.opening_direction, FollowGoal(distance=0.25))
    scene.robot.clock.sleep(0.2)
    scene.arm.move_to(scene.arm.positions())
    assert (handle.status, handle.failure.code) == (MotionStatus.CANCELED, MotionErrorCode.SUPERSEDED)


def test_a_following_without_an_end_or_direction_is_refused(stand_before):
    scene = stand_before(*DRAWER, flip=True)
    with pytest.raises(ValueError, match="distance or an angle"):
        scene.arm.follow_constraint((1.0, 0.0, 0.0), FollowGoal())
    with pytest.raises(ValueError, match="direction"):
        scene.arm.follow_constraint((0.0, 0.0, 0.0), FollowGoal(distance=0.1))
