"""What arm, hand and base keep clear of at doors and drawers that stand askew; nothing moves."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from behaviours.furniture.articulation import ArticulationPath, FurnitureArticulation, room_beside, world_at_opening
from behaviours.furniture.articulation_motion import UNSURE, retreat
from behaviours.furniture.close import pushes
from behaviours.furniture.opening import plan_opening
from behaviours.manipulation.base_placement import SAME_STAND
from bestman_bt.engine import SUCCESS
from bestman_bt.manipulation.kinematics.link_hulls import body_between
from bestman_bt.manipulation.motion_planning.base import MotionPlanningError, PlanningErrorCode
from bestman_bt.messages import Handle, Pose, Pose2D
from bestman_bt.world_model.openness import handle_shape
from bestman_bt.world_model.world_model import BasePose, HandleBelief
from tests.behaviours.scripted import load, run, scripted_skills
from tests.behaviours.test_doors_seen import door_and_handle

DRAWER, DOOR = ("drawer_chest", "drawer_2"), ("fridge", "upper_door")


def standing_at(name: str, part: str, position: float = 0.0) -> tuple[Any, FurnitureArticulation, Handle]:
    """Skills on whose map the door is, as open as is said, with its handle."""
    door, handle = door_and_handle(name, part, position)
    skills = scripted_skills("fetch_from_drawer")
    skills.world.map = skills.world.map.with_furniture(door.furniture)
    skills.world.believe_articulation(door.name, position)
    skills.world.handles["handle"] = HandleBelief("handle", handle, 0.0, name)
    return skills, door, handle


@pytest.mark.parametrize(("name", "part", "position"), [(*DRAWER, 0.2), (*DOOR, 0.9)])
def test_a_door_may_be_open_more_or_less_by_the_margin(name: str, part: str, position: float) -> None:
    skills, door, _ = standing_at(name, part, position)
    skills.world.base = BasePose(Pose2D(0.9, -0.9, 0.4), 0.01, 0.01, 0.0)
    skills.arm_world = lambda scene: scene
    base_from_map = skills.map_from_base.inverse()
    for margin in (0.0, 0.06):
        scene: Any = world_at_opening(skills, door, position, "free", margin=margin)
        (body,) = (obstacle for obstacle in scene.obstacles if obstacle.name == door.name)
        places = np.array([placed.pose.position for placed in body.shapes])
        for off in (-0.06, 0.0, 0.06):
            front = (base_from_map @ door.front(position + off)).position
            there = bool(np.linalg.norm(places - front, axis=1).min() < 1e-6)
            assert there is (abs(off) <= margin)


@pytest.mark.parametrize(("name", "part", "position", "asked"), [(*DRAWER, 0.1, 0.2), (*DOOR, 0.4, 0.9)])
def test_a_door_that_is_half_open_is_opened_by_the_rest(name: str, part: str, position: float, asked: float) -> None:
    skills, door, _ = standing_at(name, part, position)
    belief = skills.world.handles["handle"]
    half = plan_opening(skills, door.name, belief, asked)
    skills.world.believe_articulation(door.name, 0.0)
    shut = plan_opening(skills, door.name, belief, asked)
    assert (half.start, shut.start) == (position, 0.0)
    if door.articulation.kind == "prismatic":
        assert shut.distance - half.distance == pytest.approx(position)
    else:
        assert shut.angle - half.angle == pytest.approx(position)


@pytest.mark.parametrize("theta", [0.0, 2.1, -1.2])
def test_a_base_stands_where_its_body_is_clear_of_where_the_door_passes(
    theta: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    skills, door, _ = standing_at(*DRAWER)
    passed = np.array([[0.4, -0.3]])
    monkeypatch.setattr("behaviours.furniture.articulation.swept_by", lambda *_: passed)
    skills.known_costmap = lambda _: SimpleNamespace(clearance_at=lambda stand: 1.0)
    apart = skills.parameters.furniture.base_clearance
    front = door.articulation.shapes[0]
    low = float(front.pose.position[2]) - front.shape.size[2] / 2
    body = body_between(
        skills.robot, skills.joints.positions(), skills.arm.name, low - apart, low + front.shape.size[2]
    )
    assert body is not None
    is_free, gap = room_beside(skills, door, [0.0]), apart + front.shape.size[0] / 2
    lower, upper = body
    for local, free in (
        ((upper[0] + gap - 0.01, upper[1] + gap - 0.01), False),
        ((upper[0] + gap + 0.01, upper[1]), True),
        ((lower[0] - gap + 0.01, lower[1]), False),
        ((lower[0], lower[1] - gap - 0.01), True),
    ):
        away = Pose2D(theta=theta).apply(np.array([local]))[0]
        assert is_free(Pose2D(*(passed[0] - away), theta)) is free


@pytest.mark.parametrize("door_name", ["FindOpenStand", "FindCloseStand"])
def test_asked_again_it_gives_another_stand(door_name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    skills, door, handle = standing_at(*DRAWER, 0.2)

    def first(skills_of_door: Any, door_of_way: FurnitureArticulation, ways: Any) -> list[SimpleNamespace]:
        way: ArticulationPath = next(iter(ways))
        return [SimpleNamespace(pose=way.stands[0])]

    monkeypatch.setattr("behaviours.furniture.base_placement.find_stands", first)
    monkeypatch.setattr("behaviours.furniture.base_placement.room_beside", lambda *_: lambda stand: True)
    grasp = SimpleNamespace(grasp=handle.pose, pre_grasp=handle.pose)
    monkeypatch.setattr("behaviours.furniture.base_placement.pull_grasps", lambda *_: [grasp])
    opening = 'handle="handle" opening="0.25"' if door_name == "FindOpenStand" else ""
    tree = load(skills, f'<{door_name} articulation="{door.name}" {opening} stand="{{stand}}"/>')
    stands: list[Pose2D] = []
    for _ in range(4):
        assert run(skills, tree) == SUCCESS
        stands.append(tree.blackboard.get("stand"))
    assert all(one.distance_to(other) > SAME_STAND for one, other in pairwise(stands))
    assert len(set(stands)) == 4


@pytest.mark.parametrize("places", [(0.0, -0.12), (-0.12, 0.0), (0.0, 0.12)])
def test_no_push_is_near_any_of_two_handles(places: tuple[float, float]) -> None:
    skills, door, handle = standing_at(*DRAWER, 0.2)
    front = door.front(0.2)
    width = door.articulation.shapes[0].shape.size[1]
    skills.world.handles.clear()
    for number, place in enumerate(places):
        moved = handle.seen_from(Pose(place * width * front.rotation[:, 1]))
        skills.world.handles[f"handle_{number}"] = HandleBelief(f"handle_{number}", moved, 0.0, door.furniture.name)
    assert len(skills.world.handles_of(door.furniture, door.articulation)) == 2
    points = [push.at(0.2) for push in pushes(skills, door)]
    assert points
    for belief in skills.world.handles.values():
        bar = handle_shape(belief.handle)
        outside = np.abs(bar.pose.inverse().apply(np.array(points))) - np.array(bar.shape.size) / 2
        assert np.linalg.norm(np.maximum(outside, 0.0), axis=1).min() > skills.parameters.close.handle_clearance


@pytest.mark.parametrize(("name", "part"), [DRAWER, DOOR])
def test_on_its_way_home_the_arm_keeps_clear_of_a_door_as_unsure_as_it_is_if_it_can(
    name: str, part: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    skills, door, _ = standing_at(name, part, 0.2)
    unsure, told = UNSURE[door.articulation.kind], []
    refused: list[tuple[float, tuple[str, ...]]] = []
    touches: set[tuple[float, tuple[str, ...]]] = set()
    others: list[tuple[str, str]] = []

    def around(*arguments: Any, ignore: Any = (), margin: float = 0.0, felt: Any = None) -> SimpleNamespace:
        which = margin, tuple(ignore)
        pairs = (*others, *([(door.name, "panda_hand")] if which in touches else []))
        return SimpleNamespace(which=which, is_free=lambda _: not pairs, colliding_pairs=lambda _: pairs)

    monkeypatch.setattr("behaviours.furniture.articulation_motion.world_at_opening", around)

    def move_free(skill: Any, goals: Any, world: Any) -> Any:
        told.append(world.which)
        if world.which in refused:
            raise MotionPlanningError(PlanningErrorCode.TIMED_PATH_INVALID, f"no way with a margin of {world.which[0]}")
        yield from ()

    monkeypatch.setattr("behaviours.furniture.articulation_motion.move_free", move_free)
    straight = "bestman_bt.manipulation.kinematics.cartesian_path.cartesian_path"
    monkeypatch.setattr(straight, lambda *_: SimpleNamespace(path=np.zeros((1, 7))))
    skill: Any = SimpleNamespace(skills=skills)
    for pairs in ([], [("panda_hand", "panda_link5")]):  # the arm touches itself: that says nothing of the door
        others[:] = pairs
        touches.clear()
        for which in ((unsure, ()), (0.0, ()), (0.0, (door.name,))):
            list(retreat(skill, door, "carry"))
            assert told[-1] == which
            touches.add(which)
    touches.clear()
    refused.append((unsure, ()))  # so close to the door that there is a way with less margin only
    list(retreat(skill, door, "carry"))
    assert told[-2:] == [(unsure, ()), (0.0, ())]
    refused.append((0.0, ()))
    with pytest.raises(MotionPlanningError, match=f"no way with a margin of {unsure}"):
        list(retreat(skill, door, "carry"))
    assert told[-2:] == [(unsure, ()), (0.0, ())]  # never through the door
