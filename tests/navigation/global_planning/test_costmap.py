from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.messages import Box, Cylinder, Mesh, OccupancyGrid, PlacedShape, Pose, Pose2D, Sphere
from bestman_bt.messages.grids import FREE, OCCUPIED
from bestman_bt.navigation.global_planning.costmap import Costmap, LayeredCostmap, Rasterization
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.global_planning.hybrid_astar import HybridAStar
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.world_model.semantic_map import MapFurniture, SemanticMap
from bestman_bt.world_model.world_model import Obstacle

EXACT = Rasterization(clearance=0.0, furniture_position_error=0.0, furniture_heading_error=0.0)


def test_distance_to_a_wall_is_exact_between_cell_centres(kitchen, footprint):
    costmap = Costmap.from_map(kitchen, footprint, rasterization=EXACT)
    assert costmap.distance_at([0.013, -1.987]) == pytest.approx(2.4 - 1.987, abs=1e-6)


def test_distance_is_negative_inside_furniture(kitchen, footprint):
    costmap = Costmap.from_map(kitchen, footprint, rasterization=EXACT)
    assert costmap.distance_at([3.4, -0.9]) == pytest.approx(-0.4, abs=0.03)


def test_furniture_keeps_a_margin_for_its_position_and_heading_error(kitchen, footprint):
    exact = Costmap.from_map(kitchen, footprint, rasterization=EXACT)
    careful = Costmap.from_map(
        kitchen, footprint, rasterization=Rasterization(clearance=0.0, furniture_heading_error=math.radians(2))
    )
    before_the_middle, before_the_corner = [2.8, -0.9], [2.8, -1.45]
    lost = exact.distance_at([before_the_middle, before_the_corner]) - careful.distance_at(
        [before_the_middle, before_the_corner]
    )
    assert 0.03 <= lost[0] < 0.034
    assert lost[1] == pytest.approx(0.03 + 0.55 * math.radians(2), abs=0.004)


def test_a_base_may_stand_6_cm_before_a_table_but_not_4_cm(costmap):
    front = 3.0
    assert costmap.clearance_at(Pose2D(front - 0.28 - 0.06, -0.9, 0.0)) > 0.0
    assert costmap.clearance_at(Pose2D(front - 0.28 - 0.04, -0.9, 0.0)) < 0.0


def test_a_base_that_stands_across_touches_what_it_would_miss_when_it_faces_it(costmap):
    pose = Pose2D(3.0 - 0.28 - 0.06, -0.9, 0.0)
    assert costmap.clearance_at(pose) > 0.0
    assert costmap.clearance_at(Pose2D(pose.x, pose.y, math.radians(40))) < 0.0


def test_a_table_leg_wholly_under_the_base_counts_as_touched(kitchen, footprint):
    leg = Obstacle("leg", (PlacedShape(Cylinder(0.02, 0.7), Pose.from_xyz_rpy((0.0, 0.0, 0.35))),), 0.0)
    assert Costmap.from_map(kitchen, footprint, [leg]).clearance_at(Pose2D()) < 0.0


@pytest.mark.parametrize(("z", "blocks"), [(0.5, True), (2.5, False), (-0.2, False)])
def test_an_obstacle_counts_only_where_the_robot_can_meet_it(kitchen, footprint, z, blocks):
    box = Obstacle("box", (PlacedShape(Box((0.3, 0.3, 0.3)), Pose.from_xyz_rpy((0.0, 0.0, z), (0, 0, 0.4))),), 0.0)
    assert (Costmap.from_map(kitchen, footprint, [box]).clearance_at(Pose2D()) < 0.0) == blocks


def test_cost_decays_from_the_lethal_distance_on(costmap):
    near, far, lethal = costmap.cost([0.41, 1.5, 0.39], 0.4)
    assert near > 3.0
    assert far == pytest.approx(1.0, abs=0.01)
    assert lethal == np.inf


