"""Convex polygons in the plane, and the free floor between them, by laws and by sampling."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestman_bt.messages import Pose2D
from bestman_bt.scene.floor_grid import FloorGrid
from bestman_bt.scene.plane_geometry import (
    depth_inside,
    distance_to_polygon,
    overlap_depth,
    polygons_overlap,
    rectangle,
    segment_outside,
)

COORDINATE = st.floats(-3.0, 3.0).map(lambda value: round(value, 2))
POSES = st.builds(Pose2D, COORDINATE, COORDINATE, st.floats(-3.1, 3.1).map(lambda value: round(value, 2)))
SIZES = st.tuples(st.floats(0.1, 3.0), st.floats(0.1, 3.0)).map(lambda size: (round(size[0], 2), round(size[1], 2)))


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(POSES, SIZES, COORDINATE, COORDINATE)
def test_depth_and_distance_are_those_of_the_rectangles_own_frame(
    pose: Pose2D, size: tuple[float, float], x: float, y: float
) -> None:
    outline, point = rectangle(pose, size), np.array([x, y])
    beyond = np.abs(pose.inverse().apply(point[None])[0]) - np.array(size) / 2
    assert depth_inside(outline, point) == pytest.approx(-beyond.max(), abs=1e-9)
    assert distance_to_polygon(outline, point) == pytest.approx(math.hypot(*np.maximum(beyond, 0.0)), abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(POSES, SIZES, POSES, SIZES)
def test_two_rectangles_moved_apart_by_their_overlap_only_touch(
    one: Pose2D, size: tuple[float, float], other: Pose2D, other_size: tuple[float, float]
) -> None:
    a, b = rectangle(one, size), rectangle(other, other_size)
    depth = overlap_depth(a, b)
    assert depth == pytest.approx(overlap_depth(b, a), abs=1e-9)
    assert polygons_overlap(a, b) is (depth > 0.0)
    edges = np.roll(a, -1, axis=0) - a
    other_edges = np.roll(b, -1, axis=0) - b
    outwards = [np.array([edge[1], -edge[0]]) / np.linalg.norm(edge) for edge in (*edges, *other_edges)]
    outwards += [-normal for normal in outwards]
    needed = [overlap_depth(a, b + (depth + 1e-6) * normal) for normal in outwards]
    assert min(needed) == 0.0
    if depth > 1e-3:
        assert all(overlap_depth(a, b + 0.9 * depth * normal) > 0.0 for normal in outwards)


@settings(max_examples=60, deadline=None)
@given(POSES, SIZES, st.tuples(COORDINATE, COORDINATE), st.tuples(COORDINATE, COORDINATE))
def test_what_is_left_of_a_segment_is_what_is_outside(
    pose: Pose2D, size: tuple[float, float], start: tuple[float, float], end: tuple[float, float]
) -> None:
    segment, outline = np.array([start, end]), rectangle(pose, size)
    rests = segment_outside(segment, outline)
    length = math.dist(start, end)
    for share in np.linspace(0.005, 0.995, 37):
        point = segment[0] + share * (segment[1] - segment[0])
        depth = depth_inside(outline, point)
        kept = any(math.dist(rest[0], point) + math.dist(point, rest[1]) <= math.dist(*rest) + 1e-9 for rest in rests)
        if abs(depth) > 1e-4 and length > 1e-3:
            assert kept is (depth < 0.0)


def test_the_floor_has_room_where_nothing_stands_and_its_cells_are_found_again() -> None:
    walls = [rectangle(Pose2D(*pose), size) for pose, size in (
        ((0.0, -1.0, 0.0), (4.0, 0.2)), ((0.0, 1.0, 0.0), (4.0, 0.2)),
        ((-2.0, 0.0, 0.0), (0.2, 2.2)), ((2.0, 0.0, 0.0), (0.2, 2.2)), ((0.5, 0.0, 0.0), (0.1, 1.9)),
    )]  # fmt: skip
    floor = FloorGrid.of(walls)
    points = np.array([[-0.7, 0.0], [-1.5, 0.1], [-1.0, 0.6], [1.2, -0.3], [0.5, 0.0], [9.0, 9.0]])
    expected = [0.9, 0.4, 0.3, 0.6, 0.0, 0.0]
    np.testing.assert_allclose(floor.room[floor.cells(points)], expected, atol=0.03)
    rows, columns = floor.cells(points[:4])
    np.testing.assert_allclose(floor.points(rows, columns), points[:4], atol=0.013)
    again = floor.cells(floor.points(rows, columns))
    assert (again[0].tolist(), again[1].tolist()) == (rows.tolist(), columns.tolist())
    left, right = (floor.areas(0.2)[tuple(cell[None] for cell in np.stack(floor.cells(p)))] for p in points[[0, 3]])
    assert 0 != left != right != 0
    largest = floor.largest_area(0.2)
    assert largest[floor.cells(points[0])]
    assert not largest[floor.cells(points[3])]
    coarse = floor.every(4)
    assert coarse.resolution == pytest.approx(0.1)
    np.testing.assert_allclose(coarse.room[coarse.cells(points[:4])], floor.room[floor.cells(points[:4])], atol=0.08)
    block = rectangle(Pose2D(-1.2, 0.1, 0.4), (0.3, 0.2))
    beside, anew = floor.beside(block, 0.5).room, FloorGrid.of([*walls, block]).room
    near = np.minimum(beside, anew) <= 0.5
    np.testing.assert_allclose(beside[near], anew[near], atol=1e-9)
    assert floor.room[floor.cells(points[:1])] == pytest.approx(0.9, abs=0.03)  # the floor itself has stayed
