"""The A1 stands, trots and turns on the torques of its joints, and knows by its legs how far it came."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from bestman_bt.messages import Pose2D
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.sensor_parts import BatteryPart
from bestman_bt.scene.scene import World
from hal.api import Battery, MobileBase, Motion, MotionStatus
from hal.conformance.base_checks import BASE_CHECKS
from hal.pybullet.robot import PyBulletRobot
from hal.simulation.ground_truth import GroundTruth


class Walk:
    def __init__(self, robot: PyBulletRobot) -> None:
        self.robot, self.truth = robot, GroundTruth(robot)
        self.base = robot.part("base", MobileBase)

    def finish(self, motion: Motion) -> None:
        while not motion.done:
            self.robot.clock.sleep(0.05)
        assert motion.status is MotionStatus.SUCCEEDED, motion.failure
        self.robot.clock.sleep(0.5)

    def drive(self, vx: float, vy: float, wz: float, seconds: float) -> None:
        for _ in range(round(seconds / 0.1)):
            self.base.set_velocity(vx, vy, wz)
            self.robot.clock.sleep(0.1)


@pytest.fixture(scope="module")
def walk() -> Iterator[Walk]:
    """On an endless floor, so that nothing but its own legs stops it."""
    world = World("floor", 0, (), (), (), Pose2D(0.3, -0.2, 0.4), {})
    with PyBulletRobot(load_robot_model("a1"), world, seed=5) as robot:
        yield Walk(robot)


@pytest.mark.slow
def test_it_stands_still_and_level(walk: Walk) -> None:
    walk.robot.clock.sleep(1.0)
    start = walk.truth.base_pose()
    walk.robot.clock.sleep(3.0)
    now = walk.truth.base_pose()
    assert now.position == pytest.approx(start.position, abs=0.002)
    assert now.position[2] == pytest.approx(0.0, abs=0.01)
    assert np.abs(now.roll_pitch_yaw[:2]).max() < 0.03


@pytest.mark.slow
def test_it_walks_three_metres_straight_and_its_odometry_knows(walk: Walk) -> None:
    start, said = walk.truth.base_pose(), walk.base.odometry()
    walk.finish(walk.base.move_forward(3.0))
    came, counted = start.inverse() @ walk.truth.base_pose(), said.inverse() @ walk.base.odometry()
    assert came.position[0] == pytest.approx(3.0, abs=0.15)
    assert abs(came.position[1]) < 0.15
    assert abs(came.yaw) < math.radians(5.0)
    assert (counted.x, counted.y) == pytest.approx(tuple(came.position[:2]), abs=0.12)


@pytest.mark.slow
def test_it_turns_by_a_quarter(walk: Walk) -> None:
    start = walk.truth.base_pose()
    walk.finish(walk.base.rotate(math.pi / 2))
    turned = start.inverse() @ walk.truth.base_pose()
    assert turned.yaw == pytest.approx(math.pi / 2, abs=math.radians(4.0))
    assert np.hypot(*turned.position[:2]) < 0.15


@pytest.mark.slow
def test_it_follows_velocities_in_all_directions(walk: Walk) -> None:
    for velocity in ((0.0, 0.15, 0.0), (-0.2, 0.0, 0.0), (0.2, 0.0, 0.4)):
        walk.drive(*velocity, 1.0)
        start = walk.truth.base_pose()
        walk.drive(*velocity, 2.0)
        way = start.inverse() @ walk.truth.base_pose()
        told = walk.base.velocity()
        assert way.yaw / 2.0 == pytest.approx(velocity[2], abs=0.08)
        middle = Pose2D(0.0, 0.0, way.yaw / 2.0).inverse().apply(way.position[None, :2])[0] / 2.0
        assert middle == pytest.approx(velocity[:2], abs=0.06)
        assert (told.vx, told.vy, told.wz) == pytest.approx(velocity, abs=0.08)
        walk.drive(0.0, 0.0, 0.0, 0.6)


@pytest.mark.slow
def test_without_new_commands_it_stands_on_its_feet_again(walk: Walk) -> None:
    walk.drive(0.3, 0.0, 0.0, 1.0)
    walk.robot.clock.sleep(walk.base.command_timeout + 1.0)
    start = walk.truth.base_pose()
    walk.robot.clock.sleep(0.5)
    assert walk.truth.base_pose().position == pytest.approx(start.position, abs=0.002)


@pytest.mark.parametrize(
    "velocity",
    [
        (0.2, 0.1, 0.4),
        *(pytest.param(v, marks=pytest.mark.slow) for v in [(0.4, 0.0, 0.0), (-0.3, 0.0, 0.0), (0.0, 0.0, 0.8)]),
    ],
)
def test_a_stop_brings_it_to_rest_upright_within_half_a_second(
    walk: Walk, velocity: tuple[float, float, float]
) -> None:
    walk.drive(*velocity, 1.5)
    walk.robot.stop()
    walk.robot.clock.sleep(0.5)
    for _ in range(10):
        start = walk.truth.base_pose()
        walk.robot.clock.sleep(0.05)
        moved = start.inverse() @ walk.truth.base_pose()
        assert np.hypot(*moved.position[:2]) / 0.05 < 0.01
        assert abs(moved.yaw) / 0.05 < 0.01
        assert np.abs(walk.truth.base_pose().roll_pitch_yaw[:2]).max() < 0.05
    walk.robot.clear_stop()


def test_what_legs_cannot_do_is_declared_by_the_names_of_the_checks(walk: Walk) -> None:
    assert set(walk.robot.unsupported) <= {check.name for check in BASE_CHECKS}


@pytest.mark.slow
def test_nothing_but_its_joints_moved_it_and_that_cost_energy(walk: Walk) -> None:
    walk.drive(0.3, 0.0, 0.0, 4.0)
    record = walk.robot.audit_record()
    assert (record.resets, record.tampering, record.constraints, record.truth_reads) == (0, 0, 0, 0)
    assert not record.jumps
    assert not record.joint_limits
    assert not record.velocity_limits
    battery = walk.robot.model.of(BatteryPart)["battery"]
    idle = battery.idle_power * walk.robot.clock.now() / battery.capacity
    charges = [walk.robot.part("battery", Battery).read().charge for _ in range(100)]  # each with noise
    assert 1.0 - np.mean(charges) > 1.3 * idle
