"""Sensors on scripted readings: gyroscopes, tactile pads, joints, wrists, lidars that are mounted askew."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from bestman_bt.control.inertial import FusedOdometry, GyroHeading
from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.control.lidar import LidarSensor
from bestman_bt.control.touch import TactileSensor, WristWrench
from bestman_bt.messages import Failure, LaserScan, Pose, Pose2D, Wrench
from bestman_bt.navigation.localization.ekf import OdometryEstimate, OdometryFilter, WheelOdometry
from bestman_bt.robot_model.payload import payload
from hal.api import ImuReading, NoDataError, NotConnectedError, TactileReading
from tests.control.scripted_parts import ScriptedArm, stepped_clock


class Turning:
    """An inertial unit that turns at ``rate`` about z, read with ``bias``; ``late``: seconds that its stamps lag."""

    def __init__(self, clock, rate: float = 0.0, bias: float = 0.0) -> None:
        self.clock, self.rate, self.bias, self.reads = clock, rate, bias, 0

    def read(self) -> ImuReading:
        self.reads += 1
        return ImuReading(np.array([0.3, -0.2, self.rate + self.bias]), np.zeros(3), self.clock.now())


@pytest.mark.parametrize("rate", [0.4, -0.7])
def test_a_gyroscope_counts_from_begin_or_level_on_without_its_bias_and_anew_the_second_time(rate):
    clock = stepped_clock(time_step=1 / 240)
    imu = Turning(clock, bias=0.05)
    gyro = GyroHeading(imu, clock)
    for _ in range(2):
        imu.rate = 0.0
        gyro.begin()
        clock.sleep(1.0)
        assert gyro.heading == pytest.approx(0.05)
        gyro.level()
        assert gyro.heading == 0.0
        imu.rate = rate
        clock.sleep(2.0)
        assert gyro.heading == pytest.approx(2.0 * rate, abs=0.01)
    reads = imu.reads
    gyro.end()
    clock.sleep(1.0)
    assert imu.reads == reads
    assert gyro.heading == pytest.approx(2.0 * rate, abs=0.01)


def test_a_gyroscope_that_is_mounted_upside_down_turns_the_other_way_and_old_readings_count_once():
    clock = stepped_clock(time_step=1 / 240)
    imu = Turning(clock, rate=0.5)
    gyro = GyroHeading(imu, clock, axis=(0.0, 0.0, -2.0))
    gyro.begin()
    clock.sleep(1.0)
    assert gyro.heading == pytest.approx(-0.5)
    same = imu.read()
    imu.read = lambda: same  # again and again
    clock.sleep(1.0)
    assert gyro.heading == pytest.approx(-0.5)
    level = GyroHeading(imu, clock)
    level.begin()
    level.level()  # nothing was felt meanwhile
    assert level.heading == 0.0


class Told(OdometryFilter):
    uses_gyro = True

    def __init__(self) -> None:
        self.updates: list[tuple[float, float]] = []
        self.begun: list[Pose2D] = []

    def start(self, odometry: Pose2D) -> OdometryEstimate:
        self.begun.append(odometry)
        return OdometryEstimate(odometry)

    def update(self, before: OdometryEstimate, odometry: Pose2D, turned: float, elapsed: float) -> OdometryEstimate:
        self.updates.append((turned, elapsed))
        return OdometryEstimate(odometry)


def test_a_filter_is_told_what_was_felt_since_the_last_time_and_begins_anew():
    clock, told = stepped_clock(time_step=1 / 240), Told()
    imu, base = Turning(clock, rate=0.5), SimpleNamespace(odometry=lambda: Pose2D(1.0, 2.0, 3.0))
    odometry = FusedOdometry(base, clock, told, GyroHeading(imu, clock))
    for _ in range(2):
        told.updates.clear()
        odometry.begin()
        for _ in range(3):
            clock.sleep(0.1)
            assert odometry.pose() == Pose2D(1.0, 2.0, 3.0)
        assert np.array(told.updates) == pytest.approx(np.array([[0.05, 0.1]] * 3), abs=1e-6)
        odometry.end()
        clock.sleep(1.0)
    assert told.begun == [Pose2D(1.0, 2.0, 3.0)] * 2
    reads = imu.reads
    wheels = FusedOdometry(base, clock, WheelOdometry(), GyroHeading(imu, clock))
    wheels.begin()
    clock.sleep(0.5)
    assert imu.reads == reads, "wheels alone need no gyroscope"


def pad(pressure, sliding=(0.0, 0.0), **parameters) -> TactileSensor:
    pressure = np.array(pressure, dtype=float)
    reading = TactileReading(pressure, np.zeros((*pressure.shape, 2)), np.array(sliding), 0.0)
    return TactileSensor(SimpleNamespace(name="pad", read=lambda: reading), **parameters)


def test_a_pad_reports_how_hard_it_is_pressed_and_where_in_rows_and_columns():
    pressed = pad([[0.0, 0.0, 0.0], [0.0, 0.3, 0.9]])
    assert pressed.force() == pytest.approx(1.2)
    assert pressed.centre() == pytest.approx([1.0, 1.75])
    assert pad([[0.2, 0.0], [0.0, 0.0], [0.6, 0.0]]).centre() == pytest.approx([1.5, 0.0])
    assert pressed.image().tolist() == [[0, 0, 0], [0, 38, 115]]
    assert pad([[-1.0, 1.0, 5.0]]).image().tolist() == [[0, 128, 255]]
    assert pad([[-5.0, 0.5]]).centre() == pytest.approx([0.0, 1.0])


@pytest.mark.parametrize(("force", "pressed"), [(0.19, False), (0.21, True)])
def test_a_pad_is_pressed_from_a_force_on_and_only_then_can_something_slip(force, pressed):
    for sliding, slips in (
        ((0.0, 0.0), False),
        ((0.0021, 0.0021), False),
        ((-0.0022, 0.0022), True),
        ((0.0, -0.004), True),
    ):
        touched = pad([[force / 2, force / 2]], sliding)
        assert touched.pressed() == pressed
        assert (touched.centre() is not None) == pressed
        assert touched.slipping() == (pressed and slips)


def test_the_joints_of_all_arms_are_reported_and_one_that_is_gone_is_an_error_with_its_words():
    left, right = ScriptedArm([0.1, 0.2], name="left"), ScriptedArm([0.3, 0.4], name="right")
    right.__class__ = type("Right", (ScriptedArm,), {"joint_names": ("right_1", "right_2")})
    sensor = JointStateSensor({"left": left, "right": right}, SimpleNamespace(of=lambda _: {}))
    assert dict(sensor.positions()) == {"joint_1": 0.1, "joint_2": 0.2, "right_1": 0.3, "right_2": 0.4}
    for error in (NotConnectedError("right is gone", "wire", "C2"), NoDataError("right is gone", "wire", "C2")):
        right.error = error
        with pytest.raises(type(error)) as told:
            sensor.positions()
        assert told.value.failure == Failure(error.code, "right is gone", "wire", "C2")


def test_hits_of_a_lidar_that_is_mounted_askew_are_reported_in_the_frame_of_the_base():
    mount = Pose.from_xyz_rpy((0.2, -0.1, 0.3), (0.0, 0.0, math.pi / 2))
    scan = LaserScan(np.array([1.0, np.inf, 2.0]), -math.pi / 2, math.pi / 2, 0.1, 8.0, 0.0)
    lidar = SimpleNamespace(frame="laser", scan=lambda: scan)
    asked = []
    kinematics = SimpleNamespace(pose=lambda frame, joints: asked.append(frame) or mount)
    sensor = LidarSensor(lidar, kinematics)
    assert sensor.points() == pytest.approx(np.array([[1.2, -0.1], [-1.8, -0.1]]))
    assert asked == ["laser"]
    assert sensor.base_from_lidar.theta == pytest.approx(math.pi / 2)


class Weighing:
    """A wrist whose sensor stands askew and reads the hand's weight, an offset and ``touch``, all in its frame."""

    OFFSET = np.array([2.0, -1.0, 3.0, 0.1, 0.2, -0.1])

    def __init__(self, kinematics) -> None:
        self.clock = stepped_clock(time_step=1 / 60)
        self.hand = payload(kinematics.robot, "panda_hand")
        self.pose = Pose.from_xyz_rpy((0.4, 0.1, 0.8), (2.4, 0.3, -1.1))
        self.touch, self.shake, self.error = np.zeros(6), 0.0, None
        self.readings = 0
        placed = SimpleNamespace(robot=kinematics.robot, pose=lambda frame, joints: self.pose)
        self.wrist = WristWrench(self, placed, SimpleNamespace(positions=dict), self.clock)

    frame = "panda_hand"

    def wrench(self) -> Wrench:
        if self.error is not None:
            raise self.error
        self.readings += 1
        weight = self.pose.rotation.T @ np.array([0.0, 0.0, -9.81 * self.hand.mass])
        values = np.concatenate([weight, np.cross(self.hand.centre, weight)]) + self.OFFSET + self.touch
        values[0] += self.shake * (-1) ** self.readings
        return Wrench(values[:3], values[3:], self.clock.now())

    def tare(self) -> None:
        self.wrist.tare()
        self.clock.sleep(0.5)


