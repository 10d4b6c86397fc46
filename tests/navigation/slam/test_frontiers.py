from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import OccupancyGrid, Pose2D
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.slam.frontiers import FrontierExplorer, find_frontiers
from bestman_bt.navigation.slam.overhangs import Overhangs


def floor(known_to, rows=80, columns=200):
    """A hall of 10 by 4 m with walls, of which the part left of ``known_to`` metres is known."""
    data = np.zeros((rows, columns), dtype=np.int8)
    data[[0, -1], :] = data[:, [0, -1]] = 100
    data[:, round(known_to / 0.05) :] = -1
    return OccupancyGrid(data, 0.05, np.zeros(2))


def test_a_frontier_is_where_free_floor_meets_the_unknown():
    (frontier,) = find_frontiers(floor(6.0), 0.3)
    assert frontier.length == pytest.approx(3.9)
    assert frontier.points[:, 0] == pytest.approx(5.975)


def test_short_frontiers_and_borders_behind_walls_are_none():
    data = floor(10.0).data.copy()
    data[40:43, 100] = -1  # a hole of 15 cm
    assert len(find_frontiers(OccupancyGrid(data, 0.05, np.zeros(2)), 0.9)) == 0
    assert find_frontiers(floor(10.0), 0.3) == []


def test_views_lie_before_the_frontier_where_the_base_can_turn(footprint):
    grid = floor(6.0)
    costmap = Costmap.from_grid(grid, footprint)
    (best,) = FrontierExplorer().tour(grid, costmap, Pose2D(1.0, 2.0, 0.0))
    assert 4.0 < best.pose.x < 5.6
    assert costmap.distance_at(best.pose.xy) > footprint.circumscribed_radius
    assert best.distance == pytest.approx(np.hypot(best.pose.x - 1.0, best.pose.y - 2.0), rel=0.1)


def test_a_frontier_nearby_comes_before_an_equal_one_far_away(footprint):
    data = floor(10.0).data.copy()
    data[:, :40] = data[:, 160:] = -1  # 2 m unknown at each end
    grid = OccupancyGrid(data, 0.05, np.zeros(2))
    best = FrontierExplorer().tour(grid, Costmap.from_grid(grid, footprint), Pose2D(7.0, 2.0, 0.0))[0]
    assert best.pose.x > 5.0


def test_the_tour_takes_what_lies_on_the_way_first(footprint):
    data = floor(10.0).data.copy()
    data[:, 170:] = -1  # the far end of the hall is unknown
    data[:50, 60:64] = data[:50, 90:94] = 100  # and so is most of a niche on this side
    data[4:20, 64:90] = -1
    grid = OccupancyGrid(data, 0.05, np.zeros(2))
    views = FrontierExplorer().tour(grid, Costmap.from_grid(grid, footprint), Pose2D(1.0, 3.0, 0.0))
    assert views[0].gain < views[-1].gain
    assert 3.0 < views[0].pose.x < 4.8
    assert views[-1].pose.x > 5.0


@pytest.mark.slow
def test_what_was_tried_in_vain_is_not_tried_again(footprint):
    grid = floor(6.0)
    costmap = Costmap.from_grid(grid, footprint)
    explorer, useless = FrontierExplorer(), np.zeros((0, 2))
    tried = 0
    while views := explorer.tour(grid, costmap, Pose2D(1.0, 2.0, 0.0), useless):
        assert all(np.linalg.norm(views[0].pose.xy - place) > explorer.again for place in useless)
        useless, tried = np.vstack([useless, views[0].pose.xy]), tried + 1
    assert 3 < tried < 60


def test_a_view_is_not_taken_to_see_far_into_the_unknown():
    assert FrontierExplorer().gain(floor(6.0), np.array([5.0, 2.0])) < 9.0


def test_what_cannot_be_reached_is_no_goal(footprint):
    data = floor(6.0).data.copy()
    data[:, 60] = 100  # a wall across the hall at 3 m
    grid = OccupancyGrid(data, 0.05, np.zeros(2))
    assert FrontierExplorer().tour(grid, Costmap.from_grid(grid, footprint), Pose2D(1.0, 2.0, 0.0)) == []