def test_beyond_the_map_nothing_is_free(costmap):
    assert costmap.distance_at([9.0, 0.0]) < 0.0
    assert costmap.clearance_at(Pose2D(9.0, 0.0, 0.0)) < 0.0


def test_the_occupancy_grid_shows_walls_and_furniture(costmap):
    grid = costmap.grid
    row, column = grid.to_cells([3.4, -0.9])
    assert grid.data[row, column] == 100
    row, column = grid.to_cells([0.0, 0.0])
    assert grid.data[row, column] == 0


def test_radii_of_a_rectangular_footprint():
    footprint = Footprint(np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]]))
    assert footprint.inscribed_radius == pytest.approx(0.2)
    assert footprint.circumscribed_radius == pytest.approx(math.hypot(0.3, 0.2))


def test_a_clockwise_footprint_is_refused():
    with pytest.raises(ValueError, match="counter-clockwise"):
        Footprint(np.array([[-0.3, -0.2], [-0.3, 0.2], [0.3, 0.2], [0.3, -0.2]]))


@pytest.mark.parametrize(("layer", "inside"), [("static", (0.0, -2.4)), ("furniture", (3.4, -0.9))])
def test_a_layer_that_is_switched_off_is_not_there(kitchen, footprint, layer, inside):
    assert Costmap.from_map(kitchen, footprint).distance_at(inside) < 0.03
    without = Costmap.from_map(kitchen, footprint, rasterization=Rasterization(**{layer: False}))
    assert without.distance_at(inside) > 0.3


def test_cells_that_nobody_has_seen_are_obstacles_as_long_as_their_layer_is_on(footprint):
    data = np.zeros((40, 40), dtype=np.int8)
    data[:, 30:] = -1
    data[10, 10] = 100
    grid = OccupancyGrid(data, 0.05, np.zeros(2))
    careful, bold = (LayeredCostmap(unknown=unknown).of_grid(grid, footprint) for unknown in (True, False))
    assert careful.distance_at([1.475, 1.5]) == pytest.approx(0.02, abs=1e-6)
    assert careful.distance_at([1.7, 1.5]) < 0.0
    assert bold.distance_at([1.7, 1.5]) > 0.25
    assert careful.distance_at([0.525, 0.525]) < 0.0
    assert bold.distance_at([0.525, 0.525]) < 0.0


@pytest.mark.parametrize("planner", [GridAStar, HybridAStar])
def test_no_footprint_leaves_a_map_without_walls(footprint, planner):
    known = Costmap.from_grid(OccupancyGrid(np.zeros((60, 60), dtype=np.int8), 0.05, np.zeros(2)), footprint)
    path = planner().plan(Pose2D(0.5, 0.5, 2.4), Pose2D(0.5, 2.5, 2.4), known)
    ahead = np.diff(path.points, axis=0)
    poses = np.column_stack([path.points[:-1], np.arctan2(ahead[:, 1], ahead[:, 0])])
    assert known.footprint_clearance(poses).min() > 0.0
    assert known.distance_at([0.1, 1.5]) == pytest.approx(0.1 - known.rasterization.clearance)


@pytest.mark.parametrize("shape", [(0, 0), (1, 1), (1, 40)])
def test_a_map_of_a_row_or_less_is_refused(footprint, shape):
    with pytest.raises(ValueError, match=r"2 rows and columns or more but has \(\d, \d+\)"):
        Costmap.from_grid(OccupancyGrid(np.zeros(shape, dtype=np.int8), 0.05, np.zeros(2)), footprint)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_furniture_may_be_turned_either_way_and_a_piece_that_was_measured_is_known_better(kitchen, footprint, side):
    table = kitchen.furniture["table"]
    beside = np.array([3.4 + side * 0.35, -0.9 + side * 0.65])
    measured = kitchen.with_furniture(replace(table, position_error=0.004, heading_error=0.0))
    rough, better, exact = (
        Costmap.from_map(world, footprint, rasterization=rasterization).distance_at(beside)
        for world, rasterization in (
            (kitchen, Rasterization(clearance=0.0)),
            (measured, Rasterization(clearance=0.0)),
            (kitchen, EXACT),
        )
    )
    assert exact - rough == pytest.approx(0.03 + 0.35 * math.radians(2), abs=0.003)
    assert exact - better == pytest.approx(0.004, abs=1e-6)


