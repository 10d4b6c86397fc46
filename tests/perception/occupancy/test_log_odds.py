"""What is occupied, free and unknown after a few views, against the boxes that were looked at."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.messages import (
    VOXEL_FREE,
    VOXEL_OCCUPIED,
    VOXEL_UNKNOWN,
    Box,
    CameraIntrinsics,
    PlacedShape,
    Pose,
    distance_to_shape,
)
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.occupancy import LogOdds, VoxelRegion, freed
from bestman_bt.perception.view import View
from tests.perception.seen_boxes import looking_at, view_of

TABLE = PlacedShape(Box((0.8, 1.2, 0.04)), Pose(np.array([0.0, 0.0, 0.73])))
CARTON = PlacedShape(Box((0.1, 0.14, 0.2)), Pose.from_xyz_rpy((0.05, 0.1, 0.85), (0, 0, 0.4)))
FLOOR = PlacedShape(Box((8.0, 8.0, 0.02)), Pose(np.array([0.0, 0.0, -0.01])))
REGION = VoxelRegion(Pose(np.array([0.0, 0.0, 0.8])), (1.5, 1.5, 1.2))
FRONT = looking_at((-1.2, 0.0, 1.6), (0.0, 0.0, 0.75))
SIDE = looking_at((-0.5, 1.1, 1.6), (0.0, 0.0, 0.75))
BEHIND = looking_at((1.2, 0.3, 1.6), (0.0, 0.0, 0.75))
HALF_DIAGONAL = 0.02 * np.sqrt(3) / 2


def views(*poses: Pose, bodies=(TABLE, CARTON, FLOOR), seed: int = 1) -> list[View]:
    rng = np.random.default_rng(seed)
    return [view_of(bodies, pose, stamp, rng) for stamp, pose in enumerate(poses)]


@pytest.fixture(scope="module")
def grid():
    return LogOdds().fuse(views(FRONT, SIDE), REGION)


def test_what_is_occupied_is_a_surface_of_something(grid):
    occupied = grid.centres(VOXEL_OCCUPIED)
    distance = np.minimum(distance_to_shape(occupied, TABLE), distance_to_shape(occupied, CARTON))
    assert len(occupied) > 1500
    assert distance.max() < HALF_DIAGONAL + 0.006


def test_what_is_free_is_not_within_anything(grid):
    free = grid.centres(VOXEL_FREE)
    assert len(free) > 100_000
    for body in (TABLE, CARTON):
        inner = PlacedShape(Box(tuple(np.array(body.shape.size) - 0.02)), body.pose)
        assert (distance_to_shape(free, inner) > 0).all()


def test_the_top_of_the_table_that_was_seen_is_occupied_everywhere(grid):
    x, y = np.meshgrid(np.arange(-0.35, -0.05, 0.02), np.arange(-0.5, 0.5, 0.02))
    top = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.745)], axis=1)
    below = grid.state_at(top) == VOXEL_OCCUPIED
    above = grid.state_at(top + np.array([0, 0, 0.01])) == VOXEL_OCCUPIED
    assert (below | above).mean() > 0.99


def test_what_is_hidden_stays_unknown_until_a_view_shows_it():
    behind_the_carton = np.array([[0.2, 0.1, 0.8], [0.18, 0.12, 0.85]])
    inside = np.array([[0.05, 0.1, 0.85]])
    before = LogOdds().fuse(views(FRONT), REGION)
    assert (before.state_at(behind_the_carton) == VOXEL_UNKNOWN).all()
    grid = LogOdds().fuse(views(FRONT, BEHIND), REGION)
    assert (grid.state_at(behind_the_carton) == VOXEL_FREE).all()
    assert grid.state_at(inside) == VOXEL_UNKNOWN
    assert grid.state_at(np.array([[5.0, 0.0, 0.0]])) == VOXEL_UNKNOWN


def test_what_has_moved_away_is_cleared_by_two_views():
    there = views(*[FRONT] * 5)
    before = LogOdds().fuse(there, REGION)
    front_of_carton = CARTON.pose.apply(np.array([[-0.05, 0.0, z] for z in np.arange(-0.05, 0.08, 0.02)]))
    assert (before.state_at(front_of_carton) == VOXEL_OCCUPIED).mean() > 0.8
    after = LogOdds().fuse([*there, *views(FRONT, FRONT, bodies=(TABLE, FLOOR))], REGION)
    near = after.centres(VOXEL_OCCUPIED)
    above_table = near[near[:, 2] > 0.78]
    assert len(above_table) == 0
    assert (after.state_at(front_of_carton) == VOXEL_FREE).all()


def test_pixels_without_depth_say_nothing():
    blind = views(FRONT)[0]
    for value in (0.0, np.nan, np.inf, -1.0):
        depth = np.full_like(blind.image.depth, value)
        grid = LogOdds().fuse([replace(blind, image=replace(blind.image, depth=depth))], REGION)
        assert (grid.states == VOXEL_UNKNOWN).all()


FAR = VoxelRegion(Pose(np.array([5.0, 0.0, 0.0])), (2.0, 0.4, 0.4), 0.1)
AHEAD = looking_at((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def wall(distance: float) -> PlacedShape:
    return PlacedShape(Box((0.02, 4.0, 4.0)), Pose(np.array([distance + 0.01, 0.0, 0.0])))


@pytest.mark.parametrize(("distance", "trusted"), [(4.95, True), (5.05, False)])
def test_depth_beyond_the_range_says_nothing_neither_of_the_wall_nor_of_what_is_before_it(distance, trusted):
    states = LogOdds().fuse([view_of([wall(distance)], AHEAD)], FAR).states
    assert bool((states == VOXEL_OCCUPIED).any()) is trusted
    assert bool((states == VOXEL_FREE).any()) is trusted
    assert (LogOdds(max_range=5.5).fuse([view_of([wall(distance)], AHEAD)], FAR).states != 0).any()


def test_space_is_free_up_to_a_voxel_and_the_noise_before_a_surface_and_unknown_behind_it():
    grid = LogOdds().fuse([view_of([wall(4.75)], AHEAD)], FAR)
    row = grid.state_at(np.array([[x, 0.05, 0.05] for x in (4.05, 4.45, 4.65, 4.75, 4.85, 5.05)]))
    noise = 3.0 * (0.0012 + 0.0019 * 4.35**2)
    assert 4.65 > 4.75 - noise - 0.05 * np.sqrt(3) > 4.45
    assert row.tolist() == [VOXEL_FREE, VOXEL_FREE, VOXEL_UNKNOWN, VOXEL_OCCUPIED, VOXEL_UNKNOWN, VOXEL_UNKNOWN]


def test_a_surface_takes_three_points_and_the_next_grid_knows_nothing_of_it():
    mapper = LogOdds()
    lonely = view_of([wall(4.75)], AHEAD)
    points, _, _ = lonely.organised()
    index = np.floor(FAR.frame_from_grid.inverse().apply(points) / 0.1)
    in_one = np.argwhere((index == [7, 2, 2]).all(axis=-1))
    for count, state in ((2, VOXEL_UNKNOWN), (3, VOXEL_OCCUPIED)):
        depth = np.zeros_like(lonely.image.depth)
        depth[tuple(in_one[:count].T)] = lonely.image.depth[tuple(in_one[:count].T)]
        grid = mapper.fuse([replace(lonely, image=replace(lonely.image, depth=depth, stamp=9.0))], FAR)
        assert grid.states[7, 2, 2] == state
        assert grid.stamp == 9.0
        empty = mapper.fuse([], FAR)
        assert (empty.states == VOXEL_UNKNOWN).all()
        assert empty.stamp == 0.0


@pytest.mark.parametrize("seen", [1, 2, 9])
def test_however_often_a_thing_was_seen_two_views_through_its_place_free_it(seen):
    there, gone = view_of([wall(4.25)], AHEAD), view_of([wall(4.9)], AHEAD)
    place = np.array([[4.25, 0.05, 0.05]])
    for views_through, state in ((0, VOXEL_OCCUPIED), (1, VOXEL_OCCUPIED), (2, VOXEL_FREE)):
        grid = LogOdds().fuse([there] * seen + [gone] * views_through, FAR)
        assert grid.state_at(place) == state


def test_the_grid_stands_where_the_region_is_whatever_its_orientation():
    turned = VoxelRegion(Pose.from_xyz_rpy((0.05, 0.1, 0.85), (0.0, 0.0, 0.4)), (0.3, 0.34, 0.4), 0.02)
    grid = LogOdds().fuse(views(FRONT, SIDE, BEHIND), turned)
    assert grid.states.shape == (15, 17, 20)
    assert grid.stamp == 2.0
    occupied = grid.centres(VOXEL_OCCUPIED)
    on_carton = occupied[occupied[:, 2] > 0.79]
    assert len(on_carton) > 100
    assert distance_to_shape(on_carton, CARTON).max() < HALF_DIAGONAL + 0.006


def test_equal_views_give_equal_grids(grid):
    again = LogOdds().fuse(views(FRONT, SIDE), REGION)
    assert np.array_equal(grid.states, again.states)


def test_what_the_hand_takes_away_leaves_free_space(grid):
    without = freed(grid, [CARTON])
    occupied = without.centres(VOXEL_OCCUPIED)
    assert (distance_to_shape(occupied, CARTON) > 0.015 + HALF_DIAGONAL).all()
    far = distance_to_shape(grid.centres(VOXEL_OCCUPIED), CARTON) > 0.05
    assert len(occupied) >= far.sum()
    assert (without.states == VOXEL_UNKNOWN).sum() == (grid.states == VOXEL_UNKNOWN).sum()


def test_wrong_input_is_reported():
    with pytest.raises(PerceptionError, match="at least one voxel"):
        VoxelRegion(Pose(), (1.0, 0.0, 1.0))
    with pytest.raises(PerceptionError, match="voxels, at most"):
        VoxelRegion(Pose(), (10.0, 10.0, 10.0), 0.002)


def test_a_full_view_costs_less_than_a_tenth_of_a_second_of_computing():
    view = view_of((TABLE, CARTON, FLOOR), FRONT, camera=CameraIntrinsics(640, 480, 433.0, 433.0, 319.5, 239.5))
    costs = []
    for _ in range(5):
        start = time.process_time()
        LogOdds().fuse([view], REGION)
        costs.append(time.process_time() - start)
    assert min(costs) < 0.1
