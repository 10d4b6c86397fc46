from __future__ import annotations

import numpy as np

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.navigation.slam.pose_graph_slam import LogOddsGrid


def scan_of(ranges):
    return LaserScan(np.array(ranges), 0.0, 0.01, 0.1, 8.0, 0.0)


def value(grid, x, y):
    row, column = grid.to_cells([x, y])
    return grid.data[row, column]


def test_beams_free_what_they_pass_and_their_end_is_occupied():
    drawing = LogOddsGrid()
    drawing.add(Pose2D(), scan_of([2.02]))
    grid = drawing.grid()
    assert value(grid, 1.0, 0.02) == 0
    assert value(grid, 2.02, 0.02) == 100
    assert (grid.data == 100).sum() == 1
    assert value(grid, 1.88, 0.02) == 0


def test_beams_without_a_hit_leave_the_grid_unchanged():
    drawing = LogOddsGrid()
    drawing.add(Pose2D(), scan_of([2.0, np.inf]))
    before = (drawing.grid().data != -1).sum()
    drawing.add(Pose2D(0.0, 0.0, 1.0), scan_of([np.inf, np.inf]))
    assert (drawing.grid().data != -1).sum() == before


def test_what_has_gone_away_is_free_again_after_some_scans():
    drawing = LogOddsGrid()
    for _ in range(20):
        drawing.add(Pose2D(), scan_of([2.02]))
    scans = 0
    while value(drawing.grid(), 2.02, 0.02) != 0:
        drawing.add(Pose2D(), scan_of([3.02]))
        scans += 1
    assert 3 <= scans <= 20


def test_it_grows_in_every_direction_and_keeps_what_it_knows():
    drawing = LogOddsGrid()
    for heading in (0.0, np.pi / 2, np.pi, -np.pi / 2):
        for _ in range(2):
            drawing.add(Pose2D(0.02, 0.02, heading), scan_of([5.0]))
    grid = drawing.grid()
    assert [value(grid, *end) for end in ((5.02, 0.02), (0.02, 5.02), (-4.98, 0.02), (0.02, -4.98))] == [100] * 4
    assert value(grid, 0.02, 0.02) == 0


def test_around_all_that_was_seen_lies_unknown_floor_that_may_be_explored():
    drawing = LogOddsGrid()
    for reach in (1.0, 3.0, 6.5):
        drawing.add(Pose2D(0.5, -0.5, reach), scan_of([reach] * 60))
        grid = drawing.grid()
        seen = np.argwhere(grid.data != -1)
        margin = np.minimum(seen.min(axis=0), np.array(grid.data.shape) - 1 - seen.max(axis=0))
        assert (margin >= 2.0 / grid.resolution).all()
