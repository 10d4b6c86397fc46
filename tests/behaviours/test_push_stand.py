"""Where the base stands to push an object, and in which direction it is pushed first."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bestman_bt.engine import FAILURE, SUCCESS
from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import BaseModel
from bestman_bt.world_model.world_model import ObjectBelief
from tests.behaviours.scripted import codes, load, run, scripted_skills

FIND = '<FindPushStand object="can" surface="table" goal="{goal}" stand="{stand}" towards="{towards}"/>'
STRAIGHT = FIND.replace(' towards="{towards}"', "")


def table_with(**places: tuple[float, float]) -> Any:
    """Skills that have seen objects on the table, each at (x, y) metres from its middle, x away from the robot."""
    skills = scripted_skills("push_object")
    skills.base.model = skills.robot.of(BaseModel)["base"]
    skills.base.layer = SimpleNamespace(on=lambda costmap: costmap)
    for name, place in places.items():
        model = skills.world.models[name]
        pose = Pose(on_table(skills, *place, -model.bounds()[0, 2]))
        skills.world.objects[name] = ObjectBelief(name, model, pose, 0.9, 0.002, 40.0, "table/top")
    return skills


def on_table(skills: Any, x: float, y: float, height: float = 0.0) -> np.ndarray:
    """A point of the map, (3,) metres."""
    table, top = skills.world.map.surface("table")
    return (table.pose.to_pose() @ top.pose).apply(np.array([x, y, height]))


def first_way(skills: Any, goal: tuple[float, float]) -> np.ndarray:
    """Where the can is pushed first, (2,) metres from the middle of the table."""
    tree = load(skills, FIND, goal=Pose(on_table(skills, *goal)))
    assert run(skills, tree) == SUCCESS, skills.failures
    table, top = skills.world.map.surface("table")
    return (table.pose.to_pose() @ top.pose).inverse().apply(tree.blackboard.get("towards").position)[:2]


@pytest.mark.slow
def test_an_object_is_pushed_straight_to_its_goal_where_the_hand_finds_room_behind_it() -> None:
    assert first_way(table_with(can=(-0.2, 0.0)), (-0.1, 0.1)) == pytest.approx([-0.1, 0.1], abs=1e-9)


def test_where_something_stands_behind_it_an_object_is_first_pushed_aside_and_clear_of_that() -> None:
    skills = table_with(can=(-0.2, 0.02), box=(-0.17, -0.15))
    first = first_way(skills, (-0.2, 0.15))
    assert np.linalg.norm(first - (-0.2, 0.02)) == pytest.approx(0.12)
    assert np.linalg.norm(first - (-0.2, 0.15)) > 0.05
    assert np.linalg.norm(first - (-0.17, -0.15)) > 0.1


@pytest.mark.slow
def test_an_object_in_the_way_of_every_push_is_named_before_anything_moves() -> None:
    around = {"box": (-0.2, -0.1), "cup": (-0.2, 0.14), "soup_can": (-0.09, 0.02)}
    skills = table_with(can=(-0.2, 0.02), **around)
    assert run(skills, load(skills, FIND, goal=Pose(on_table(skills, -0.2, 0.3)))) == FAILURE
    assert codes(skills) == ["no_stand"]
    assert any(name in skills.failures[-1].why for name in around)
    assert skills.base.asked == skills.arm.asked == []


def test_without_a_port_for_the_way_round_an_object_is_pushed_straight_or_what_is_in_the_way_is_named() -> None:
    skills = table_with(can=(-0.2, 0.02), box=(-0.17, -0.15))
    assert run(skills, load(skills, STRAIGHT, goal=Pose(on_table(skills, -0.2, 0.15)))) == FAILURE
    assert codes(skills) == ["no_stand"]
    assert "box" in skills.failures[-1].why


def test_an_object_is_not_pushed_straight_through_another_one() -> None:
    skills = table_with(can=(-0.25, -0.2), cup=(-0.25, -0.05))
    assert np.linalg.norm(first_way(skills, (-0.25, 0.15)) - (-0.25, 0.15)) > 0.05
    assert run(skills, load(skills, STRAIGHT, goal=Pose(on_table(skills, -0.25, 0.15)))) == FAILURE
    assert codes(skills) == ["no_stand"]
    assert "cup stands between the can and its goal" in skills.failures[-1].why


@pytest.mark.slow
def test_objects_far_below_the_surface_are_not_in_the_way_of_a_push() -> None:
    goal = (-0.2, 0.15)
    first = first_way(table_with(can=(-0.2, 0.02), box=(-0.17, -0.15)), goal)
    skills = table_with(can=(-0.2, 0.02), box=(-0.17, -0.15), cup=(float(first[0]), float(first[1])))
    cup = skills.world.objects["cup"]
    lower = Pose(cup.pose.position - (0.0, 0.0, 0.6), cup.pose.quaternion)
    skills.world.objects["cup"] = replace(cup, pose=lower, surface=None)
    assert first_way(skills, goal) == pytest.approx(first)


def test_an_object_that_is_at_its_goal_needs_no_other_stand() -> None:
    skills = table_with(can=(-0.2, 0.02))
    tree = load(skills, FIND, goal=Pose(on_table(skills, -0.2, 0.02)))
    assert run(skills, tree) == SUCCESS
    assert tree.blackboard.get("stand") == skills.world.base.pose
    np.testing.assert_allclose(tree.blackboard.get("towards").position, skills.world.objects["can"].pose.position)


@pytest.mark.slow
def test_an_object_is_not_pushed_straight_where_the_hand_would_hit_another_one_half_way() -> None:
    goal = (0.05, 0.0)
    assert first_way(table_with(can=(-0.27, 0.0)), goal) == pytest.approx(goal, abs=1e-9)
    first = first_way(table_with(can=(-0.27, 0.0), box=(-0.14, -0.115)), goal)
    assert np.linalg.norm(first - goal) > 0.05


def test_an_object_is_pushed_farther_aside_where_near_by_something_is_in_the_way_of_every_second_push() -> None:
    skills = table_with(can=(-0.28, -0.25), box=(-0.28, -0.07))
    first = first_way(skills, (-0.28, 0.25))
    assert np.linalg.norm(first - (-0.28, -0.25)) == pytest.approx(0.2)
