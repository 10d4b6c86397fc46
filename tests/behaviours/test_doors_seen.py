"""How far a door or drawer stands open, told by a handle: every kind of door, and handles that are on no door."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.furniture.articulation import FurnitureArticulation
from behaviours.furniture.articulation_measurement import (
    HEADING_ERROR,
    POSITION_ERROR,
    opening_by_board,
    opening_by_rays,
    opening_seen,
    opening_since,
)
from behaviours.furniture.opening import Opening, stations
from bestman_bt.messages import Box, Handle, PlacedShape, Pose, Pose2D
from bestman_bt.perception.segmentation.base import SupportPlane
from bestman_bt.perception.view import View
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.scene import PlacedFurniture, Wall, World
from tests.perception.seen_boxes import looking_at, view_of

AT = Pose2D(1.2, -0.4, 0.7)
OFF = Pose2D(1.22, -0.38, 0.72)  # where it really stands, within the map's error

WALLS = (Wall((-3.0, -3.0), (3.0, -3.0), 1.2, 0.1), Wall((3.0, -3.0), (3.0, 3.0), 1.2, 0.1))


def door_and_handle(name: str, part: str, position: float) -> tuple[FurnitureArticulation, Handle]:
    """The door as the map has it, and the true handle, on the door that is open by ``position``."""
    model = read_furniture(name)
    placed = PlacedFurniture(name, model, AT, OFF)
    piece = semantic_map(World("one", 0, WALLS, (placed,), (), Pose2D(), {})).furniture[name]
    articulation = next(door for door in model.articulations if door.name == part)
    handle = articulation.handle.seen_from(placed.pose @ articulation.moved(position))
    return FurnitureArticulation(f"{name}/{part}", piece, piece.articulation(part)), handle


@pytest.mark.parametrize("part", ["upper_door", "lower_door"])
@pytest.mark.parametrize("degrees", [10.0, 30.0, 55.0, 90.0])
def test_the_opening_of_a_door_follows_from_the_direction_of_its_handle(part: str, degrees: float) -> None:
    door, handle = door_and_handle("fridge", part, math.radians(degrees))
    assert opening_seen(door, handle) == pytest.approx(math.radians(degrees), abs=math.radians(2.0))


@pytest.mark.parametrize("position", [0.10, 0.22, 0.30])
def test_the_opening_of_a_drawer_follows_from_its_handle(position: float) -> None:
    door, handle = door_and_handle("drawer_chest", "drawer_2", position)
    assert opening_seen(door, handle) == pytest.approx(position, abs=0.045)


@pytest.mark.parametrize(("name", "part"), [("fridge", "upper_door"), ("drawer_chest", "drawer_2")])
def test_what_the_error_of_the_map_explains_counts_as_shut(name: str, part: str) -> None:
    door, handle = door_and_handle(name, part, 0.0)
    assert opening_seen(door, handle) == 0.0


def test_a_handle_of_another_door_gives_no_opening() -> None:
    upper, _ = door_and_handle("fridge", "upper_door", 0.0)
    _, lower_handle = door_and_handle("fridge", "lower_door", 0.5)
    assert opening_seen(upper, lower_handle) is None
    second, _ = door_and_handle("drawer_chest", "drawer_2", 0.0)
    _, third_handle = door_and_handle("drawer_chest", "drawer_3", 0.2)
    assert opening_seen(second, third_handle) is None


def test_what_is_beside_the_door_or_at_its_hinge_is_no_handle_of_it() -> None:
    door, handle = door_and_handle("fridge", "upper_door", 0.8)
    for way in (np.array([0.0, 0.0, 0.5]), 0.5 * handle.outward):
        moved = replace(handle, pose=Pose(handle.pose.position + way, handle.pose.quaternion))
        assert opening_seen(door, moved) is None
    assert handle.hinge is not None
    at_hinge = np.array([*handle.hinge[:2], handle.pose.position[2]]) + 0.05 * handle.outward
    assert opening_seen(door, replace(handle, pose=Pose(at_hinge, handle.pose.quaternion))) is None


@pytest.mark.parametrize(
    ("name", "part", "before", "now"),
    [
        ("fridge", "upper_door", 0.0, 1.4),
        ("fridge", "upper_door", 0.6, 1.3),
        ("drawer_chest", "drawer_2", 0.0, 0.22),
        ("drawer_chest", "drawer_2", 0.3, 0.12),
    ],
)
def test_a_handle_that_was_seen_before_reports_how_far_a_door_has_moved_whatever_the_map_is_wrong_by(
    name: str, part: str, before: float, now: float
) -> None:
    door, known = door_and_handle(name, part, before)
    _, seen = door_and_handle(name, part, now)
    assert opening_since(door, before, known, seen) == pytest.approx(now, abs=1e-4)


def test_another_handle_does_not_report_how_far_a_door_has_moved() -> None:
    door, known = door_and_handle("drawer_chest", "drawer_2", 0.0)
    _, other = door_and_handle("drawer_chest", "drawer_3", 0.2)
    assert opening_since(door, 0.0, known, other) is None


def board_seen(
    name: str,
    part: str,
    position: float,
    face: tuple[float, float, float] = (-1.0, 0.0, 0.0),
    share: float = 1.0,
) -> tuple[FurnitureArticulation, SupportPlane]:
    """The door as the map has it, and the middle ``share`` of a face of its true board, open by ``position``."""
    door, _ = door_and_handle(name, part, position)
    front = door.articulation.shapes[0]
    assert isinstance(front.shape, Box)
    true = OFF.to_pose() @ door.articulation.moved(position) @ front.pose
    out = np.array(face)
    beside = np.cross([0.0, 0.0, 1.0], out)
    size = np.array(front.shape.size)
    width, height = float(np.abs(beside) @ size), float(size[2])
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([beside, [0.0, 0.0, 1.0], out], axis=1)
    matrix[:3, 3] = out * size / 2
    frame = true @ Pose.from_matrix(matrix)
    across, up = np.meshgrid(np.linspace(-0.5, 0.5, 9) * width * share, np.linspace(-0.5, 0.5, 9) * height * share)
    points = frame.apply(np.column_stack([across.ravel(), up.ravel(), np.zeros(across.size)]))
    return door, SupportPlane(frame, (width * share, height * share), points, 0.0)


@pytest.mark.parametrize("part", ["upper_door", "lower_door"])
@pytest.mark.parametrize("degrees", [10.0, 55.0, 90.0])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_front_and_the_back_of_a_door_report_how_far_it_is_open(part: str, degrees: float, side: float) -> None:
    door, plane = board_seen("fridge", part, math.radians(degrees), (side, 0.0, 0.0), share=0.5)
    assert opening_by_board(door, plane) == pytest.approx(math.radians(degrees), abs=math.radians(2.0))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_front_and_the_back_of_a_drawer_front_report_how_far_it_is_out(side: float) -> None:
    door, plane = board_seen("drawer_chest", "drawer_2", 0.22, (side, 0.0, 0.0))
    assert opening_by_board(door, plane) == pytest.approx(0.22, abs=0.045)


@pytest.mark.parametrize(("name", "part"), [("fridge", "upper_door"), ("drawer_chest", "drawer_2")])
def test_the_board_of_a_shut_door_reports_that_it_is_shut(name: str, part: str) -> None:
    assert opening_by_board(*board_seen(name, part, 0.0)) == 0.0


def test_the_frame_behind_a_door_that_stands_open_does_not_report_that_it_is_shut() -> None:
    door, front = board_seen("fridge", "upper_door", 0.0)
    board = door.articulation.shapes[0].shape
    assert isinstance(board, Box)
    measured = replace(door.furniture, pose=OFF, position_error=POSITION_ERROR, heading_error=HEADING_ERROR)
    door = replace(door, furniture=measured)
    assert opening_by_board(door, front) == 0.0
    assert opening_by_board(door, front.seen_from(Pose(-board.size[0] * front.normal))) is None
    unmeasured, front = board_seen("fridge", "upper_door", 0.0)
    assert opening_by_board(unmeasured, front) == 0.0
    at_border = np.abs(front.frame_from_plane.inverse().apply(front.inliers)[:, :2] / front.size) > 0.4
    frame = replace(front, inliers=front.inliers[at_border.any(axis=1)])
    assert opening_by_board(unmeasured, frame) is None


def test_other_boards_the_edge_of_a_door_and_a_small_part_of_it_tell_nothing() -> None:
    upper, plane = board_seen("fridge", "upper_door", 0.8)
    lower, _ = door_and_handle("fridge", "lower_door", 0.0)
    assert opening_by_board(lower, plane) is None
    assert opening_by_board(*board_seen("fridge", "upper_door", 0.8, (0.0, -1.0, 0.0))) is None
    assert opening_by_board(*board_seen("fridge", "upper_door", 0.8, share=0.2)) is None
    away = Pose(0.4 * plane.normal)
    assert opening_by_board(upper, plane.seen_from(away)) is None


def seen_from(
    place: tuple[float, float, float], opening: float, *beside: PlacedShape, part: str = "upper_door"
) -> tuple[FurnitureArticulation, View]:
    """The door as the map has it, and what a camera at ``place`` in the fridge's frame sees of the true one.

    ``beside``: what else there is, in the fridge's frame. The wall behind is 1.5 m away.
    """
    model, frame = read_furniture("fridge"), OFF.to_pose()
    wall = PlacedShape(Box((0.1, 8.0, 4.0)), Pose(np.array([1.5, 0.0, 1.0])))
    boxes = [*model.parts, wall, *beside]
    for articulation in model.articulations:
        moved = articulation.moved(opening if articulation.name == part else 0.0)
        boxes += [PlacedShape(placed.shape, moved @ placed.pose) for placed in articulation.parts]
    boxes = [PlacedShape(placed.shape, frame @ placed.pose) for placed in boxes if isinstance(placed.shape, Box)]
    target = frame.apply(np.array([[-0.4, -0.1, 1.2]]))[0]
    door, _ = door_and_handle("fridge", part, 0.0)
    return door, view_of(boxes, looking_at(frame.apply(np.array([place]))[0], target), rng=np.random.default_rng(0))


AHEAD, FAR_AWAY, AT_THE_EDGE = (-1.2, 0.0, 1.3), (-3.5, 0.3, 1.3), (-2.4, 1.3, 1.3)
NOTHING_KNOWN: tuple[PlacedShape, ...] = ()


@pytest.mark.parametrize(("place", "degrees"), [(AHEAD, 55.0), (AHEAD, 90.0), (FAR_AWAY, 55.0), (FAR_AWAY, 90.0)])
@pytest.mark.parametrize("part", ["upper_door", "lower_door"])
def test_a_door_is_found_by_the_points_on_it_and_the_rays_through_its_shut_place(
    place: tuple[float, float, float], degrees: float, part: str
) -> None:
    door, view = seen_from(place, math.radians(degrees), part=part)
    found = opening_by_rays(door, 0.0, view, NOTHING_KNOWN)
    assert found == pytest.approx(math.radians(degrees), abs=math.radians(5.0))


def test_a_door_is_found_by_its_edge_alone_and_wherever_else_it_was_believed_to_be() -> None:
    door, view = seen_from(AT_THE_EDGE, math.radians(40.0))
    for believed in (0.0, 0.35, 1.5):
        assert opening_by_rays(door, believed, view, NOTHING_KNOWN) == pytest.approx(math.radians(40.0), abs=0.06)
    assert opening_by_rays(door, math.radians(37.0), view, NOTHING_KNOWN) is None
    assert opening_by_rays(door, math.radians(43.0), view, NOTHING_KNOWN) is None


def test_a_shut_door_is_found_where_it_was_believed_open_and_else_tells_nothing() -> None:
    door, view = seen_from(AT_THE_EDGE, 0.0)
    assert opening_by_rays(door, 1.5, view, NOTHING_KNOWN) == 0.0
    assert opening_by_rays(door, 0.0, view, NOTHING_KNOWN) is None


@pytest.mark.parametrize(
    ("opening", "eye", "place", "size"),
    [
        (0.0, (-2.4, -1.5, 1.3), (-0.75, 0.2, 1.0), (0.3, 0.3, 2.0)),  # a person before the shut door
        (1.9, (-2.4, -1.5, 1.3), (-0.75, 0.0, 1.0), (0.3, 0.4, 2.0)),  # and before a door that is wide open
        (1.9, (-2.2, -0.97, 1.3), (-0.61, 0.07, 1.0), (0.1, 0.1, 2.0)),  # a post: beside it, rays pass
    ],
)
def test_what_stands_before_a_door_does_not_count_as_the_door(
    opening: float,
    eye: tuple[float, float, float],
    place: tuple[float, float, float],
    size: tuple[float, float, float],
) -> None:
    door, view = seen_from(eye, opening, PlacedShape(Box(size), Pose(np.array(place))))
    assert opening_by_rays(door, 0.0, view, NOTHING_KNOWN) is None


def test_a_wall_where_the_door_could_be_is_not_taken_for_it() -> None:
    wall = PlacedShape(Box((2.0, 0.1, 2.2)), Pose(np.array([-0.6, -0.39, 1.1])))
    door, view = seen_from(AT_THE_EDGE, math.radians(40.0), wall)
    known = PlacedShape(wall.shape, OFF.to_pose() @ wall.pose)
    assert opening_by_rays(door, 0.0, view, [known]) == pytest.approx(math.radians(40.0), abs=0.06)


def test_a_hand_that_turns_about_a_bar_keeps_holding_it_at_the_same_point() -> None:
    door, handle = door_and_handle("fridge", "upper_door", 0.0)
    assert handle.hinge is not None
    assert handle.hinge_direction is not None
    matrix = np.eye(4)
    along, outward = handle.hinge_direction, handle.outward
    matrix[:3, :3] = np.stack([along, np.cross(outward, along), outward], axis=1)
    matrix[:3, 3] = handle.pose.position
    bar = replace(handle, kind="bar", pose=Pose.from_matrix(matrix))
    opening = Opening(door, bar, 1.0, 0.0, 0.3, 1.0)
    grasp = Pose(bar.pose.position + np.array([0.03, -0.02, 0.05]), OFF.to_pose().quaternion)  # its origin: not on it
    assert opening.bar_turns
    held, tilts = opening.held_at(grasp), (-0.5, 0.0, 0.8)
    for tilt, tool in zip(tilts, stations(opening, grasp, tilts)[0], strict=True):
        np.testing.assert_allclose(tool.apply(held[None]), grasp.apply(held[None]), atol=1e-9)
        turned = (tool @ grasp.inverse()).rotation
        assert math.acos((np.trace(turned) - 1.0) / 2.0) == pytest.approx(abs(tilt), abs=1e-6)