@pytest.fixture
def weighing(kinematics) -> Weighing:
    return Weighing(kinematics)


def test_the_offset_is_what_is_read_at_rest_beyond_the_weight_whatever_the_posture(weighing):
    assert weighing.hand.mass > 0.3
    assert not weighing.wrist.tared
    weighing.tare()
    assert weighing.wrist.tared
    assert not weighing.wrist.taring
    for rpy in ((2.4, 0.3, -1.1), (-0.5, 1.0, 0.4), (3.1, -0.2, 2.0)):
        weighing.pose = Pose.from_xyz_rpy((0.4, 0.1, 0.8), rpy)
        weighing.touch = np.array([1.0, 2.0, -3.0, 0.0, 0.1, 0.0])
        felt = weighing.wrist.contact()
        assert [*felt.force, *felt.torque] == pytest.approx(weighing.touch.tolist())
        tool = Pose(weighing.pose.position + np.array([0.0, 0.0, -0.1]), np.array([0.0, 0.0, 0.0, 1.0]))
        at_tool = weighing.wrist.contact_at(tool)
        force = weighing.pose.rotation @ weighing.touch[:3]
        assert at_tool.force == pytest.approx(force)
        torque = weighing.pose.rotation @ weighing.touch[3:] + np.cross([0.0, 0.0, 0.1], force)
        assert at_tool.torque == pytest.approx(torque)


