"""Inertial unit, tactile pads and battery: what they tell is what happens, up to their noise."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.control.touch import TactileSensor
from bestman_bt.robot_model.compose import compose_robot
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.robot_model.sensor_parts import BatteryPart, ImuPart, LidarPart, TactilePart
from hal.api import Battery, Gripper, Imu, Lidar, MobileBase, NoDataError, Tactile
from hal.simulation.battery import SimulatedBattery
from hal.simulation.force_torque import SimulatedForceTorque
from hal.simulation.guards import ReadPurpose
from hal.simulation.imu import SimulatedImu
from hal.simulation.lidar import SimulatedLidar
from hal.simulation.robot import SimulatedRobot
from hal.simulation.sensor_pipeline import SensorFault
from hal.simulation.tactile import SimulatedTactile
from tests.default_engine import DefaultRobot

BodySensor = SimulatedImu | SimulatedTactile | SimulatedBattery | SimulatedLidar | SimulatedForceTorque

ADDED = {
    "imu": {"part": "imu", "mount": "base_link", "xyz": [0.1, 0.0, 0.2], "set": {"rate": "60 Hz"}},
    "left_pad": {"part": "tactile_pad", "mount": "panda_leftfinger", "xyz": [0, 0, 0.0436], "rpy": [math.pi / 2, 0, 0]},
    "right_pad": {
        "part": "tactile_pad",
        "mount": "panda_rightfinger",
        "xyz": [0, 0, 0.0436],
        "rpy": [-math.pi / 2, 0, 0],
    },
    "battery": {"part": "battery", "mount": "base_link"},
}
PADS = {"left_pad": "panda_leftfinger", "right_pad": "panda_rightfinger"}


@pytest.fixture(scope="module")
def sensing_model() -> RobotModel:
    return compose_robot(
        "sensing_panda", read_document(find_data("robot", "diff_panda")).merged(Document({"parts": ADDED}))
    )


@pytest.fixture(scope="module")
def robot(sensing_model: RobotModel, empty_world) -> Iterator[SimulatedRobot]:
    with DefaultRobot(sensing_model, empty_world, seed=3) as robot:
        yield robot


def drive(robot: SimulatedRobot, vx: float, wz: float, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        robot.part("base", MobileBase).set_velocity(vx, 0.0, wz)
        robot.clock.sleep(0.1)


def test_an_imu_at_rest_reads_gravity(robot: SimulatedRobot) -> None:
    imu, model = robot.part("imu", Imu), robot.model.of(ImuPart)["imu"]
    readings = []
    robot.clock.sleep(1.0)
    for _ in range(100):
        robot.clock.sleep(1 / 60)
        readings.append(imu.read())
    accelerations = np.array([reading.linear_acceleration for reading in readings])
    assert accelerations.mean(axis=0) == pytest.approx([0.0, 0.0, 9.81], abs=4 * model.bias_acceleration)
    assert accelerations.std(axis=0) == pytest.approx(np.full(3, model.noise_acceleration), rel=0.3)
    rates = np.array([reading.angular_velocity for reading in readings])
    assert np.abs(rates.mean(axis=0)).max() < 4 * model.bias_angular_velocity


@pytest.mark.slow
def test_an_imu_feels_turning_and_gathering_speed(sensing_model: RobotModel, empty_world) -> None:
    with DefaultRobot(sensing_model, empty_world, seed=3) as robot:
        imu, base = robot.part("imu", Imu), robot.part("base", MobileBase)

        def felt(vx: float, wz: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
            """Mean force and mean turning rate."""
            readings = []
            for _ in range(round(60 * seconds)):
                base.set_velocity(vx, 0.0, wz)
                robot.clock.sleep(1 / 60)
                readings.append(imu.read())
            forces = np.mean([reading.linear_acceleration for reading in readings], axis=0)
            return forces, np.mean([reading.angular_velocity for reading in readings], axis=0)

        rest, _ = felt(0.0, 0.0, 0.5)
        for turn in (0.8, -0.8):
            felt(0.0, turn, 0.9)
            force, rate = felt(0.0, turn, 0.8)
            assert rate == pytest.approx([0.0, 0.0, turn], abs=0.02)
            # 10 cm ahead of the axis the turn pulls it inwards: w² r
            assert (force - rest)[0] == pytest.approx(-0.064, abs=0.03)
            felt(0.0, 0.0, 0.7)
        for speed in (0.6, -0.6):
            before = base.velocity().vx
            force, _ = felt(speed, 0.0, 0.7)
            gained = (base.velocity().vx - before) / 0.7
            assert gained * speed > 0.2
            assert (force - rest)[0] == pytest.approx(gained, abs=0.06)
            felt(0.0, 0.0, 1.0)


class Grip:
    """The hand around the box on the table; what truly presses on a finger, from the contacts."""

    def __init__(self, robot: SimulatedRobot, hand: Any) -> None:
        self.robot, self.hand = robot, hand
        self._reader = robot.simulation.reader(ReadPurpose.EVALUATION)

    def true_force(self, link: str) -> float:
        robot, finger = self.robot.simulation.built.robot, self.robot.simulation.built.links[link]
        box = self.robot.simulation.built.objects["box"]
        contacts = self._reader.contacts(robot, finger, box)
        return sum(contact.pressure for contact in contacts)

    def pressure(self, pad: str) -> np.ndarray:
        return self.robot.part(pad, Tactile).read().pressure


@pytest.fixture
def grip(sensing_model: RobotModel, table_worlds, operator) -> Iterator[Grip]:
    prompt = {name: dataclasses.replace(pad, latency=0.0) for name, pad in sensing_model.of(TactilePart).items()}
    model = dataclasses.replace(sensing_model, parts={**sensing_model.parts, **prompt})
    with DefaultRobot(model, table_worlds["box"], seed=3) as robot:
        grip = Grip(robot, operator(robot))
        grip.hand.reach_over("box")
        grip.hand.move_vertically(-0.12)
        yield grip


def test_an_open_hand_feels_noise_and_taxels_add_up_to_the_normal_force_on_their_finger(grip: Grip) -> None:
    for pad in PADS:
        assert np.abs(grip.pressure(pad)).max() < 0.05
        assert not TactileSensor(grip.robot.part(pad, Tactile)).pressed()
    grip.hand.finish(grip.robot.part("gripper", Gripper).close(10.0))
    grip.robot.clock.sleep(0.3)
    for pad, link in PADS.items():
        grip.robot.clock.sleep(1 / 60)
        truth, noise = grip.true_force(link), 0.01 * math.sqrt(64)
        assert truth == pytest.approx(10.0, rel=0.3)
        assert grip.pressure(pad).sum() == pytest.approx(truth, abs=4 * noise)
        assert not TactileSensor(grip.robot.part(pad, Tactile)).slipping()


def test_a_weak_grip_slips_as_the_hand_lifts_and_the_pads_tell(grip: Grip) -> None:
    """Two fingers with 1 N and a friction of 0.64 cannot lift 2 N: the box slides down, along -y of the left pad."""
    grip.hand.finish(grip.robot.part("gripper", Gripper).close(1.0))
    left = grip.robot.part("left_pad", Tactile)
    sliding, slipped = [], []

    def look() -> None:
        sliding.append(left.read().sliding)
        slipped.append(TactileSensor(left).slipping())

    timer = grip.robot.clock.every(1 / 60, look)
    grip.hand.move_vertically(0.02, duration=1.0)
    timer.cancel()
    assert sum(slipped) > 20
    fastest = max(sliding, key=lambda speed: float(np.hypot(*speed)))
    assert np.hypot(*fastest) == pytest.approx(0.02 * math.pi / 2, rel=0.3)  # the top speed of that motion
    assert abs(fastest[1]) > 5 * abs(fastest[0])


def test_the_picture_shows_where_the_box_is_pressed(grip: Grip) -> None:
    """From 3 cm up the hand holds the box by its top, with part of the pads."""
    grip.hand.move_vertically(0.03, duration=1.0)
    grip.hand.finish(grip.robot.part("gripper", Gripper).close(10.0))
    grip.robot.clock.sleep(0.3)
    top = grip.hand.truth.object_pose("box").position[2] + 0.05
    for pad in PADS:
        frame = grip.hand.truth.frame_pose(f"{pad}_link")
        sensor = TactileSensor(grip.robot.part(pad, Tactile))
        image, centre = sensor.image(), sensor.centre()
        assert centre is not None
        row_heights = frame.position[2] + frame.rotation[2, 1] * 0.02 * ((np.arange(8) + 0.5) / 8 - 0.5)
        height = frame.position[2] + frame.rotation[2, 1] * 0.02 * ((centre[0] + 0.5) / 8 - 0.5)
        assert row_heights.max() > top + 0.008  # part of the pad is above the box
        assert row_heights.min() - 0.001 < height < top + 0.001
        assert image[row_heights > top + 0.006].max() < 10
        assert image[row_heights < top].max() > 100


def test_the_battery_falls_with_motion(robot: SimulatedRobot) -> None:
    model, clock = robot.model.of(BatteryPart)["battery"], robot.clock
    battery = robot.part("battery", Battery)
    clock.sleep(0.7)
    assert battery.read().charge == pytest.approx(1.0, abs=0.004)
    at_rest = battery.read()
    drive(robot, 0.6, 0.0, 1.0)
    moving = battery.read()
    assert moving.current > 1.2 * at_rest.current
    assert moving.voltage < at_rest.voltage + 4 * model.noise_voltage
    drive(robot, 0.0, 0.0, 1.5)


@pytest.mark.slow
def test_the_battery_loses_the_energy_that_is_drawn(sensing_model: RobotModel, empty_world) -> None:
    small = dataclasses.replace(
        sensing_model.of(BatteryPart)["battery"], capacity=10_000.0, noise_charge=0.0, latency=0.0
    )
    model = dataclasses.replace(sensing_model, parts={**sensing_model.parts, "battery": small})
    with DefaultRobot(model, empty_world) as robot:
        battery = robot.part("battery", Battery)
        robot.clock.sleep(0.5)
        before = battery.read()
        robot.clock.sleep(5.0)
        after = battery.read()
        power = after.current * after.voltage
        assert small.idle_power < power < small.idle_power + 60.0
        assert before.charge - after.charge == pytest.approx(power * 5.0 / small.capacity, rel=0.05)


def test_a_battery_that_is_connected_again_has_the_charge_of_its_description(sensing_model: RobotModel) -> None:
    model = dataclasses.replace(sensing_model.of(BatteryPart)["battery"], capacity=1000.0, noise_charge=0.0)
    battery = SimulatedBattery("battery", model, np.random.default_rng(0))
    simulation: Any = SimpleNamespace(
        built=SimpleNamespace(max_efforts={}),
        joint_names=(),
        joints=lambda names: [],
        joint_states=lambda: np.zeros((3, 0)),
        efforts=lambda: np.zeros(0),
        parameters=SimpleNamespace(time_step=1.0),
        step_observers=[],
        now=0.0,
    )
    for _ in range(2):
        measure = battery.begin(simulation)
        simulation.step_observers.pop()()
        assert measure().charge == pytest.approx(model.charge - model.idle_power / model.capacity)


def test_readings_come_with_their_latency(sensing_model: RobotModel, empty_world) -> None:
    late_lidar = dataclasses.replace(sensing_model.of(LidarPart)["lidar"], latency=0.2)
    model = dataclasses.replace(sensing_model, parts={**sensing_model.parts, "lidar": late_lidar})
    with DefaultRobot(model, empty_world) as robot:
        for _ in range(20):
            robot.clock.sleep(1 / 60)
            now = robot.clock.now()
            assert 0.2 - 1e-6 <= now - robot.part("lidar", Lidar).scan().stamp < 0.3 + 1e-6
            age = now - robot.part("left_pad", Tactile).read().stamp
            assert 0.015 - 1e-6 <= age < 0.015 + 1 / 60 + 1e-6


@pytest.mark.parametrize(
    ("name", "kind", "read"),
    [
        ("imu", SimulatedImu, SimulatedImu.read),
        ("left_pad", SimulatedTactile, SimulatedTactile.read),
        ("battery", SimulatedBattery, SimulatedBattery.read),
        ("lidar", SimulatedLidar, SimulatedLidar.scan),
        ("wrist_force_torque", SimulatedForceTorque, SimulatedForceTorque.wrench),
    ],
)
def test_a_sensor_that_is_switched_off_raises_and_a_frozen_one_repeats(
    robot: SimulatedRobot, name: str, kind: type[BodySensor], read: Callable[[BodySensor], Any]
) -> None:
    part = robot.part(name, kind)
    fresh = read(part)
    part.fault = SensorFault.FROZEN
    robot.clock.sleep(1.0)
    assert read(part).stamp == fresh.stamp
    part.fault = SensorFault.SILENT
    with pytest.raises(NoDataError, match=name):
        read(part)
    part.fault = None
    assert read(part).stamp > fresh.stamp
