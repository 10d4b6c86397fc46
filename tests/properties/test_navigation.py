"""What holds for costmaps, global planners, global localisation, SLAM and exploration, wherever the world lies."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy import ndimage

from bestman_bt.messages import Box, LaserScan, OccupancyGrid, Path2D, PlacedShape, Pose, Pose2D
from bestman_bt.messages.grids import FREE, OCCUPIED, UNKNOWN
from bestman_bt.navigation.global_planning.base import PlanningFailure
from bestman_bt.navigation.global_planning.costmap import Costmap, LayeredCostmap, Rasterization
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.global_planning.hybrid_astar import HybridAStar
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.navigation.global_planning.theta_star import ThetaStar
from bestman_bt.navigation.localization.base import OdometryScan
from bestman_bt.navigation.localization.correlative_search import CorrelativeSearch
from bestman_bt.navigation.slam.frontiers import FrontierExplorer
from bestman_bt.navigation.slam.pose_graph_slam import PoseGraphSlam
from bestman_bt.world_model.semantic_map import SemanticMap
from bestman_bt.world_model.world_model import Obstacle
from tests.properties.profile import examples
from tests.properties.test_estimators import WALLS, scan_at

pytestmark = pytest.mark.slow

BASE = Footprint(np.array([[-0.28, -0.2], [0.28, -0.2], [0.28, 0.2], [-0.28, 0.2]]))
ROOM = [(0, 0, 5, 0), (5, 0, 5, 4), (5, 4, 0, 4), (0, 4, 0, 0)]
CLEAR = math.hypot(0.28, 0.2) + 0.1
boxes = st.lists(
    st.tuples(st.floats(0.5, 4.5), st.floats(0.5, 3.5), st.floats(0.1, 1.5), st.floats(0.1, 1.5), st.floats(0, 3.1)),
    max_size=5,
)
worlds = st.builds(Pose2D, st.floats(-40, 40), st.floats(-40, 40), st.floats(-3, 3))
places = st.builds(Pose2D, st.floats(0.6, 4.4), st.floats(0.6, 3.4), st.floats(-3, 3))
PLANNERS = [GridAStar(), ThetaStar(), HybridAStar()]


def costmap_of(solids, world=None, resolution=0.05):
    world = world or Pose2D()
    ends = np.array(ROOM, dtype=float).reshape(-1, 2)
    obstacles = []
    for number, (x, y, wide, deep, turn) in enumerate(solids):
        pose = (world @ Pose2D(x, y, turn)).to_pose() @ Pose(np.array([0.0, 0.0, 0.5]))
        obstacles.append(Obstacle(f"box_{number}", (PlacedShape(Box((wide, deep, 1.0)), pose),), 0.0))
    room = SemanticMap(world.apply(ends).reshape(-1, 4), {})
    return Costmap.from_map(room, BASE, obstacles, Rasterization(resolution=resolution))


@examples(12)
@given(boxes, worlds, st.sampled_from([0.025, 0.1]), st.randoms())
def test_distances_to_obstacles_are_the_same_wherever_the_world_lies_and_however_fine_the_grid(
    solids, world, resolution, random
):
    points = np.stack(np.meshgrid(np.linspace(0.1, 4.9, 33), np.linspace(0.1, 3.9, 27)), axis=-1).reshape(-1, 2)
    one = costmap_of(solids).distance_at(points)
    mixed = random.sample(solids, len(solids))
    assert np.array_equal(one, costmap_of(mixed).distance_at(points))
    # Interpolation rounds what is sharp by less than half a cell's diagonal.
    np.testing.assert_allclose(costmap_of(solids, world).distance_at(world.apply(points)), one, atol=0.036)
    fine = costmap_of(solids, resolution=resolution).distance_at(points)
    np.testing.assert_allclose(fine, one, atol=0.036 * max(1.0, resolution / 0.05))


@pytest.mark.parametrize("planner", PLANNERS)
@examples(8)
@given(boxes, places, places, worlds)
def test_a_path_is_free_and_found_where_there_is_room_wherever_the_world_lies(planner, solids, start, goal, world):
    here, there = costmap_of(solids), costmap_of(solids, world)
    assume(min(here.distance_at(np.array([start.xy, goal.xy]))) > CLEAR)
    connected = _connected(here, start, goal)
    for costmap, one, other in ((here, start, goal), (there, world @ start, world @ goal)):
        found = planner.plan(one, other, costmap)
        if isinstance(found, PlanningFailure):
            assert not connected, found.text
            continue
        assert isinstance(found, Path2D)
        np.testing.assert_allclose(found.points[[0, -1]], [one.xy, other.xy], atol=1e-6)
        assert np.isfinite(found.points).all()
        corners = itertools.pairwise((*found.points, found.points[-1]))
        along = np.concatenate([np.linspace(a, b, 20) for a, b in corners])
        assert costmap.distance_at(along).min() > BASE.inscribed_radius - 0.02


def _connected(costmap, start, goal):
    parts, _ = ndimage.label(costmap.distance > CLEAR)
    one, other = (parts[costmap.cells(np.array(pose.xy))] for pose in (start, goal))
    return bool(one == other != 0)


@examples(20)
@given(st.integers(1, 4), st.integers(1, 4), st.sampled_from([FREE, OCCUPIED, UNKNOWN]))
def test_the_smallest_grids_make_a_costmap_or_are_refused_by_name(rows, columns, value):
    grid = OccupancyGrid(np.full((rows, columns), value, dtype=np.int8), 0.05, np.zeros(2))
    if min(rows, columns) < 2:
        with pytest.raises(ValueError, match="should have 2 rows and columns or more"):
            LayeredCostmap().of_grid(grid, BASE)
        return
    costmap = LayeredCostmap().of_grid(grid, BASE)
    assert np.isfinite(costmap.distance_at(costmap.grid_points(np.argwhere(grid.data == value)))).all()
    for planner in (GridAStar(), ThetaStar(), HybridAStar()):
        assert isinstance(planner.plan(Pose2D(0.01, 0.01, 0.0), Pose2D(0.02, 0.02, 0.0), costmap), PlanningFailure)
    assert FrontierExplorer().tour(grid, costmap, Pose2D(0.01, 0.01, 0.0)) == []


@examples(4)
@given(st.builds(Pose2D, st.floats(-2, 0.5), st.floats(-1.2, 1.8), st.floats(-3, 3)), worlds)
def test_the_base_is_found_at_the_same_place_wherever_the_map_lies(at, world):
    found = []
    for turned in (Pose2D(), world):
        walls = turned.apply(WALLS.reshape(-1, 2)).reshape(-1, 4)
        scan = OdometryScan(Pose2D(), scan_at(turned @ at, walls, 360))
        best = CorrelativeSearch().locate(SemanticMap(walls, {}), [scan], Pose2D())
        found.append([turned.inverse() @ place.pose for place in best if place.probability > 0.2])
    for ours, theirs in (found, found[::-1]):
        for pose in ours:
            assert any(
                pose.distance_to(other) < 0.05 and abs(math.sin(pose.theta - other.theta)) < 0.02 for other in theirs
            )
    assert any(pose.distance_to(at) < 0.05 for pose in found[0])


@examples(10)
@given(st.sampled_from(["empty", "none", "far", "one"]))
def test_scans_that_hold_nothing_give_no_place_and_no_exception(kind):
    ranges = np.full(180, np.inf)
    if kind == "one":
        ranges[7] = 1.0
    if kind == "far":
        ranges[:] = 7.999
    scan = LaserScan(ranges[: 0 if kind == "none" else None], -math.pi, 2 * math.pi / 180, 0.05, 8.0, 0.0)
    places_found = CorrelativeSearch().locate(SemanticMap(WALLS, {}), [OdometryScan(Pose2D(), scan)], Pose2D())
    assert not places_found
    for walls in (np.zeros((0, 4)), WALLS[:1]):
        places_found = CorrelativeSearch().locate(SemanticMap(walls, {}), [OdometryScan(Pose2D(), scan)], Pose2D())
        assert not places_found
    slam = PoseGraphSlam()
    slam.reset(Pose2D(), Pose2D())
    for turn in range(3):
        estimate = slam.add(Pose2D(0.3 * turn, 0.0, 0.0), scan, Pose2D())
        assert np.isfinite([estimate.pose.x, estimate.pose.y, estimate.pose.theta]).all()
    if kind != "far":  # a ring around every place is the same ring
        assert estimate.pose.distance_to(Pose2D(0.6, 0.0, 0.0)) < 0.3
    assert (slam.grid.data == OCCUPIED).any() == (kind == "far")


@examples(3)
@given(st.builds(Pose2D, st.floats(-20, 20), st.floats(-20, 20), st.floats(-3, 3)), st.integers(0, 1000))
def test_slam_maps_the_same_wherever_it_begins(start, seed):
    """The odometry is off by a few percent."""
    rng = np.random.default_rng(seed)
    steps = [Pose2D(0.15, 0.0, float(turn)) for turn in rng.uniform(-0.25, 0.25, 14)]
    ends = []
    for world in (Pose2D(), start):
        slam, true, counted = PoseGraphSlam(), Pose2D(-2.0, 0.5, 0.0), Pose2D()
        slam.reset(world @ true, counted)
        slam.add(counted, scan_at(true, WALLS, 360), Pose2D())
        for step in steps:
            true, counted = true @ step, counted @ Pose2D(1.04 * step.x, 0.01, 1.05 * step.theta)
            estimate = slam.add(counted, scan_at(true, WALLS, 360), Pose2D())
        ends.append(world.inverse() @ estimate.pose)
    assert ends[0].distance_to(true) < 0.05
    assert ends[0].distance_to(ends[1]) < 0.03


@examples(8)
@given(
    st.lists(st.tuples(st.integers(5, 70), st.integers(5, 90), st.integers(2, 12), st.integers(2, 20)), max_size=4),
    st.integers(20, 80),
    st.sampled_from([(0, 0), (60, 25), (-400, 800)]),
)
def test_an_exploration_leads_to_free_places_wherever_the_map_lies(solids, known_to, cells_off):
    """The map moved by whole cells of its lattice: the views move along, and see as much after as long a way; each is
    where the base can turn.
    """
    data = np.full((80, 100), FREE, dtype=np.int8)
    data[[0, -1], :] = data[:, [0, -1]] = OCCUPIED
    for row, column, height, width in solids:
        data[row : row + height, column : column + width] = OCCUPIED
    data[:, known_to:] = UNKNOWN
    start = Pose2D(0.6, 0.6, 0.0)
    off = 0.35 * np.array(cells_off, dtype=float)
    tours = []
    for origin in (np.zeros(2), off):
        grid = OccupancyGrid(data, 0.05, origin)
        costmap = LayeredCostmap().of_grid(grid, BASE)
        pose = Pose2D(start.x + origin[0], start.y + origin[1], 0.0)
        tour = FrontierExplorer().tour(grid, costmap, pose)
        for view in tour:
            assert costmap.distance_at(np.array(view.pose.xy)) > BASE.circumscribed_radius
            assert view.gain > 0.0
            assert math.isfinite(view.distance)
        tours.append(np.array([(view.gain, view.distance, *(view.pose.xy - origin)) for view in tour]).reshape(-1, 4))
    one, other = tours
    assert bool(one.size) == bool(other.size)
    if one.size:
        # Rays along the borders of cells see one cell or the other, which may split what is unknown differently.
        assert one[:, 0].sum() == pytest.approx(other[:, 0].sum(), rel=0.15)
        centres = [np.average(tour[:, 1:], axis=0, weights=tour[:, 0]) for tour in tours]
        np.testing.assert_allclose(*centres, atol=1.5)
