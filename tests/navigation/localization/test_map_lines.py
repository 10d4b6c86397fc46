from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import OccupancyGrid, Pose2D
from bestman_bt.navigation.localization.map_lines import map_lines, open_furniture, within
from bestman_bt.world_model.semantic_map import MapFurniture, SemanticMap


def grid(rows: list[str]) -> OccupancyGrid:
    """Drawn from above, the top row first: # occupied, . free, anything else unknown."""
    values = {"#": 100, ".": 0}
    data = np.array([[values.get(cell, -1) for cell in row] for row in reversed(rows)], dtype=np.int8)
    return OccupancyGrid(data, 0.1, np.array([1.0, 2.0]))


def length(segments: np.ndarray) -> float:
    return float(np.linalg.norm(segments[:, 2:] - segments[:, :2], axis=1).sum())


def test_walls_and_solid_furniture_are_bodies_and_tables_are_not(kitchen):
    lines = map_lines(kitchen, 0.001, 0.025)
    walls = len(kitchen.walls)
    np.testing.assert_array_equal(lines.segments, kitchen.lidar_segments())
    assert lines.bodies.tolist() == [*range(walls), *[walls] * 4]
    assert lines.body_std.tolist() == [*[0.001] * walls, 0.025]


def test_a_wall_of_one_cell_is_a_line_through_its_cells_seen_from_both_sides():
    lines = map_lines(grid([".......", ".#####.", "......."]), 0.001, 0.025)
    assert len(lines.segments) == 2
    np.testing.assert_allclose(sorted(lines.segments[0][[0, 2]]), [1.15, 1.55])
    np.testing.assert_allclose(lines.segments[:, [1, 3]], 2.15)
    np.testing.assert_allclose(length(lines.segments), 0.8)


def test_the_border_of_a_block_goes_around_its_outermost_cells():
    lines = map_lines(grid([".....", ".###.", ".###.", ".###.", "....."]), 0.001, 0.025)
    assert length(lines.segments) == pytest.approx(0.8)
    assert lines.segments[:, [0, 2]].min() == 1.15
    assert lines.body_std.max() < 0.1


def test_a_lone_cell_can_be_seen_and_what_is_unknown_can_not():
    assert length(map_lines(grid(["...", ".#.", "..."]), 0.001, 0.025).segments) > 0.0
    assert len(map_lines(grid(["???", "?.?", "???"]), 0.001, 0.025).segments) == 0


def test_open_furniture_is_a_turned_rectangle_grown_by_how_far_it_may_be_off(kitchen):
    shelf = MapFurniture("shelf", Pose2D(1.0, 2.0, 0.5), (0.4, 2.0), 1.2, (), False, position_error=0.05)
    solid = MapFurniture("solid", Pose2D(5.0, 5.0, 0.0), (0.4, 2.0), 1.2, (), True)
    rectangles = open_furniture(SemanticMap(kitchen.walls, {"shelf": shelf, "solid": solid}))
    assert rectangles == pytest.approx(np.array([[1.0, 2.0, 0.5, 0.25, 1.05]]))
    inside = [(0.24, 0.0), (-0.24, 1.04), (0.0, -1.04)]
    outside = [(0.26, 0.0), (0.0, 1.06), (-0.26, -1.0), (0.9, 0.0)]
    points = shelf.pose.apply(np.array(inside + outside))
    assert within(rectangles, points).tolist() == [True] * 3 + [False] * 4
    assert not within(open_furniture(SemanticMap(kitchen.walls, {})), points).any()
    assert len(open_furniture(grid(["#"]))) == 0
