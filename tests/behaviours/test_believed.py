"""Conditions on beliefs at the edges of their limits: of objects, of tidy things, of doors, of where the base is."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bestman_bt.engine import FAILURE, SUCCESS
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.world_model.world_model import BasePose, ObjectBelief
from tests.behaviours.scripted import ASKEW, codes, load, run, scripted_skills

GOAL = Pose.from_xyz_rpy((2.0, -1.0, 0.8), (0.0, 0.0, 2.5))


@pytest.fixture
def skills() -> Any:
    return scripted_skills()


def believe(skills: Any, pose: Pose, order: int = 1, stamp: float = 50.0, name: str = "cup") -> ObjectBelief:
    model = replace(skills.world.models["cup"], symmetry_order=order)
    skills.world.objects[name] = ObjectBelief(name, model, pose, 1.0, 0.002, stamp, "table/top")
    return skills.world.objects[name]


@pytest.mark.parametrize(
    ("off", "turn", "tilt", "order", "status"),
    [
        ((0.019, 0.0, 0.3), 0.0, 0.0, 1, SUCCESS),  # its height is no matter
        ((0.0, -0.021, 0.0), 0.0, 0.0, 1, FAILURE),
        ((0.015, 0.015, 0.0), 0.0, 0.0, 1, FAILURE),
        ((0.0, 0.0, 0.0), 0.0, math.radians(9.9), 1, SUCCESS),
        ((0.0, 0.0, 0.0), 0.0, math.radians(10.1), 1, FAILURE),
        ((0.0, 0.0, 0.0), 0.16, 0.0, 1, SUCCESS),
        ((0.0, 0.0, 0.0), -0.18, 0.0, 1, FAILURE),
        ((0.0, 0.0, 0.0), math.pi - 0.16, 0.0, 2, SUCCESS),
        ((0.0, 0.0, 0.0), math.pi - 0.16, 0.0, 1, FAILURE),
        ((0.0, 0.0, 0.0), math.pi / 2 + 0.16, 0.0, 4, SUCCESS),
        ((0.0, 0.0, 0.0), math.pi / 2 - 0.18, 0.0, 4, FAILURE),
        ((0.0, 0.0, 0.0), 1.0, 0.0, 0, SUCCESS),
    ],
)
def test_an_object_is_at_its_goal_within_each_tolerance(
    skills: Any, off: tuple[float, ...], turn: float, tilt: float, order: int, status: int
) -> None:
    pose = Pose(GOAL.position + np.array(off), (GOAL @ Pose.from_xyz_rpy((0, 0, 0), (0.0, tilt, turn))).quaternion)
    believe(skills, pose, order)
    body = '<ObjectAt object="cup" goal="{goal}" yaw_tolerance="0.17"/>'
    assert run(skills, load(skills, body, goal=GOAL)) == status
    assert codes(skills) == ([] if status == SUCCESS else ["not_at_goal"])


@pytest.mark.parametrize(("age", "status"), [(4.9, SUCCESS), (5.1, FAILURE)])
def test_an_object_is_visible_that_was_seen_lately(skills: Any, age: float, status: int) -> None:
    believe(skills, GOAL, stamp=skills.clock.now() - age)
    assert run(skills, load(skills, '<ObjectVisible object="cup"/>')) == status


def test_the_surface_that_an_object_is_believed_to_stand_on_goes_before_the_one_to_search_first(skills: Any) -> None:
    body = '<BelievedSurface object="cup" otherwise="counter" surface="{surface}"/>'
    tree = load(skills, body)
    assert run(skills, tree) == SUCCESS
    assert tree.blackboard.get("surface") == "counter"
    believe(skills, GOAL)
    assert run(skills, tree) == SUCCESS
    assert tree.blackboard.get("surface") == "table/top"
    skills.world.objects["cup"] = replace(skills.world.objects["cup"], surface=None)
    assert run(skills, tree) == SUCCESS
    assert tree.blackboard.get("surface") == "counter"


@pytest.mark.parametrize(
    ("x", "y", "z", "tilt", "tidy"),
    [
        (-0.26, -0.56, 0.0, 0.0, True),
        (-0.04, 0.36, 0.029, 0.0, True),
        (-0.27, 0.0, 0.0, 0.0, False),
        (-0.03, 0.0, 0.0, 0.0, False),
        (-0.1, -0.57, 0.0, 0.0, False),
        (-0.1, 0.37, 0.0, 0.0, False),
        (-0.1, 0.0, 0.031, 0.0, False),
        (-0.1, 0.0, -0.031, 0.0, False),
        (-0.1, 0.0, 0.0, 0.18, False),
    ],
)
def test_a_thing_is_tidy_within_the_region_by_the_margin_on_the_surface_and_upright(
    skills: Any, x: float, y: float, z: float, tilt: float, tidy: bool
) -> None:
    """On the counter, which stands across; a region from -30 to 0 cm and -60 to 40 cm with a margin of 3.5 cm."""
    furniture, surface = skills.world.surface("counter/top")
    height = -float(skills.world.models["cup"].bounds()[0, 2])
    local = Pose.from_xyz_rpy((x, y, z + height), (0.0, tilt, 0.0))
    believe(skills, furniture.pose.to_pose() @ surface.pose @ local)
    where = 'surface="counter/top" region_x="{x}" region_y="{y}"'
    entries: dict[str, Any] = {"x": [-0.3, 0.0], "y": [-0.6, 0.4], "seen": ["cup", "can"]}
    tree = load(skills, f'<FindUntidy seen="{{seen}}" {where} untidy="{{untidy}}"/>', **entries)
    assert run(skills, tree) == SUCCESS
    assert tree.blackboard.get("untidy") == ([] if tidy else ["cup"]) + ["can"]
    entries["seen"] = ["cup"]
    status = run(skills, load(skills, f'<IsTidy seen="{{seen}}" {where}/>', **entries))
    assert status == (SUCCESS if tidy else FAILURE)


def test_things_are_remembered_by_their_name_or_that_of_their_model_each_once_in_the_order_in_which_they_came(
    skills: Any,
) -> None:
    believe(skills, GOAL)
    believe(skills, GOAL, name="cup_2")
    believe(skills, GOAL, name="thing_1")
    skills.world.objects["thing_1"] = replace(
        skills.world.objects["thing_1"], model=replace(skills.world.models["cup"], name="thing")
    )
    tree = load(skills, '<RememberSeen objects="{o}" seen="{seen}"/>', o=["cup"], seen=["mug", "cup_2"])
    assert run(skills, tree) == SUCCESS
    assert tree.blackboard.get("seen") == ["mug", "cup_2", "cup"]


@pytest.mark.parametrize(
    ("std", "lost", "code"),
    [(0.49, False, None), (0.51, False, "no_pose"), (0.49, True, "lost"), (9.0, True, "no_pose")],
)
def test_the_base_knows_where_it_is_unless_it_is_unsure_or_lost(
    skills: Any, std: float, lost: bool, code: str | None
) -> None:
    skills.world.base = BasePose(ASKEW, std, 0.01, 50.0)
    skills.base.localisation = SimpleNamespace(lost=lost)
    assert run(skills, load(skills, "<InitialPoseReceived/>")) == (FAILURE if code else SUCCESS)
    assert codes(skills) == ([code] if code else [])


def test_a_base_is_stuck_as_its_controller_says(skills: Any) -> None:
    for stuck in (True, False):
        skills.base.stuck = stuck
        assert run(skills, load(skills, "<IsStuck/>")) == (SUCCESS if stuck else FAILURE)
    assert codes(skills) == ["not_stuck"]


def places(*probabilities: float) -> tuple[SimpleNamespace, ...]:
    return tuple(
        SimpleNamespace(pose=Pose2D(i, 0.0, 0.0), position_std=0.1, heading_std=0.2, probability=probability)
        for i, probability in enumerate(probabilities)
    )


@pytest.mark.parametrize(
    ("found", "turns", "code"),
    [
        ([places(0.96)], 0, None),
        ([places(0.5, 0.4), places(0.96, 0.03)], 1, None),
        ([(), places(0.96)], 1, None),
        ([places(0.5, 0.4)] * 3, 2, "ambiguous"),
        ([()] * 3, 2, "not_on_map"),
    ],
)
def test_it_looks_and_turns_until_one_place_is_certain_enough(
    skills: Any, found: list[Any], turns: int, code: str | None
) -> None:
    answers, scans, believed = iter(found), [], []
    corners = ((0.3, 0.2), (0.3, -0.2), (-0.3, -0.2), (-0.3, 0.2))
    skills.base.model = SimpleNamespace(footprint=corners)
    skills.base.lidar = SimpleNamespace(base_from_lidar=Pose2D())
    skills.base.scan = lambda: SimpleNamespace(scan=SimpleNamespace(points=lambda: np.array([[2.0, 0.0]])))
    skills.base.believe = lambda *told: believed.append(told)

    def locate(planar_map: Any, seen: list[Any], base_from_lidar: Pose2D) -> Any:
        scans.append(len(seen))
        return next(answers)

    skills.global_localization = SimpleNamespace(locate=locate)
    body = '<Relocalise looks="3" turn="0.6" certainty="0.95"/>'
    assert run(skills, load(skills, body)) == (FAILURE if code else SUCCESS)
    assert scans == list(range(1, turns + 2))
    assert [asked for asked in skills.base.asked if asked[0] == "turn"] == [("turn", 0.6)] * turns
    assert codes(skills) == ([code] if code else [])
    assert believed == ([] if code else [(Pose2D(0.0, 0.0, 0.0), 0.1, 0.2)])


@pytest.mark.parametrize(("away", "status"), [(0.38, FAILURE), (0.40, SUCCESS)])
def test_it_turns_only_where_its_corners_have_room(skills: Any, away: float, status: int) -> None:
    """The corners are 36 cm from the middle, and 3 cm must be free beyond; the lidar stands 20 cm ahead of it."""
    skills.base.model = SimpleNamespace(footprint=((0.3, 0.2), (-0.3, -0.2)))
    skills.base.lidar = SimpleNamespace(base_from_lidar=Pose2D(0.2, 0.0, math.pi / 2))
    behind = np.array([[0.0, away + 0.2]])  # to the left of a lidar that is turned to the left
    skills.base.scan = lambda: SimpleNamespace(scan=SimpleNamespace(points=lambda: behind))
    skills.base.believe = lambda *_: None
    answers = iter([(), places(0.99)])
    skills.global_localization = SimpleNamespace(locate=lambda *_: next(answers))
    assert run(skills, load(skills, '<Relocalise looks="2"/>')) == status
    assert codes(skills) == ([] if status == SUCCESS else ["no_room"])
