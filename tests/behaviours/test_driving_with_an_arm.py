"""The outline that skills plan and check drives with has the arm in it, as it stands and with what it holds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviours.context import DRIVEN
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.world_model.world_model import HeldObject
from hal.api import NotConnectedError
from tests.behaviours.driving import at, to
from tests.behaviours.truth import audited, succeeds, why_not


def test_the_outline_is_that_of_the_posture_of_the_arm_and_of_what_it_holds(bystander) -> None:
    skills = bystander.skills
    home, carried = skills.footprint("home"), skills.footprint(DRIVEN)
    assert home.overhang.reach > 0.2
    assert home.overhang.height > 1.0
    assert carried.overhang.reach < 0.1
    assert skills.footprint("unknown").overhang is None
    np.testing.assert_array_equal(home.corners, carried.corners)
    bar = ObjectModel("bar", (1.0, 0.0, 0.0), 0.2, 0.5, (PlacedShape(Box((0.9, 0.02, 0.02)), Pose()),))
    skills.held = HeldObject("bar", bar, Pose(), 0.02)
    try:
        assert skills.footprint(DRIVEN).overhang.reach > carried.overhang.reach + 0.05
    finally:
        skills.held = None


def test_every_costmap_of_the_skills_has_the_arm_in_it(bystander) -> None:
    skills = bystander.skills
    for costmap in (skills.known_costmap(), skills.seen_costmap()):
        assert (costmap.tall is None) == (skills.footprint().overhang is None)
    assert skills.known_costmap("home").tall is not None


@pytest.mark.slow
def test_a_goal_that_the_arm_is_in_the_way_of_is_refused_and_reached_with_the_arm_over_the_base(kitchen_with) -> None:
    session, truth = kitchen_with()
    skills = session.skills
    assert succeeds(session, '<MoveArm posture="home"/>')
    wall = float(skills.world.map.walls[:, [0, 2]].min())
    facing = Pose2D(wall + 0.28 + 0.1, 0.0, math.pi)
    assert skills.known_costmap(DRIVEN).clearance_at(facing) > 0.0
    goal = f"{facing.x};{facing.y};{facing.theta}"
    before = truth.base_pose().to_pose2d()
    code, why = why_not(session, to(goal))
    assert code == "arm_in_the_way"
    assert "the arm extends 2" in why
    assert truth.base_pose().to_pose2d().distance_to(before) < 0.001
    assert succeeds(session, f'<Sequence><MoveArm posture="carry"/>{to(goal)}</Sequence>')
    assert at(truth, goal)
    assert audited(session).collisions == ()


@pytest.mark.slow
def test_a_drive_past_a_wall_keeps_the_arm_off_it(kitchen_with) -> None:
    """Through the doorway and back with the arm out ahead."""
    session, truth = kitchen_with()
    assert succeeds(session, '<MoveArm posture="home"/>')
    assert succeeds(session, f"<Sequence>{to('1.2;0.0;0.0')}{to('-1.3;0.0;0.0')}</Sequence>")
    assert at(truth, "-1.3;0.0;0.0")
    assert audited(session).collisions == ()


@pytest.mark.slow
def test_encoders_that_are_silent_when_a_drive_begins_cost_time_and_no_more(kitchen_with, monkeypatch) -> None:
    session, truth = kitchen_with()
    positions, silent = session.skills.joints.positions, iter([True])

    def sometimes():
        if next(silent, False):
            raise NotConnectedError("the arm tells no positions")
        return positions()

    monkeypatch.setattr(session.skills.joints, "positions", sometimes)
    assert succeeds(session, to("-0.9;0.0;0.0"))
    assert at(truth, "-0.9;0.0;0.0")
    assert next(silent, None) is None
