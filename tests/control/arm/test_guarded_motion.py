"""The arm stops where it touches something: on purpose, and where nothing should be."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import JointTrajectory, MotionErrorCode, Pose2D
from hal.api import MotionStatus, NotConnectedError
from hal.simulation.sensor_pipeline import SensorFault

DRAWER = ("drawer_chest/drawer_3", Pose2D(-0.88, -0.6, -0.4))


def tared(scene):
    scene.robot.clock.sleep(0.3)
    scene.wrist.tare()
    scene.robot.clock.sleep(0.4)
    return scene


def test_a_guarded_move_ends_on_what_it_meets(stand_before):
    scene = tared(stand_before(*DRAWER, flip=True))
    scene.wait(scene.gripper.close())  # the closed hand meets the bar
    moved = scene.wait(scene.arm.move_until(-scene.handle.outward, 0.03, 0.15, 8.0))
    assert moved.status is MotionStatus.SUCCEEDED
    assert moved.result.touched
    assert 0.02 < moved.result.distance < 0.07
    assert float(moved.result.force @ scene.handle.outward) >= 8.0


@pytest.mark.slow
def test_a_guarded_move_through_free_space_goes_its_whole_way(stand_before):
    scene = tared(stand_before(*DRAWER, flip=True))
    start = scene.truth.frame_pose("panda_grasptarget").position
    moved = scene.wait(scene.arm.move_until(scene.handle.outward, 0.05, 0.1, 8.0))
    assert moved.status is MotionStatus.SUCCEEDED
    assert not moved.result.touched
    went = np.linalg.norm(scene.truth.frame_pose("panda_grasptarget").position - start)
    assert went == pytest.approx(0.1, abs=0.005)


def test_a_guarded_move_ends_at_once_where_the_wrist_falls_silent(stand_before):
    scene = tared(stand_before(*DRAWER, flip=True))
    sensor = scene.robot.parts["wrist_force_torque"]
    moving = scene.arm.move_until(scene.handle.outward, 0.05, 0.1, 8.0)
    scene.robot.clock.sleep(0.5)
    sensor.fault = SensorFault.SILENT
    scene.robot.clock.sleep(0.1)
    assert moving.status is MotionStatus.FAILED
    assert moving.failure.code is MotionErrorCode.NO_DATA
    assert "wrist_force_torque" in moving.failure.text
    scene.robot.clock.sleep(0.3)
    assert np.abs(scene.robot.parts["arm"].velocities()).max() < 0.02
    offset = scene.wrist.tared
    scene.wrist.tare()
    scene.robot.clock.sleep(0.1)
    assert not scene.wrist.taring, "there is nothing to learn from"
    assert scene.wrist.tared == offset
    sensor.fault = None


@pytest.mark.slow
def test_a_guarded_move_ends_at_once_where_joints_of_another_controller_fall_silent(stand_before, monkeypatch):
    scene = tared(stand_before(*DRAWER, flip=True))

    def gone():
        raise NotConnectedError("head delivers nothing")

    moving = scene.arm.move_until(scene.handle.outward, 0.05, 0.1, 8.0)
    scene.robot.clock.sleep(0.5)
    monkeypatch.setattr(scene.robot.parts["head"], "positions", gone)
    scene.robot.clock.sleep(0.1)
    assert moving.status is MotionStatus.FAILED
    assert moving.failure.code is MotionErrorCode.DISCONNECTED
    assert moving.failure.text == "head delivers nothing"


def swing(scene, joint: int, by: float, duration: float) -> JointTrajectory:
    times = np.linspace(0.0, duration, 41)
    share = times / duration
    positions = np.tile(scene.arm.positions(), (41, 1))
    positions[:, joint] += by * (3 * share**2 - 2 * share**3)
    velocities = np.zeros_like(positions)
    velocities[:, joint] = by * (6 * share - 6 * share**2) / duration
    return JointTrajectory(scene.arm.joint_names, times, positions, velocities)


def test_contact_where_none_is_expected_stops_the_arm_and_is_reported(stand_before):
    scene = tared(stand_before(*DRAWER, flip=True))
    scene.wait(scene.gripper.close())
    ended = scene.wait(scene.arm.follow(swing(scene, 0, -0.5, 2.0), free=True))
    assert (ended.status, ended.failure.code) == (MotionStatus.FAILED, MotionErrorCode.COLLISION)
    assert "unexpected contact" in ended.failure.text
    scene.robot.clock.sleep(0.5)
    arm = scene.robot.parts["arm"]
    rest = arm.positions()
    scene.robot.clock.sleep(0.2)
    assert np.abs(arm.positions() - rest).max() < 0.01 * 0.2  # it leans on what it has met, and trembles there


@pytest.mark.slow
def test_a_quick_swing_through_free_air_is_no_contact(stand_before):
    scene = tared(stand_before(*DRAWER, flip=True))
    scene.wait(scene.arm.move_until(scene.handle.outward, 0.1, 0.15, 20.0))
    ended = scene.wait(scene.arm.follow(swing(scene, 6, 0.8, 0.8), free=True))
    assert ended.status is MotionStatus.SUCCEEDED, ended.failure
