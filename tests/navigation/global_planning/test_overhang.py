"""What stands out above a base meets what is as high, and passes over what is lower."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.messages import Box, OccupancyGrid, Path2D, PlacedShape, Pose, Pose2D
from bestman_bt.messages.grids import FREE, OCCUPIED
from bestman_bt.navigation.global_planning.base import PlanningFailure, PlanningFailureReason
from bestman_bt.navigation.global_planning.costmap import Costmap, Rasterization
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.navigation.local_planning.footprint_check import FootprintMotion
from bestman_bt.navigation.local_planning.obstacle_layer import ObstacleLayer
from bestman_bt.world_model.world_model import Obstacle
from tests.navigation.global_planning.test_all_planners import PLANNERS, room, swept, walls

BASE = Footprint(np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]]))
BESIDE = np.array([[x, y, z] for x in (0.0, 0.1) for y in (0.1, 0.3) for z in (0.9, 1.2)])
ARM = BASE.carrying([BESIDE], 0.01)
"""An arm that stands out 10 cm on the left."""


@pytest.fixture(params=list(PLANNERS))
def planner(request: pytest.FixtureRequest):
    return PLANNERS[request.param]


def crates(height: float, *places: tuple[float, float, float, float]) -> list[Obstacle]:
    """Boxes (x, y, width, depth) that stand on the floor."""
    return [
        Obstacle(f"crate_{n}", (PlacedShape(Box((w, d, height)), Pose.from_xyz_rpy((x, y, height / 2))),), 0.0)
        for n, (x, y, w, d) in enumerate(places)
    ]


WIDE = BASE.carrying([BESIDE * (1.0, 1.5, 1.0)], 0.01)
"""One that stands out 25 cm."""
START, GOAL = Pose2D(1.0, 1.0, 1.0), Pose2D(5.0, 1.2, -1.0)


def two_rooms(height: float, doorway: float, footprint: Footprint = WIDE) -> Costmap:
    """6 by 4 m, cut by two screens with a doorway between them."""
    screens = [(3.0, 2.0 + side * (doorway / 2 + 1.0), 0.1, 2.0) for side in (-1.0, 1.0)]
    return Costmap.from_map(walls(*room(6.0, 4.0)), footprint, crates(height, *screens))


def test_a_base_without_overhang_has_one_field_for_everything(costmap):
    assert costmap.tall is None
    assert costmap.above is None
    assert costmap.for_turning is costmap.for_passing is costmap.without_overhang is costmap


@pytest.mark.parametrize(("height", "touches"), [(0.85, False), (0.95, True)])
def test_the_arm_passes_over_a_low_crate_and_touches_a_high_one(height, touches):
    costmap = Costmap.from_map(walls(*room(4.0, 4.0)), ARM, crates(height, (2.0, 2.75, 1.0, 1.0)))
    beside = Pose2D(2.0, 2.0, 0.0)
    assert costmap.without_overhang.clearance_at(beside) == pytest.approx(0.045, abs=0.005)
    assert (costmap.clearance_at(beside) <= 0.0) == touches
    assert costmap.clearance_at(Pose2D(2.0, 2.0, math.pi)) > 0.0


def test_a_wall_is_high_and_furniture_as_high_as_the_map_has_it(kitchen):
    costmap = Costmap.from_map(kitchen, ARM)
    along_the_wall = Pose2D(3.0, -2.4 + 0.26, math.pi)
    assert costmap.without_overhang.clearance_at(along_the_wall) > 0.03
    assert costmap.clearance_at(along_the_wall) < 0.0
    beside_the_table = Pose2D(3.4, -0.3 + 0.26, math.pi)
    assert costmap.clearance_at(beside_the_table) == costmap.without_overhang.clearance_at(beside_the_table)
    table = kitchen.furniture["table"]
    higher = kitchen.with_furniture(replace(table, height=1.0))
    assert Costmap.from_map(higher, ARM).clearance_at(beside_the_table) < 0.0


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("seed", range(3))
def test_an_arm_that_reaches_across_a_thin_wall_is_noticed_wherever_the_cells_lie(seed):
    rng = np.random.default_rng(seed)
    offset, turn = rng.uniform(-0.05, 0.05), rng.uniform(0.0, math.pi)
    along = np.array([math.cos(turn), math.sin(turn)])
    middle = np.array([2.5, 2.5]) + offset
    costmap = Costmap.from_map(walls(*room(5.0, 5.0), (*(middle - 2.0 * along), *(middle + 2.0 * along))), WIDE)
    poses = np.column_stack([rng.uniform(1.8, 3.2, (400, 2)), rng.uniform(-3.0, 3.0, 400)])
    wall = middle + np.linspace(-2.0, 2.0, 2001)[:, None] * along
    base, above = FootprintMotion(BASE.corners, 0.0), FootprintMotion(WIDE.above.corners, 0.0)
    seen_from = [Pose2D(*pose).inverse().apply(wall) for pose in poses.tolist()]
    touches = np.array([np.any((above.distance(s) < 0.0) & (base.distance(s) > 0.02)) for s in seen_from])
    gaps = np.array([above.distance(s).min() for s in seen_from])
    clearance = costmap.overhang_clearance(poses)
    assert touches.sum() > 50
    assert clearance[touches].max() <= 0.0
    assert clearance[gaps > 0.025].min() > 0.0


def test_stands_at_low_furniture_are_as_free_as_without_an_arm(kitchen):
    reaching = BASE.carrying([BESIDE[:, [1, 0, 2]] + (0.35, 0.0, 0.0)], 0.01)
    stands = np.array([[3.0 - 0.3 - gap, y, 0.0] for gap in (0.05, 0.06, 0.1) for y in (-1.2, -0.9, -0.6)])
    with_arm, without = Costmap.from_map(kitchen, reaching), Costmap.from_map(kitchen, BASE)
    assert reaching.overhang.reach > 0.3
    np.testing.assert_array_equal(with_arm.footprint_clearance(stands), without.footprint_clearance(stands))


def test_cells_of_a_grid_are_as_high_as_the_arm():
    data = np.full((40, 40), FREE, dtype=np.int8)
    data[26:, :] = OCCUPIED
    costmap = Costmap.from_grid(OccupancyGrid(data, 0.05, np.zeros(2)), ARM)
    assert costmap.without_overhang.clearance_at(Pose2D(1.0, 1.05, 0.0)) > 0.0
    assert costmap.clearance_at(Pose2D(1.0, 1.05, 0.0)) < 0.0


@pytest.mark.parametrize("beside", [0.23, 0.27, 0.31, 0.36, 0.41])
def test_a_post_within_the_outline_above_is_noticed_if_it_is_high(beside):
    poses = Pose2D(2.0, 2.0, 0.0), Pose2D(2.0, 2.0, math.pi)
    for height, touches in ((1.5, True), (0.8, False)):
        post = crates(height, (2.05, 2.0 + beside, 0.025, 0.025))
        costmap = Costmap.from_map(walls(*room(4.0, 4.0)), WIDE, post)
        assert (costmap.clearance_at(poses[0]) < 0.0) == touches
        assert costmap.clearance_at(poses[1]) > 0.0


def test_what_only_the_lidar_has_seen_is_kept_from_the_base_and_not_from_the_arm():
    costmap = Costmap.from_map(walls(*room(4.0, 4.0)), WIDE)
    layer = ObstacleLayer()
    layer.points = np.array([[2.05, 2.3]])
    seen = layer.on(costmap)
    assert seen.distance_at(layer.points[0]) < 0.03
    assert seen.clearance_at(Pose2D(2.0, 2.0, 0.0)) > 0.0
    assert seen.clearance_at(Pose2D(2.0, 2.15, 0.0)) < 0.0


def test_a_field_for_the_arm_belongs_to_a_footprint_with_one():
    costmap = Costmap.from_map(walls(*room(4.0, 4.0)), ARM)
    with pytest.raises(ValueError, match="tall"):
        replace(costmap, tall=None)


@pytest.mark.quick_cases(2)
def test_a_doorway_that_is_wide_enough_for_base_and_arm_is_passed_clear_of_both(planner):
    costmap = two_rooms(1.5, 0.9)
    path = planner.plan(START, GOAL, costmap)
    assert isinstance(path, Path2D), path
    assert costmap.footprint_clearance(swept(path)).min() > 0.0


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("name", ["grid_astar", "theta_star"])
@pytest.mark.parametrize("there_and_back", [1, -1])
def test_where_the_arm_leaves_no_room_in_the_middle_the_base_passes_beside_it(name, there_and_back):
    costmap = two_rooms(1.5, 0.6, ARM)
    assert costmap.clearance_at(Pose2D(3.0, 2.0, 0.0)) < 0.0
    path = PLANNERS[name].plan(*(START, GOAL)[::there_and_back], costmap)
    assert isinstance(path, Path2D), path
    assert costmap.footprint_clearance(swept(path)).min() > 0.0


@pytest.mark.quick_cases(2)
def test_a_doorway_between_low_screens_is_as_wide_as_without_an_arm(planner):
    costmap = two_rooms(0.8, 0.6)
    path = planner.plan(START, GOAL, costmap)
    assert isinstance(path, Path2D), path
    poses = swept(path)
    assert np.any(np.abs(poses[:, :2] - (3.0, 2.0)).max(axis=1) < 0.15), "it leads through the doorway"
    assert costmap.footprint_clearance(poses).min() > 0.0


def test_distances_to_what_is_tall_have_the_same_margins_as_those_to_everything():
    """To the millimetre: a crate that is as high as the arm is as far away as a low one."""
    place = np.array([[2.0, 1.6]])
    for clearance in (0.005, 0.04):
        low, high = (
            Costmap.from_map(
                walls(*room(4.0, 4.0)),
                ARM,
                crates(height, (2.0, 2.75, 1.0, 1.0)),
                Rasterization(clearance=clearance),
            )
            for height in (0.5, 1.5)
        )
        assert high.distance_at(place) == pytest.approx([0.65 - clearance], abs=1e-6)
        assert high.above.distance_at(place) == pytest.approx([0.65 - clearance], abs=1e-6)
        assert low.above.distance_at(place) == pytest.approx([1.6 - clearance], abs=1e-6)


def test_where_only_the_arm_is_in_the_way_the_failure_reports_it():
    failure = GridAStar().plan(START, GOAL, two_rooms(1.5, 0.6))
    assert isinstance(failure, PlanningFailure)
    assert failure.reason is PlanningFailureReason.ARM_IN_THE_WAY
    assert failure.text.startswith("the arm extends 25 cm beyond the base, 0.89 m above the floor: nothing wide enough")


def test_where_the_base_does_not_pass_either_the_arm_is_not_blamed():
    failure = GridAStar().plan(START, GOAL, two_rooms(1.5, 0.39))
    assert isinstance(failure, PlanningFailure)
    assert failure.reason is PlanningFailureReason.NO_PATH
    assert "arm" not in failure.text


def test_a_goal_that_only_the_arm_would_touch_is_distinguished(planner):
    costmap = Costmap.from_map(walls(*room(6.0, 4.0)), WIDE, crates(1.5, (4.0, 2.4, 0.1, 0.1)))
    failure = planner.plan(Pose2D(1.0, 1.0, 0.0), Pose2D(4.0, 2.0, 0.0), costmap)
    assert isinstance(failure, PlanningFailure)
    assert failure.reason is PlanningFailureReason.ARM_IN_THE_WAY
    assert "at the goal (4.00, 2.00) m" in failure.text


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("deep", [0.02, 0.15])
def test_an_arm_that_is_inside_the_outline_of_something_high_is_driven_out_of_it_straight(planner, deep):
    reaching = BASE.carrying([BESIDE[:, [1, 0, 2]] + (0.2, 0.0, 0.0)], 0.01)
    front = 4.0
    costmap = Costmap.from_map(walls(*room(6.0, 4.0)), reaching, crates(1.8, (front + 0.3, 2.0, 0.6, 1.0)))
    start = Pose2D(front - float(reaching.above.corners[:, 0].max()) + deep, 2.0, 0.0)
    assert costmap.without_overhang.clearance_at(start) > 0.0
    assert costmap.clearance_at(start) < 0.0
    path = planner.plan(start, Pose2D(1.5, 1.5, 0.0), costmap)
    assert isinstance(path, Path2D), path
    assert path.reverse[0]
    clearance = costmap.footprint_clearance(swept(path))
    free = int(np.argmax(clearance > 0.0))
    assert np.all(np.diff(clearance[: free + 1]) > -1e-3)
    assert clearance[free:].min() > 0.0
