"""Driving where something is not as the map has it: around it, later, or not at all, and then it says why."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.engine import RUNNING, SUCCESS
from hal.simulation.base_drives import WheelMotors
from hal.simulation.sensor_pipeline import SensorFault
from tests.behaviours.at_the_table import fastest, tick, tree_of
from tests.behaviours.driving import BEHIND_THE_DOORWAY, at, to
from tests.behaviours.truth import audited, succeeds, why_not

pytestmark = pytest.mark.slow

CHAIR = "unmapped: {chair: {model: chair, at: [0.5, 0.3, 20 deg]}}"
DOOR = "unmapped: {new_door: {model: wide_door, at: [0, 0, 0]}}"
STANDING = "walkers: {count: 1, way_points: [[0.1, 0.0], [0.1, 0.3]], speed: [5 cm/s, 5 cm/s]}"
CROSSING = "walkers: {count: 1, way_points: [[0.7, -1.5], [0.7, 1.5]], speed: [0.6 m/s, 0.6 m/s]}"


def test_a_chair_that_the_map_does_not_have_is_driven_around(kitchen_with) -> None:
    session, truth = kitchen_with(CHAIR)
    assert succeeds(session, to(BEHIND_THE_DOORWAY, replans=0))
    assert at(truth, BEHIND_THE_DOORWAY)
    assert audited(session).collisions == ()


def test_somebody_who_crosses_the_way_is_not_touched(kitchen_with) -> None:
    session, truth = kitchen_with(CROSSING)
    assert succeeds(session, to(BEHIND_THE_DOORWAY))
    assert at(truth, BEHIND_THE_DOORWAY)
    assert audited(session).collisions == ()


def test_a_door_that_stays_shut_is_reported_after_the_recoveries(kitchen_with) -> None:
    session, truth = kitchen_with(DOOR)
    code, why = why_not(session, to(BEHIND_THE_DOORWAY, replans=1))
    assert code == "path_blocked"
    assert "an obstacle that is not on the map blocks the path" in why
    assert truth.base_pose().to_pose2d().x < -0.3
    assert fastest(session) < 0.01
    assert audited(session).collisions == ()


def test_a_halt_while_it_plans_around_something_leaves_nothing_moving(kitchen_with, monkeypatch) -> None:
    session, _ = kitchen_with(CHAIR)
    monkeypatch.setitem(session.skills.costs, "global_planning", 1.0)
    tree = session.load(tree_of(to(BEHIND_THE_DOORWAY)))
    while session.skills.base.blocked_at() is None:
        assert tick(tree) == RUNNING
    assert tick(tree, 6) == RUNNING  # the next look has begun to plan, and the base drives on
    tree.halt()
    session.robot.clock.sleep(0.6)
    assert fastest(session) < 0.01


def test_a_lidar_that_is_silent_for_a_moment_costs_time_and_no_more(kitchen_with) -> None:
    session, truth = kitchen_with()
    tree, lidar = session.load(tree_of(to("-0.5;0.0;0.0"))), session.robot.parts["lidar"]
    assert tick(tree, 30) == RUNNING
    lidar.fault = SensorFault.SILENT
    assert tick(tree, 20) == RUNNING
    assert fastest(session) < 0.01
    lidar.fault = None
    assert tick(tree, 400) == SUCCESS, session.skills.failures
    assert at(truth, "-0.5;0.0;0.0")


@pytest.mark.parametrize(
    ("fault", "code", "words"),
    [
        (SensorFault.SILENT, "no_data", "lidar"),
        (SensorFault.FROZEN, "blocked", "the lidar repeats the same scan"),
    ],
)
def test_a_lidar_that_fails_for_good_stops_the_base_and_is_named(kitchen_with, fault, code, words) -> None:
    session, truth = kitchen_with()
    tree, lidar = session.load(tree_of(to("-0.3;0.0;0.0", replans=1))), session.robot.parts["lidar"]
    assert tick(tree, 30) == RUNNING
    lidar.fault = fault
    before = truth.base_pose().to_pose2d()
    tick(tree, 600)
    failure = session.skills.failures[-1]
    assert failure.error_code == code
    assert words in failure.why
    assert truth.base_pose().to_pose2d().distance_to(before) < 0.4
    assert fastest(session) < 0.01


def test_wheels_that_do_not_turn_are_reported_and_not_taken_for_an_obstacle(kitchen_with, monkeypatch) -> None:
    session, truth = kitchen_with()
    before = truth.base_pose().to_pose2d()
    monkeypatch.setattr(WheelMotors, "drive", lambda motors, speeds: motors.park())
    code, why = why_not(session, to("-0.3;0.0;0.0", replans=1))
    assert code == "blocked"
    assert "its wheels do not turn as they should" in why
    assert truth.base_pose().to_pose2d().distance_to(before) < 0.01


@pytest.mark.parametrize(("goal", "code"), [("0.0;-1.5;0.0", "goal_blocked"), ("40.0;0.0;0.0", "goal_outside")])
def test_a_goal_in_a_wall_or_off_the_map_is_refused_at_once(kitchen_with, goal, code) -> None:
    session, truth = kitchen_with()
    before, begin = truth.base_pose().to_pose2d(), session.robot.clock.now()
    refused, why = why_not(session, to(goal))
    assert refused == code
    assert f"{float(goal.split(';')[0]):.2f}" in why
    assert session.robot.clock.now() - begin < 1.0
    assert truth.base_pose().to_pose2d().distance_to(before) < 0.001


def test_a_goal_that_somebody_stands_on_is_waited_for_and_then_told(kitchen_with) -> None:
    session, truth = kitchen_with(STANDING)
    code, why = why_not(session, to("0.1;0.0;0.0", replans=0))
    assert code == "path_blocked"
    assert "an obstacle that is not on the map blocks the path" in why
    assert np.hypot(*(truth.base_pose().position[:2] - [0.1, 0.0])) > 0.5
    assert audited(session).collisions == ()


def test_the_robot_returns_to_where_its_tree_began(kitchen_with) -> None:
    session, truth = kitchen_with()
    began = truth.base_pose().to_pose2d()
    tree = f"""<root BTCPP_format="4" main_tree_to_execute="Main">
    <BehaviorTree ID="Main"><Sequence>{to("-1.0;0.3;1.0")}<SubTree ID="Back"/></Sequence></BehaviorTree>
    <BehaviorTree ID="Back"><ReturnToStart/></BehaviorTree></root>"""
    assert tick(session.load(tree), 2000) == SUCCESS
    ended = truth.base_pose().to_pose2d()
    assert ended.distance_to(began) < 0.06, "the robot is told to 5 cm where it starts"
    assert abs(ended.theta - began.theta) < 0.1