def test_a_second_tare_takes_what_is_held_by_then_as_offset_and_one_that_fails_leaves_the_older(weighing):
    weighing.tare()
    weighing.touch = np.array([0.0, 0.0, 5.0, 0.0, 0.0, 0.0])
    weighing.tare()
    assert weighing.wrist.contact().force == pytest.approx(np.zeros(3), abs=1e-9)
    weighing.touch = np.zeros(6)
    for shake, learns in ((1.6, False), (1.4, True)):
        weighing.shake = shake
        weighing.tare()
        weighing.shake = 0.0
        off = weighing.wrist.contact().force[2]
        assert off == pytest.approx(0.0 if learns else -5.0, abs=1e-9)
    weighing.wrist.tare()
    weighing.clock.sleep(0.1)
    weighing.error = NoDataError("silent")
    weighing.clock.sleep(0.1)
    assert not weighing.wrist.taring
    weighing.error = None
    weighing.touch = np.array([0.0, 0.0, 7.0, 0.0, 0.0, 0.0])
    weighing.clock.sleep(0.5)
    assert weighing.wrist.contact().force[2] == pytest.approx(7.0), "nothing was learned from a part of the readings"
    weighing.tare()
    assert weighing.wrist.contact().force[2] == pytest.approx(0.0, abs=1e-9)
