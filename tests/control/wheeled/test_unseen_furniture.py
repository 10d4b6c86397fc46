"""What of the map no lidar sees, such as the top of a table, is kept from what a robot has above its lidar."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.control.wheeled.collision_monitor import CollisionMonitor
from bestman_bt.control.wheeled.velocity_gate import VelocityGate
from bestman_bt.messages import Box, PlacedShape, Pose, Pose2D, Twist2D
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.footprint_check import FootprintMotion
from bestman_bt.world_model.semantic_map import MapArticulation, MapFurniture, SemanticMap
from bestman_bt.world_model.world_model import Obstacle
from tests.control.scripted_parts import BASE, CORNERS, ScriptedBase

LIDAR, DT = 0.2, 0.025
COLUMN = np.array([[x, y, z] for x in (0.06, 0.2) for y in (-0.1, 0.1) for z in (0.3, 0.7)])
CHASSIS = np.array([[x, y, z] for x, y in CORNERS for z in (0.05, 0.29)])
WITH_COLUMN = Footprint(np.array(CORNERS)).reaching_above(LIDAR, [CHASSIS, COLUMN], 0.02)
THERE, OFF = Pose2D(1.0, -2.0, 0.7), 0.03


def piece(height: float, shapes: tuple[PlacedShape, ...] = (), solid: bool = False) -> MapFurniture:
    return MapFurniture("piece", THERE, (0.8, 1.2), height, (), solid, shapes, (), OFF, 0.0)


def room_with(*pieces: MapFurniture, footprint: Footprint = WITH_COLUMN, seen: tuple[Obstacle, ...] = ()) -> Costmap:
    walls = np.array([(-6.0, -6.0, 6.0, -6.0), (6.0, -6.0, 6.0, 6.0), (-6.0, 6.0, -6.0, -6.0)])
    return Costmap.from_map(SemanticMap(walls, {p.name: p for p in pieces}), footprint, seen)


def driven(costmap: Costmap, start: Pose2D, twist: Twist2D, placed: bool = True, seconds: float = 4.0) -> list[Pose2D]:
    """Where a base without anything before its lidar goes by a gate with this map; the odometry has its own frame."""
    base = ScriptedBase(start, Pose2D(3.0, 1.0, -1.2))
    gate = VelocityGate(base, CollisionMonitor(BASE))
    gate.use_footprint(costmap.footprint, costmap)
    gate.placed = placed
    poses = []
    for _ in range(int(seconds / DT)):
        gate.command(twist, None, base.velocity(), base.true_pose, base.odometry(), (), (), DT)
        base.clock.sleep(DT)
        poses.append(base.true_pose)
    return poses


def gap(poses: list[Pose2D], outline: np.ndarray) -> float:
    """Metres, at least, between this outline of the robot and the piece where it is believed; negative inside."""
    piece_outline = FootprintMotion(np.array([(-0.4, -0.6), (0.4, -0.6), (0.4, 0.6), (-0.4, 0.6)]), 0.0)
    edge = Footprint(np.array(outline)).outline(0.01) if np.ptp(outline[:, 0]) > 0.3 else outline
    return min(float(piece_outline.distance(THERE.inverse().apply(pose.apply(edge))).min()) for pose in poses)


AHEAD = THERE @ Pose2D(-1.2, 0.1, 0.0)
COLUMN_OUTLINE = COLUMN[::2, :2]


def test_the_upper_body_is_what_reaches_well_above_the_lidar_within_the_outline():
    x, y = WITH_COLUMN.upper.corners.T
    assert [x.min(), x.max(), y.min(), y.max()] == pytest.approx([0.04, 0.22, -0.12, 0.12], abs=2e-3)
    assert WITH_COLUMN.upper.top == pytest.approx(0.7)
    flush = COLUMN + np.array([0.08, 0.0, 0.0])
    assert Footprint(np.array(CORNERS)).reaching_above(LIDAR, [flush], 0.02).upper.corners[:, 0].max() == pytest.approx(
        0.28, abs=1e-6
    )
    assert Footprint(np.array(CORNERS)).reaching_above(LIDAR, [CHASSIS], 0.02).upper is None


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(
    ("start", "twist"),
    [
        (AHEAD, Twist2D(0.6)),
        (AHEAD, Twist2D(0.6, 0.0, 0.3)),
        (AHEAD @ Pose2D(0.0, 0.0, math.pi), Twist2D(-0.6)),
        (THERE @ Pose2D(-0.55, 0.3, 1.57), Twist2D(0.0, 0.0, -1.2)),
    ],
    ids=["straight", "arc", "backwards", "turning on the spot"],
)
def test_a_column_stops_before_a_table_wherever_within_its_error_that_stands(start, twist):
    poses = driven(room_with(piece(0.75)), start, twist)
    assert OFF < gap(poses, COLUMN_OUTLINE) < OFF + 0.08
    assert gap(driven(room_with(piece(0.75)), start, twist, placed=False), COLUMN_OUTLINE) < -0.05


def test_out_from_under_a_table_is_free_and_further_in_is_not():
    under = THERE @ Pose2D(-0.3, 0.0, 0.3)
    assert driven(room_with(piece(0.75)), under, Twist2D(-0.5))[-1].distance_to(under) > 1.5
    assert driven(room_with(piece(0.75)), under, Twist2D(0.5))[-1].distance_to(under) < 0.01


@pytest.mark.parametrize(
    "costmap",
    [
        room_with(piece(1.5, (PlacedShape(Box((0.8, 1.2, 0.5)), Pose(np.array([0.0, 0.0, 1.2]))),))),
        room_with(piece(0.75), footprint=Footprint(np.array(CORNERS))),
        room_with(piece(0.75, solid=True)),
    ],
    ids=["boards above the robot", "no upper body", "seen by the lidar"],
)
def test_what_the_robot_fits_under_and_what_its_lidar_sees_is_left_to_the_lidar(costmap):
    assert gap(driven(costmap, AHEAD, Twist2D(0.6)), COLUMN_OUTLINE) < -0.3


def test_what_is_lower_than_the_lidar_is_kept_from_the_base_itself():
    poses = driven(room_with(piece(0.15)), AHEAD, Twist2D(0.6))
    assert OFF < gap(poses, np.array(CORNERS)) < OFF + 0.06


def chest(bottom: float) -> MapFurniture:
    """A drawer of 0.2 m from ``bottom`` on, whose handle stands out by 0.06 m; the rest is seen by the lidar."""
    front = PlacedShape(Box((0.02, 1.2, 0.2)), Pose(np.array([-0.39, 0.0, bottom + 0.1])))
    drawer = MapArticulation("drawer", "prismatic", (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0), 0.4, (front,), handle_depth=0.06)
    return replace(piece(0.75, solid=True), articulations=(drawer,))


@pytest.mark.parametrize(
    ("bottom", "outline"), [(0.1, np.array(CORNERS)), (0.5, COLUMN_OUTLINE)], ids=["base", "column"]
)
def test_the_handle_of_a_closed_drawer_is_kept_from_the_base_and_from_what_is_as_high(bottom, outline):
    costmap = room_with(chest(bottom))
    for start, twist in ((AHEAD, Twist2D(0.6)), (AHEAD @ Pose2D(0.0, 0.0, math.pi), Twist2D(-0.6))):
        assert OFF + 0.06 < gap(driven(costmap, start, twist), outline) < OFF + 0.06 + 0.08
    before_it = THERE.apply(np.array([(-0.4 - 0.06, 0.0)]))
    row, column = ((before_it - costmap.origin) / costmap.resolution).astype(int)[0][::-1]
    assert costmap.distance[row, column] < 0.0


def test_a_handle_above_the_robot_is_driven_under():
    assert gap(driven(room_with(chest(0.9)), AHEAD, Twist2D(0.6)), COLUMN_OUTLINE) < -0.3


def test_an_open_drawer_above_the_lidar_is_kept_from_the_column():
    for height, passes in ((0.5, False), (0.9, True)):
        drawer = PlacedShape(Box((0.8, 1.2, 0.1)), THERE.to_pose(height))
        poses = driven(room_with(seen=(Obstacle("chest/drawer", (drawer,), 0.0),)), AHEAD, Twist2D(0.6))
        assert (gap(poses, COLUMN_OUTLINE) < -0.1) == passes


def test_nothing_is_forbidden_that_the_map_itself_allows():
    """Whatever the upper body is, it lies within the outline that planners keep clear of the same furniture."""
    rng = np.random.default_rng(3)
    outline = FootprintMotion(np.array(CORNERS), 1e-6)
    for _ in range(20):
        body = rng.uniform((-0.6, -0.6, 0.1), (0.6, 0.6, 1.2), (8, 3))
        upper = Footprint(np.array(CORNERS)).reaching_above(LIDAR, [body], 0.02).upper
        assert upper is None or outline.distance(upper.corners).max() <= 0.0