def test_gain_is_the_unknown_floor_in_view_up_to_walls():
    # From 1 m before the border: 16 m², without the corners that lie beyond 5 m.
    explorer = FrontierExplorer(depth=5.0)
    assert explorer.gain(floor(6.0), np.array([5.0, 2.0])) == pytest.approx(15.45, rel=0.02)
    data = floor(6.0).data.copy()
    data[:, 110] = 100
    assert explorer.gain(OccupancyGrid(data, 0.05, np.zeros(2)), np.array([5.0, 2.0])) == 0.0
    assert explorer.gain(floor(10.0), np.array([5.0, 2.0])) == 0.0


def test_known_floor_leaves_nothing_to_explore(footprint):
    grid = floor(10.0)
    assert FrontierExplorer().tour(grid, Costmap.from_grid(grid, footprint), Pose2D(1.0, 2.0, 0.0)) == []


def test_table_tops_are_obstacles_for_planning_but_not_beside_walls():
    grid = floor(10.0)
    overhangs = Overhangs(0.05)
    top = np.column_stack([np.repeat(np.linspace(4.01, 4.99, 60), 60), np.tile(np.linspace(1.01, 1.99, 60), 60)])
    camera = np.array([3.0, 1.5, 1.2])
    overhangs.add(np.column_stack([top, np.full(len(top), 0.75)]), camera)
    overhangs.add(np.column_stack([top + np.array([0.0, 1.0]), np.full(len(top), 0.01)]), camera)  # the floor
    overhangs.add(np.column_stack([np.full(50, 4.0), np.full(50, 0.07), np.full(50, 0.5)]), camera)  # at the wall
    drawn = overhangs.drawn_on(grid)
    assert (drawn.data != grid.data).sum() == 20 * 20
    assert drawn.data[tuple(grid.to_cells([4.5, 1.5]))] == 100
    assert drawn.data[tuple(grid.to_cells([4.5, 2.5]))] == 0


def test_a_costmap_of_a_grid_has_distances_to_the_borders_of_occupied_and_unknown_cells(footprint):
    grid = floor(6.0)
    costmap = Costmap.from_grid(grid, footprint)
    margin = costmap.rasterization.clearance
    assert costmap.distance_at([3.025, 1.5]) == pytest.approx(1.45 - margin, abs=1e-6)  # the wall ends at y 0.05
    assert costmap.distance_at([5.025, 2.0]) == pytest.approx(0.975 - margin, abs=1e-6)  # the unknown begins at 6
    assert costmap.distance_at([3.025, 0.025]) == pytest.approx(-0.025 - margin, abs=1e-6)
    assert Costmap.from_grid(grid, footprint, unknown_is_obstacle=False).distance_at([5.8, 2.0]) > 1.5


def cell_of(overhangs: Overhangs, x: float, y: float) -> int:
    grid = OccupancyGrid(np.zeros((160, 160), dtype=np.int8), 0.05, np.array([-4.0, -4.0]))
    drawn = overhangs.drawn_on(grid)
    return int(drawn.data[tuple(grid.to_cells([x, y]))])


@pytest.mark.parametrize(
    ("height", "away", "count", "kept"),
    [
        (0.11, 1.0, 3, True),
        (0.09, 1.0, 3, False),
        (1.55, 1.0, 3, True),
        (1.65, 1.0, 3, False),
        (0.75, 2.95, 3, True),
        (0.75, 3.05, 3, False),
        (0.75, 1.0, 2, False),
    ],
)
def test_points_of_one_image_between_the_heights_and_within_the_range_make_a_cell(height, away, count, kept):
    overhangs, place = Overhangs(0.05), np.array([-1.275, -0.525, height])
    camera = place + away * np.array([0.6, -0.8, 0.0])
    overhangs.add(np.tile(place, (count, 1)), camera)
    overhangs.add(np.array([[2.025, 1.025, 0.5]] * 3), np.array([2.0, 1.0, 1.0]))  # nothing is forgotten
    assert cell_of(overhangs, place[0], place[1]) == (100 if kept else 0)
    assert cell_of(overhangs, 2.025, 1.025) == 100
