"""Ways to push a door shut: the fingers alone touch it, whatever the map is wrong by."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import islice, takewhile
from typing import Any

import numpy as np
import pytest

from behaviours.furniture.articulation import FurnitureArticulation, find_articulation
from behaviours.furniture.close import FrontPush, pushes
from bestman_bt.manipulation.kinematics.arc_path import ArcPath
from bestman_bt.messages import Box, Pose
from bestman_bt.perception.grasp_pose.hand_shape import HandShape, HandSize
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.world_model.openness import handle_shape
from bestman_bt.world_model.world_model import HandleBelief
from tests.behaviours.scripted import scripted_skills

CLOSED_FINGERS = np.zeros(1)


def standing_open(
    task: str, articulation: str, position: float, handle_seen: bool = True
) -> tuple[Any, FurnitureArticulation]:
    """Skills that believe a door to be open by ``position``, with its handle where it truly is on it."""
    skills = scripted_skills(task)
    door = find_articulation(skills, articulation)
    if handle_seen:
        model = read_furniture(door.furniture.name)
        part = next(one for one in model.articulations if one.name == door.articulation.name)
        name = f"{door.furniture.name}/handle_1"
        true = part.handle.seen_from(door.furniture.pose.to_pose())
        skills.world.handles[name] = HandleBelief(name, true, 50.0, door.furniture.name)
    skills.world.believe_articulation(articulation, position)
    return skills, door


def in_palm(skills: Any, points: np.ndarray, map_from_tool: Pose, grown: float) -> bool:
    """Whether one of the points (N, 3), map frame, is in the palm, grown by so many metres."""
    centres, halves = HandShape(skills.gripper_model, HandSize()).boxes(CLOSED_FINGERS)
    local = map_from_tool.inverse().apply(points) - centres[0, 2]
    return bool((np.abs(local) < halves[0, 2] + grown).all(axis=1).any())


def surface(box: Box, pose: Pose) -> np.ndarray:
    """Points all over a box, (N, 3)."""
    axes = [np.linspace(-extent / 2, extent / 2, max(2, math.ceil(extent / 0.015))) for extent in box.size]
    return pose.apply(np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3))


def hands_of(push: FrontPush) -> list[Pose]:
    """The hand in the map frame with each tilt, with the door where it is first."""
    return push.stations()[0]


def tilts_of_level_hands(
    skills: Any, door: FurnitureArticulation
) -> dict[tuple[tuple[float, ...], float], tuple[float, ...]]:
    """By pushed point and roll of the hand."""
    level = takewhile(lambda push: push.pitch == 0.0, pushes(skills, door))
    return {(tuple(push.point), push.roll): push.tilts for push in level}


DOOR = ("close_fridge", "fridge/upper_door", math.radians(55.0))
DRAWER = ("close_drawer", "drawer_chest/drawer_3", 0.22)


@pytest.mark.parametrize(("task", "articulation", "position"), [DOOR, DRAWER])
def test_the_palm_stays_clear_of_the_handle_by_what_the_map_is_wrong_by(
    task: str, articulation: str, position: float
) -> None:
    skills, door = standing_open(task, articulation, position)
    (seen,) = skills.world.handles_of(door.furniture, door.articulation)
    placed = handle_shape(seen.handle)
    assert isinstance(placed.shape, Box)
    handle = surface(placed.shape, placed.pose)
    ways = list(islice(pushes(skills, door), 12))
    assert ways
    assert door.furniture.position_error == pytest.approx(0.03)
    for push in ways:
        assert not any(in_palm(skills, handle, hand, 0.03) for hand in hands_of(push))


def test_the_palm_stays_clear_of_a_door_that_is_turned_by_what_the_map_is_wrong_by() -> None:
    skills, door = standing_open(*DOOR)
    front = door.articulation.shapes[0].shape
    assert isinstance(front, Box)
    for push in islice(pushes(skills, door), 4):
        for off in (-0.08, 0.08):  # 3 cm at the lever, and 2°
            turned = Pose(push.at(push.start)) @ Pose.from_xyz_rpy((0, 0, 0), (0, 0, off)) @ Pose(-push.at(push.start))
            board = surface(front, turned @ door.front(push.start))
            assert not any(in_palm(skills, board, hand, 0.0) for hand in hands_of(push))


@pytest.mark.slow
def test_beside_a_handle_the_hand_is_held_along_it_and_tilted_less_where_it_is_broad() -> None:
    with_handle = tilts_of_level_hands(*standing_open(*DOOR))
    without = tilts_of_level_hands(*standing_open(*DOOR, handle_seen=False))
    narrow = {tilts for (_, roll), tilts in without.items() if roll == 0.0}
    broad = {tilts for (_, roll), tilts in without.items() if roll == math.radians(90)}
    assert max(map(max, broad)) < min(map(max, narrow)) < math.radians(45.0)
    assert all(set(tilts) <= set(without.get(way, tilts)) for way, tilts in with_handle.items())
    assert any(len(tilts) < len(without[way]) for way, tilts in with_handle.items() if way in without)


def test_a_piece_that_was_measured_leaves_the_hand_more_room() -> None:
    skills, door = standing_open(*DOOR)
    vague = next(pushes(skills, door)).tilts
    known = replace(door, furniture=replace(door.furniture, position_error=0.0, heading_error=0.0))
    assert set(vague) < set(next(pushes(skills, known)).tilts)


@pytest.mark.parametrize(("task", "articulation", "position"), [DOOR, DRAWER])
def test_what_is_believed_shut_is_felt_for_and_pushed(task: str, articulation: str, position: float) -> None:
    skills, door = standing_open(task, articulation, 0.0)
    push = next(pushes(skills, door))
    count = len(push.positions())
    assert count > 1
    guide = push.guide(ArcPath(np.zeros((count, 7)), (0,) * count, count, "", 0.5))
    assert 0.0 < guide.ways[-1] <= 0.005
