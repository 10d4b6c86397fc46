"""Pushing: where the object really goes, and what is refused or told."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviours.manipulation.push import push_tool_poses, spread
from behaviours.parameters import PushParameters
from bestman_bt.messages import Pose
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.scene.load import load_scene
from hal.simulation.ground_truth import GroundTruth
from tests.behaviours.truth import audited, known_world, put, succeeds, table_with, why_not

SEE = '<LookAt object="{name}" surface="table"/><DetectObject object="{name}" surface="table"/>'


def goal_beside(truth: GroundTruth, name: str, x: float, y: float) -> str:
    """A goal that far away from the robot and to its left of where the thing is, metres, as a tree writes it."""
    place = truth.object_pose(name).position + truth.furniture_pose("table").rotation @ np.array([x, y, 0.0])
    return ";".join(f"{value:.4f}" for value in place)


def push(session: RobotSession, name: str, goal: str) -> bool:
    return succeeds(session, f'<Sequence>{SEE.format(name=name)}<Push object="{name}" goal="{goal}"/></Sequence>')


@pytest.mark.slow
@pytest.mark.parametrize(("model", "yaw", "heading"), [("can", 0.0, 0.0), ("box", 0.0, 90.0), ("box", 25.0, -140.0)])
def test_a_thing_stands_upright_at_its_goal_after_the_push(tmp_path, model, yaw, heading) -> None:
    config = table_with(tmp_path, heading=heading, **{model: (model, -0.2, 0.0, yaw)})
    with known_world(config) as (session, truth):
        there = truth.object_pose(model)
        assert push(session, model, goal_beside(truth, model, 0.12, 0.02)), session.skills.failures
        session.robot.clock.sleep(0.5)
        pose = truth.object_pose(model)
        went = truth.furniture_pose("table").rotation.T @ (pose.position - there.position)
        assert went[:2] == pytest.approx([0.12, 0.02], abs=0.015)
        assert pose.tilt < math.radians(2)
        believed = session.skills.world.objects[model].pose
        assert believed.position[:2] == pytest.approx(pose.position[:2], abs=0.015)
        assert not truth.touches_robot(model)
        assert audited(session).honest


@pytest.mark.slow
def test_what_stands_against_a_wall_that_nobody_saw_is_reported_as_blocked(tmp_path) -> None:
    """Three soup cans in a row, which weigh more than the wrist allows, come into the way after the look."""
    things = {f"heavy{i}": ("soup_can", 0.2, 0.25 + 0.08 * i, 0.0) for i in range(3)}
    with known_world(table_with(tmp_path, can=("can", -0.2, 0.0, 0.0), **things)) as (session, truth):
        goal = goal_beside(truth, "can", 0.2, 0.0)
        assert succeeds(session, f"<Sequence>{SEE.format(name='can')}</Sequence>")
        middle = truth.object_pose("can").position
        along = truth.furniture_pose("table").rotation
        for i in range(3):
            place = middle + along @ np.array([0.08 + 0.066 * i, 0.0, -0.017])
            put(session, f"heavy{i}", place - truth.object_pose(f"heavy{i}").position)
        for name in list(session.skills.world.objects):
            if name != "can":
                del session.skills.world.objects[name]
        code, words = why_not(session, f'<Push object="can" goal="{goal}" max_force="4"/>')
        assert code == "blocked", words
        assert "the can resists with" in words
        assert not truth.touches_robot("can")
        moved = (truth.object_pose("can").position - middle) @ along[:, 0]
        believed = (session.skills.world.objects["can"].pose.position - middle) @ along[:, 0]
        assert believed == pytest.approx(moved, abs=0.01)
        assert moved < 0.15


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """A can that was seen; nothing here moves it."""
    config = table_with(tmp_path_factory.mktemp("scene"), can=("can", -0.2, 0.0, 0.0))
    with known_world(config) as (session, truth):
        assert succeeds(session, f"<Sequence>{SEE.format(name='can')}</Sequence>")
        yield session, truth


def test_a_goal_beyond_the_edge_of_the_table_is_refused(seen) -> None:
    session, truth = seen
    code, words = why_not(session, f'<Push object="can" goal="{goal_beside(truth, "can", -0.19, 0.0)}"/>')
    assert code == "off_surface"
    assert "from the edge of table" in words


def test_what_was_never_seen_is_not_pushed(seen) -> None:
    session, truth = seen
    goal = goal_beside(truth, "can", 0.1, 0.0)
    assert why_not(session, f'<Push object="cup" goal="{goal}"/>')[0] == "not_found"
    assert why_not(session, f'<FindPushStand object="cup" surface="table" goal="{goal}" stand="{{s}}"/>')[0] == (
        "not_found"
    )


@pytest.mark.slow
def test_a_goal_out_of_reach_is_refused_before_anything_moves(seen) -> None:
    session, truth = seen
    before = session.skills.arm_positions()
    code, _ = why_not(session, f'<Push object="can" goal="{goal_beside(truth, "can", 0.5, 0.5)}"/>')
    assert code == "no_approach"
    assert np.abs(session.skills.arm_positions() - before).max() < 0.01


def test_what_is_at_its_goal_is_left_alone(seen) -> None:
    session, truth = seen
    believed = session.skills.world.objects["can"].pose.position
    goal = ";".join(f"{value:.5f}" for value in believed)
    assert succeeds(session, f'<Push object="can" goal="{goal}"/>')
    assert truth.object_pose("can").position == pytest.approx(believed, abs=0.005)


def test_the_fingertips_come_from_behind_low_and_lean_back() -> None:
    model = load_scene("kitchen").models["can"]
    direction = np.array([0.6, 0.8, 0.0])
    object_pose = Pose([1.0, 2.0, 0.75 + 0.0675])
    poses = list(push_tool_poses(model, object_pose, direction, PushParameters()))
    assert len(poses) == 8, "four tilts, either side of the hand up"
    for pose in poses:
        way = pose.position - object_pose.position
        assert way[:2] @ direction[:2] < -PushParameters().standoff
        assert np.cross(way, direction)[2] == pytest.approx(0.0, abs=1e-9)
        assert pose.position[2] == pytest.approx(0.75 + PushParameters().tip_height)
        x, y, z = pose.rotation.T
        assert y @ direction == pytest.approx(0.0, abs=1e-9)
        assert y[2] == pytest.approx(0.0, abs=1e-9)
        assert z[2] < 0.0 < z @ direction
        assert np.linalg.det(pose.rotation) == pytest.approx(1.0)
        assert abs(x @ direction) > 0.3


def test_the_fingers_stand_apart_by_half_the_width_but_no_wider_than_the_hand_opens() -> None:
    models = load_scene("kitchen").models
    assert spread(models["box"], 0.08, PushParameters()) == pytest.approx(0.03)
    assert spread(models["box"], 0.02, PushParameters()) == 0.02
