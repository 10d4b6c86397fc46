"""A door that somebody shuts before the robot while it drives: nothing is touched, and it says why or goes on."""

from __future__ import annotations

import math

import pytest

from bestman_bt.engine import RUNNING, SUCCESS
from bestman_bt.runtime.robot_session import RobotSession
from hal.simulation.ground_truth import GroundTruth
from tests.behaviours.at_the_table import fastest, tick, tree_of
from tests.behaviours.driving import BEHIND_THE_DOORWAY, at, to
from tests.behaviours.truth import audited, why_not

pytestmark = pytest.mark.slow

LEAF = "new_door/door"
DOOR = "unmapped: {new_door: {model: wide_door, at: [0, 0, 180 deg], open: {door: 95 deg}}}"
"""Its leaf swings in the room that the robot drives to."""
SOMEBODY_SHUTS = "moving_doors: {new_door/door: {to: 0 deg, within: 90 cm, speed: 1.2 rad/s}}"
TWO_DOORWAYS = """
walls:
  height: 1.1 m
  thickness: 10 cm
  lines:
    - [[-3.6, -3.6], [4.2, -3.6]]
    - [[4.2, -3.6], [4.2, 2.0]]
    - [[4.2, 2.0], [-3.6, 2.0]]
    - [[-3.6, 2.0], [-3.6, -3.6]]
    - [[0.0, -3.6], [0.0, -3.0]]
    - [[0.0, -1.7], [0.0, -0.7]]
    - [[0.0, 0.7], [0.0, 2.0]]
""".strip()


def somebody_opens_it(session: RobotSession) -> None:
    """With a motor that is no stronger than a hand."""
    simulation = session.robot.simulation
    body, joint = simulation.built.articulations[LEAF]
    simulation.engine.turn(body, [joint], [1.0], [12.0])


def belief_error(session: RobotSession, truth: GroundTruth) -> float:
    return session.skills.world.base.pose.distance_to(truth.base_pose().to_pose2d())


def test_it_stops_before_a_door_that_stays_shut_and_reports_why(kitchen_with) -> None:
    session, truth = kitchen_with(DOOR, SOMEBODY_SHUTS)
    code, why = why_not(session, to(BEHIND_THE_DOORWAY, replans=0))
    assert truth.articulation_position(LEAF) < math.radians(3.0)
    assert code == "path_blocked"
    assert "an obstacle that is not on the map blocks the path" in why
    assert truth.base_pose().to_pose2d().x < -0.3
    assert fastest(session) < 0.01
    assert belief_error(session, truth) < 0.02
    assert audited(session).collisions == ()


def test_it_drives_on_when_the_door_is_opened_again(kitchen_with) -> None:
    session, truth = kitchen_with(DOOR, SOMEBODY_SHUTS)
    tree = session.load(tree_of(to(BEHIND_THE_DOORWAY)))
    while len(audited(session).disturbances) < 2:  # it moves, it has come to an end
        assert tick(tree, 4) == RUNNING
    assert truth.articulation_position(LEAF) < math.radians(3.0)
    assert truth.base_pose().to_pose2d().x < 0.0
    somebody_opens_it(session)
    assert tick(tree, 1200) == SUCCESS, session.skills.failures
    assert at(truth, BEHIND_THE_DOORWAY)
    assert audited(session).collisions == ()


def test_it_takes_another_doorway_where_there_is_one(kitchen_with) -> None:
    session, truth = kitchen_with(TWO_DOORWAYS, DOOR, SOMEBODY_SHUTS)
    tree, least = session.load(tree_of(to(BEHIND_THE_DOORWAY))), 0.0
    while tick(tree, 4) == RUNNING:
        least = min(least, float(truth.base_pose().position[1]))
    assert tree.status == SUCCESS, session.skills.failures
    assert truth.articulation_position(LEAF) < math.radians(3.0)
    assert least < -2.0
    assert at(truth, BEHIND_THE_DOORWAY)
    assert audited(session).collisions == ()