def test_bodies_of_all_kinds_are_as_far_away_as_their_outlines(footprint):
    room = SemanticMap(np.array([(-4, -4, 4, -4), (4, -4, 4, 4), (4, 4, -4, 4), (-4, 4, -4, -4)], dtype=float), {})
    corners = np.array([[-0.2, -0.3, 0.0], [0.2, -0.3, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 0.9]])
    faces = np.array([[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]])
    for shape, edge in (
        (Sphere(0.3), 0.3),
        (Cylinder(0.25, 0.6), 0.25),
        (Mesh(corners, faces), 0.2),
        (Box((0.3, 0.6, 0.5)), 0.15),
    ):
        placed = PlacedShape(shape, Pose.from_xyz_rpy((1.0, -0.31 if isinstance(shape, Mesh) else 0.0, 0.4)))
        costmap = Costmap.from_map(room, footprint, [Obstacle("it", (placed,), 0.0)], EXACT)
        y = -0.61 if isinstance(shape, Mesh) else 0.0
        assert costmap.distance_at([1.0 + edge + 0.5, y]) == pytest.approx(0.5, abs=0.012)


def test_the_frame_of_a_doorway_is_in_the_way_and_its_opening_is_not_as_long_as_doors_are_on(kitchen, footprint):
    post = PlacedShape(Box((0.1, 0.1, 2.0)), Pose.from_xyz_rpy((0.0, 0.45, 1.0)))
    door = MapFurniture("door", Pose2D(0.0, 0.0, 0.0), (0.1, 1.0), 2.0, (), False, (post,), is_passage=True)
    with_door = kitchen.with_furniture(door)
    for doors, away in ((True, 0.4), (False, 1.0)):
        costmap = Costmap.from_map(with_door, footprint, rasterization=replace(EXACT, doors=doors))
        assert float(costmap.distance_at([0.0, 0.0])) == pytest.approx(away, abs=0.05) or not doors
        assert (float(costmap.distance_at([0.0, 0.45])) < 0.0) == doors


def test_cells_nearer_than_is_lethal_cost_the_most_within_the_slack(costmap):
    highest = 1.0 + costmap.rasterization.cost_weight
    assert costmap.cost([0.4, 0.395, 0.391, 0.389], 0.4, 0.01) == pytest.approx([highest, highest, highest, np.inf])
    assert costmap.cost([0.4 + 0.15], 0.4)[0] == pytest.approx(1.0 + 3.0 / math.e)


@pytest.mark.parametrize("seed", [1, 2])
def test_distances_to_cells_are_those_to_their_squares_or_to_the_border(seed: int, footprint: Footprint) -> None:
    rng = np.random.default_rng(seed)
    data = np.where(rng.random((17, 23)) < 0.06, OCCUPIED, FREE).astype(np.int8)
    costmap = Costmap.from_grid(OccupancyGrid(data, 0.1, np.array([-1.0, 2.0])), footprint)
    blocked = costmap.grid_points(np.argwhere(data == OCCUPIED))
    free = costmap.grid_points(np.argwhere(data == FREE))
    for cells, others, sign in ((free, blocked, 1.0), (blocked, free, -1.0)):
        aside = np.maximum(np.abs(cells[:, None] - others[None]) - 0.05, 0.0)
        exact = sign * np.linalg.norm(aside, axis=-1).min(axis=1)
        inward = np.minimum(cells - [-1.0, 2.0], [1.3, 3.7] - cells).min(axis=1)
        exact = np.minimum(exact, inward) - costmap.rasterization.clearance
        np.testing.assert_allclose(costmap.distance_at(cells), exact, atol=1e-9)
