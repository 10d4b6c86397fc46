"""Doors that a person moves before the robot: by motors, told as a disturbance, and no fault of the run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest

from bestman_bt.evaluation.audit import Audit, audit
from bestman_bt.messages import Pose2D
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from hal.api import MobileBase
from hal.simulation.ground_truth import GroundTruth
from tests.default_engine import DefaultRobot

DOOR = "new_door/door"


@pytest.fixture(scope="module")
def run() -> Iterator[tuple[list[tuple[float, float]], Audit]]:
    """The robot drives from 1.5 m before the doorway to 70 cm before it: its distance and the door, as they went."""
    world = replace(draw_world(load_scene("kitchen_closing_door"), 0), robot_start=Pose2D(-1.5, 0.0, 0.0), objects=())
    with DefaultRobot(load_robot_model("diff_panda"), world) as robot:
        truth, base = GroundTruth(robot), robot.part("base", MobileBase)
        seen = []
        for step in range(110):
            if step < 54:
                base.set_velocity(0.3, 0.0, 0.0)
            robot.clock.sleep(0.05)
            seen.append((math.hypot(*truth.base_pose().position[:2]), truth.articulation_position(DOOR)))
        yield seen, audit(robot.audit_record())


def test_the_door_stands_until_the_robot_is_near_and_is_then_shut(run: tuple[list[tuple[float, float]], Audit]) -> None:
    seen, _ = run
    assert all(position == pytest.approx(math.radians(95.0), abs=0.01) for away, position in seen if away > 0.92)
    assert seen[-1][1] == pytest.approx(0.0, abs=math.radians(1.5))


def test_nobody_is_blamed_for_it(run: tuple[list[tuple[float, float]], Audit]) -> None:
    _, judged = run
    assert judged.honest
    assert not judged.collisions
    assert [text.partition(": ")[2] for text in judged.disturbances] == [
        f"a person moves {DOOR} to 0°",
        f"{DOOR} has come to 0°",
    ]
