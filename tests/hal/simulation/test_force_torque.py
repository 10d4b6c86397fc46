"""The wrist's force-torque sensor feels what the world does to the hand, in its own frame."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.payload import payload
from bestman_bt.robot_model.sensor_parts import MountedForceTorque
from bestman_bt.scene.scene import FurnitureModel, PlacedFurniture, PlacedObject, World
from hal.api import ForceTorque, NotConnectedError
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.robot import SimulatedRobot
from tests.default_engine import DefaultRobot

SENSOR = "wrist_force_torque"
AT_HOME = DefaultRobot.parameters_class(initial_postures=("home",))


def weight_between_fingers(model: RobotModel, empty: World) -> World:
    """Half a kilogram on a pedestal, where the open hand is at its home posture."""
    tool = ForwardKinematics(model).pose(model.of(ArmModel)["arm"].tool_frame, model.postures["home"]).position
    weight = ObjectModel("weight", (0.8, 0.2, 0.2), 0.5, 0.8, (PlacedShape(Box((0.04, 0.04, 0.08)), Pose()),))
    height = tool[2] - 0.07
    post = PlacedShape(Box((0.1, 0.1, height)), Pose(np.array([0.0, 0.0, height / 2])))
    pedestal = FurnitureModel("pedestal", (0.1, 0.1), (post,), ((0.5, 0.5, 0.5, 1.0),), ())
    at = Pose2D(float(tool[0]), float(tool[1]), 0.0)
    placed = PlacedObject("weight", weight, Pose(np.array([at.x, at.y, height + 0.041])))
    return dataclasses.replace(empty, furniture=(PlacedFurniture("pedestal", pedestal, at, at),), objects=(placed,))


@pytest.fixture(scope="module")
def exact_model(robot_model: RobotModel) -> RobotModel:
    """The same robot with a sensor that does not err."""
    sensor = robot_model.of(MountedForceTorque)[SENSOR]
    part = dataclasses.replace(sensor.part, noise_force=0.0, noise_torque=0.0, offset_force=0.0, offset_torque=0.0)
    return dataclasses.replace(robot_model, parts={**robot_model.parts, SENSOR: dataclasses.replace(sensor, part=part)})


def test_it_weighs_the_hand_with_its_camera(exact_model: RobotModel, empty_world) -> None:
    with DefaultRobot(exact_model, empty_world) as robot:
        truth, sensor = GroundTruth(robot), robot.part(SENSOR, ForceTorque)
        robot.parts["arm"].move_to([0.3, -0.6, 0.2, -2.0, 0.4, 1.2, 0.2], 0.5)
        robot.clock.sleep(4.0)
        carried = payload(exact_model, sensor.frame)
        assert carried.mass == pytest.approx(1.07, abs=0.01)
        weight = truth.frame_pose(sensor.frame).rotation.T @ [0.0, 0.0, -9.81 * carried.mass]
        np.testing.assert_allclose(sensor.wrench().force, weight, atol=0.05)
        np.testing.assert_allclose(sensor.wrench().torque, np.cross(carried.centre, weight), atol=0.01)


@pytest.mark.slow
def test_a_mass_that_hangs_on_the_hand_pulls_down_with_its_weight(exact_model: RobotModel, empty_world) -> None:
    with DefaultRobot(exact_model, weight_between_fingers(exact_model, empty_world), parameters=AT_HOME) as robot:
        truth, sensor = GroundTruth(robot), robot.part(SENSOR, ForceTorque)
        robot.clock.sleep(0.3)
        robot.parts["gripper"].close(40.0)
        robot.clock.sleep(1.5)
        robot.parts["arm"].move_to([0.0, -0.985, 0.0, -2.356, 0.0, 1.571, 0.785], 0.2)
        robot.clock.sleep(3.0)
        map_from_sensor, carried = truth.frame_pose(sensor.frame), payload(exact_model, sensor.frame)
        assert truth.supports("weight") == ()
        turn = map_from_sensor.rotation.T
        hand, pull = turn @ [0.0, 0.0, -9.81 * carried.mass], turn @ [0.0, 0.0, -9.81 * 0.5]
        np.testing.assert_allclose(sensor.wrench().force, hand + pull, atol=0.05)


@pytest.mark.slow
def test_noise_and_offset_are_as_described_and_the_seed_decides_them(
    robot_model: RobotModel, exact_model: RobotModel, empty_world
) -> None:
    def readings(model: RobotModel, seed: int) -> np.ndarray:
        """(60, 6), newtons and newton metres."""
        with DefaultRobot(model, empty_world, seed=seed) as robot:
            sensor = robot.part(SENSOR, ForceTorque)
            values = []
            for _ in range(60):
                robot.clock.sleep(1 / 240)
                values.append(np.append(sensor.wrench().force, sensor.wrench().torque))
            return np.array(values)

    model = robot_model.of(MountedForceTorque)[SENSOR].part
    first, exact = readings(robot_model, 1), readings(exact_model, 1)
    np.testing.assert_array_equal(first, readings(robot_model, 1))
    errors = first - exact  # the motion is the same
    noise = np.sqrt(errors.var(axis=0).reshape(2, 3).mean(axis=1))
    np.testing.assert_allclose(noise, [model.noise_force, model.noise_torque], rtol=0.15)
    deviations = np.array([model.offset_force, model.offset_torque])
    other = readings(robot_model, 2) - readings(exact_model, 2)
    offsets = np.array([errors.mean(axis=0), other.mean(axis=0)]).reshape(2, 2, 3)  # seed, kind, axis
    assert (np.abs(offsets).max(axis=(0, 2)) < 3.0 * deviations).all()
    assert (np.abs(offsets[0] - offsets[1]).max(axis=1) > 0.5 * deviations).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_beyond_its_range_it_reports_its_range_whichever_way_it_is_pushed(
    standing_robot: SimulatedRobot, monkeypatch: pytest.MonkeyPatch, sign: float
) -> None:
    sensor, model = standing_robot.part(SENSOR, ForceTorque), standing_robot.model.of(MountedForceTorque)[SENSOR].part
    monkeypatch.setattr(sensor, "_load", lambda *_: np.full(6, sign * 1e6))
    standing_robot.clock.sleep(2.0 / model.rate + 0.01)
    wrench = sensor.wrench()
    assert wrench.force.tolist() == [sign * model.max_force] * 3
    assert wrench.torque.tolist() == [sign * model.max_torque] * 3


def test_two_readings_within_a_period_are_the_same_one(standing_robot: SimulatedRobot) -> None:
    sensor = standing_robot.part(SENSOR, ForceTorque)
    assert sensor.wrench() is sensor.wrench()
    before = sensor.wrench()
    standing_robot.clock.sleep(1 / 60)
    assert sensor.wrench().stamp > before.stamp


@pytest.mark.slow
def test_reading_it_changes_nothing_of_the_motion(robot_model: RobotModel, empty_world) -> None:
    def swing(read: bool) -> np.ndarray:
        with DefaultRobot(robot_model, empty_world, seed=1) as robot:
            arm, sensor = robot.parts["arm"], robot.part(SENSOR, ForceTorque)
            arm.move_to([0, -0.785, 0, -2.356, 0, 1.571, 0.785])
            for _ in range(60):
                robot.clock.sleep(1 / 60)
                if read:
                    sensor.wrench()
            return arm.positions()

    np.testing.assert_array_equal(swing(True), swing(False))


def test_without_a_connection_it_reports_it(robot_model: RobotModel, empty_world) -> None:
    with pytest.raises(NotConnectedError, match=SENSOR):
        DefaultRobot(robot_model, empty_world).part(SENSOR, ForceTorque).wrench()
