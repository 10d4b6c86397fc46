"""One number closes the sixteen joints of an Allegro hand, with a bounded force, around what is in it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from bestman_bt.configuration import Document
from bestman_bt.control import MotionStatus
from bestman_bt.control.hand_synergy import HandOutcome, HandSynergy
from bestman_bt.messages import Cylinder, MotionErrorCode, PlacedShape, Pose, Pose2D
from bestman_bt.robot_model import RobotModel, compose_robot
from bestman_bt.scene import FurnitureModel, PlacedFurniture, World
from hal.api import JointGroup
from hal.pybullet import PyBulletRobot


@pytest.fixture(scope="module")
def hand_model() -> RobotModel:
    parts = {"post": {"part": "column"}, "hand": {"part": "allegro_hand", "mount": "post"}}
    return compose_robot("hand_on_post", Document({"parts": parts}))


def synergy(robot: PyBulletRobot) -> HandSynergy:
    hand, model = robot.part("hand", JointGroup), robot.model
    opened, fist = (model.posture(name, hand.joint_names) for name in ("open", "fist"))
    return HandSynergy(hand, robot.clock, opened, fist)


def finish(robot: PyBulletRobot, handle) -> HandOutcome:
    while not handle.done:
        robot.clock.sleep(0.02)
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    return handle.result


@pytest.fixture
def empty_hand(hand_model: RobotModel) -> Iterator[PyBulletRobot]:
    with PyBulletRobot(hand_model, World("floor", 0, (), (), (), Pose2D(), {})) as robot:
        yield robot


def test_it_closes_and_opens_all_fingers(empty_hand: PyBulletRobot) -> None:
    hand = synergy(empty_hand)
    closed = finish(empty_hand, hand.close())
    assert closed.closure == pytest.approx(1.0, abs=0.02)
    assert not closed.object_held
    opened = finish(empty_hand, hand.open())
    assert opened.closure == pytest.approx(0.0, abs=0.02)
    assert not empty_hand.audit_record().joint_limits


def test_it_stops_at_the_closure_that_is_asked_for(empty_hand: PyBulletRobot) -> None:
    assert finish(empty_hand, synergy(empty_hand).move(0.4)).closure == pytest.approx(0.4, abs=0.02)


@pytest.fixture
def hand_with_rod(hand_model: RobotModel) -> Iterator[PyBulletRobot]:
    """A rod of 5 cm stands where the fingers close, 4 cm before the palm."""
    at = Pose2D(0.075, 0.0, 0.0)
    rod = PlacedShape(Cylinder(0.025, 0.7), Pose(np.array([0.0, 0.0, 0.35])))
    model = FurnitureModel("rod", (0.05, 0.05), (rod,), ((0.5, 0.5, 0.5, 1.0),), ())
    world = World("rod", 0, (), (PlacedFurniture("rod", model, at, at),), (), Pose2D(), {})
    with PyBulletRobot(hand_model, world) as robot:
        yield robot


def test_it_closes_on_a_rod_with_the_force_that_is_asked_for(hand_with_rod: PyBulletRobot) -> None:
    hand, group = synergy(hand_with_rod), hand_with_rod.part("hand", JointGroup)
    presses = []
    for force in (1.0, 3.0):
        outcome = finish(hand_with_rod, hand.close(force))
        assert outcome.object_held
        assert outcome.closure < 0.9
        hand_with_rod.clock.sleep(0.3)
        assert np.abs(group.efforts()).max() <= force * 0.09 + 0.01
        contacts = hand_with_rod.simulation.engine.client.getContactPoints(
            hand_with_rod.simulation.built.robot, hand_with_rod.simulation.built.furniture["rod"]
        )
        presses.append(sum(contact[9] for contact in contacts))
    assert presses[1] > 1.8 * presses[0] > 0.0


def test_a_stop_ends_the_closing(empty_hand: PyBulletRobot) -> None:
    handle = synergy(empty_hand).close()
    empty_hand.clock.sleep(0.3)
    empty_hand.stop()
    empty_hand.clock.sleep(0.1)
    assert handle.failure is not None
    assert handle.failure.code is MotionErrorCode.STOPPED


def test_what_makes_no_sense_is_refused(empty_hand: PyBulletRobot) -> None:
    hand = synergy(empty_hand)
    with pytest.raises(ValueError, match="closure"):
        hand.move(1.5)
    with pytest.raises(ValueError, match="force"):
        hand.close(0.0)
    with pytest.raises(ValueError, match="joints"):
        HandSynergy(empty_hand.part("hand", JointGroup), empty_hand.clock, [0.0], [1.0])
