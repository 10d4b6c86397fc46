"""The semantic map tells the walls exactly and the furniture as it should stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.messages import Box, PlacedShape, Pose, Pose2D
from bestman_bt.messages.shapes import bounding_corners
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import map_articulations, semantic_map
from bestman_bt.scene.plane_geometry import rectangle, segment_outside, wall_rectangle
from bestman_bt.scene.scene import World


@pytest.fixture(scope="module")
def world() -> World:
    return draw_world(load_scene("kitchen"), 3)


def first_hit(origin: np.ndarray, direction: np.ndarray, segments: np.ndarray) -> float:
    """Distance along a unit ``direction`` to the nearest of ``segments`` (N, 4)."""
    start, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
    determinant = along[:, 0] * direction[1] - along[:, 1] * direction[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = start - origin
        distance = (along[:, 0] * offset[:, 1] - along[:, 1] * offset[:, 0]) / determinant
        share = (direction[0] * offset[:, 1] - direction[1] * offset[:, 0]) / determinant
    hit = (distance > 0) & (share >= -1e-9) & (share <= 1 + 1e-9)
    return float(distance[hit].min())


@pytest.mark.parametrize("place", [(-1.8, -0.5), (0.0, 0.0), (2.0, 1.2), (-3.2, 1.2), (1.0, -1.6)])
def test_a_ray_meets_the_maps_walls_where_it_meets_the_walls_themselves(
    world: World, place: tuple[float, float]
) -> None:
    solid = [wall_rectangle(wall) for wall in world.walls]
    edges = np.concatenate([np.hstack([corners, np.roll(corners, -1, axis=0)]) for corners in solid])
    walls = semantic_map(world).walls
    for angle in np.linspace(-np.pi, np.pi, 180, endpoint=False) + 1e-3:
        direction = np.array([np.cos(angle), np.sin(angle)])
        expected = first_hit(np.array(place), direction, edges)
        assert first_hit(np.array(place), direction, walls) == pytest.approx(expected, abs=1e-5)


def test_the_map_has_no_face_that_a_lidar_could_not_see(world: World) -> None:
    walls = semantic_map(world).walls
    assert len(walls) == 12
    for wall in world.walls:
        outline = wall_rectangle(wall)
        centre = outline.mean(axis=0)
        shrunk = centre + (outline - centre) * 0.99
        for segment in walls:
            pieces = segment_outside(segment.reshape(2, 2), shrunk)
            assert len(pieces) == 1
            np.testing.assert_allclose(pieces[0], segment.reshape(2, 2))


def test_the_map_has_the_nominal_poses_of_furniture_not_the_true_ones(world: World) -> None:
    told = semantic_map(world).furniture
    for piece in world.furniture:
        assert told[piece.name].pose == piece.nominal
        assert told[piece.name].pose != piece.actual
        assert told[piece.name].footprint == piece.model.footprint


def test_a_lidar_sees_the_counter_but_only_the_legs_of_the_table(world: World) -> None:
    told = semantic_map(world).furniture
    assert told["counter"].solid_at_lidar
    assert not told["table"].solid_at_lidar
    assert (told["counter"].height, told["table"].height) == pytest.approx((0.90, 0.75))


def test_surfaces_are_found_by_name(world: World) -> None:
    furniture, surface = semantic_map(world).surface("counter/top")
    assert (furniture.name, surface.name, surface.size) == ("counter", "top", (0.6, 1.6))


def test_cutting_a_segment_leaves_what_lies_outside() -> None:
    square = rectangle(Pose2D(), (1.0, 1.0))
    pieces = segment_outside(np.array([[-1.0, 0.0], [1.0, 0.0]]), square)
    np.testing.assert_allclose(pieces, [[[-1, 0], [-0.5, 0]], [[0.5, 0], [1, 0]]], atol=1e-5)
    untouched = np.array([[-1.0, 0.6], [1.0, 0.6]])
    np.testing.assert_allclose(segment_outside(untouched, square), [untouched])
    assert segment_outside(np.array([[-0.2, 0.0], [0.2, 0.0]]), square) == []


def test_a_board_that_is_laid_on_its_side_is_as_large_on_the_map_as_it_is() -> None:
    model = next(
        piece.model for piece in draw_world(load_scene("chest_room"), 0).furniture if piece.model.articulations
    )
    quarter = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (np.pi / 2, 0.0, 0.0))

    def on_its_side(part: PlacedShape) -> PlacedShape:
        if not isinstance(part.shape, Box):
            return part
        x, y, z = part.shape.size
        return PlacedShape(Box((x, z, y)), part.pose @ quarter)

    turned = tuple(replace(door, parts=tuple(map(on_its_side, door.parts))) for door in model.articulations)
    for plain, other in zip(
        map_articulations(model, 0.0, {}), map_articulations(replace(model, articulations=turned), 0.0, {}), strict=True
    ):
        slab, same = plain.shapes[0], other.shapes[0]
        assert isinstance(slab.shape, Box)
        assert isinstance(same.shape, Box)
        assert same.shape.size == pytest.approx(slab.shape.size)
        assert len(other.shapes) == len(plain.shapes)


@pytest.mark.parametrize("scene", ["chest_room", "kitchen_furnished", "apartment"])
def test_the_room_before_a_front_is_as_deep_as_its_handle_stands_out(scene: str) -> None:
    for piece in draw_world(load_scene(scene), 5).furniture:
        for door, on_map in zip(piece.model.articulations, map_articulations(piece.model, 0.0, {}), strict=True):
            nearest = min(float((part.pose.apply(bounding_corners(part.shape)))[:, 0].min()) for part in door.parts)
            front = on_map.shapes[0]
            assert isinstance(front.shape, Box)
            out = float(front.pose.position[0]) - front.shape.size[0] / 2 - nearest
            assert out - 1e-6 <= on_map.handle_depth <= out + 0.011
            assert (on_map.handle_room is None) == (door.handle.kind == "edge")
