from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.messages import Box, MotionErrorCode, Path2D, PlacedShape, Pose, Pose2D, wrap_angle
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.scene import FurnitureModel, PlacedFurniture
from bestman_bt.world_model.semantic_map import SemanticMap
from hal.api import MobileBase, MotionStatus
from hal.simulation.sensor_pipeline import SensorFault


def stand_pose(simulated, furniture: str) -> Pose2D:
    """6 cm in front of where the map has a piece of furniture."""
    piece = simulated.world.map.furniture[furniture]
    return piece.pose @ Pose2D(-piece.footprint[0] / 2 - 0.28 - 0.06, 0.05, 0.0)


def drive_to(simulated, goal: Pose2D, each=None):
    costmap = Costmap.from_map(simulated.world.map, Footprint(np.array(simulated.base.model.footprint)))
    path = GridAStar().plan(simulated.world.base.pose, goal, costmap)
    return simulated.wait(simulated.base.follow(path), each=each)


def difference(pose: Pose2D, truth: Pose2D) -> tuple[float, float]:
    return pose.distance_to(truth), abs(wrap_angle(pose.theta - truth.theta))


@pytest.mark.parametrize("seed", [1, pytest.param(4, marks=pytest.mark.slow)])
def test_the_base_drives_to_the_table_without_touching_anything_and_knows_where_it_is(simulate, seed):
    simulated = simulate(seed)
    start, odometry_start = simulated.true_pose, simulated.robot.parts["base"].odometry()
    estimates = []
    handle = drive_to(
        simulated,
        stand_pose(simulated, "table"),
        each=lambda: estimates.append(difference(simulated.world.base.pose, simulated.true_pose)),
    )
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    position, heading = difference(simulated.true_pose, stand_pose(simulated, "table"))
    assert position < 0.01
    assert heading < math.radians(0.7)
    assert np.max(estimates, axis=0)[0] < 0.01
    assert np.percentile(estimates, 95, axis=0)[1] < math.radians(0.5)
    assert simulated.touched() == []
    moved = odometry_start.inverse() @ simulated.robot.parts["base"].odometry()
    drift, _ = difference(start @ moved, simulated.true_pose)
    assert drift > 2 * difference(simulated.world.base.pose, simulated.true_pose)[0]


@pytest.mark.slow
def test_from_the_table_the_base_backs_out_and_drives_to_the_counter(simulate):
    world = draw_world(load_scene("kitchen"), 1)
    table = world.furniture[0].actual
    simulated = simulate(1, replace(world, robot_start=table @ Pose2D(-0.4 - 0.28 - 0.06, 0.0, 0.0)))
    handle = drive_to(simulated, stand_pose(simulated, "counter"))
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    position, heading = difference(simulated.true_pose, stand_pose(simulated, "counter"))
    assert position < 0.01
    assert heading < math.radians(0.7)
    assert simulated.touched() == []


@pytest.mark.slow
def test_equal_seeds_end_at_the_same_pose_to_the_last_bit(simulate):
    ends = []
    for _ in range(2):
        simulated = simulate(3)
        simulated.wait(simulated.base.drive(0.5))
        ends.append((simulated.true_pose, simulated.world.base))
    assert ends[0] == ends[1]


@pytest.mark.slow
def test_the_base_turns_to_a_heading_and_drives_back(simulate):
    simulated = simulate(1)
    turned = simulated.wait(simulated.base.rotate_to(2.0))
    assert turned.status is MotionStatus.SUCCEEDED, turned.failure
    assert simulated.true_pose.theta == pytest.approx(2.0, abs=math.radians(0.7))
    before = simulated.true_pose
    back = simulated.wait(simulated.base.drive(-0.3))
    assert back.status is MotionStatus.SUCCEEDED, back.failure
    moved = before.inverse() @ simulated.true_pose
    assert moved.x == pytest.approx(-0.3, abs=0.01)
    assert abs(moved.y) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("turn", [-2.6, 1.2, 3.0])
def test_a_base_that_gets_a_new_path_each_second_arrives_and_turns_to_its_goal(simulate, turn):
    simulated = simulate(1)
    goal = simulated.world.base.pose @ Pose2D(0.6, 0.0, turn)
    for _ in range(14):
        here = simulated.world.base.pose
        handle = simulated.base.follow(Path2D(np.array([here.xy, goal.xy]), goal))
        for _ in range(20):
            simulated.robot.clock.sleep(0.05)
        if handle.done:
            break
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    position, heading = difference(simulated.true_pose, goal)
    assert position < 0.02
    assert heading < math.radians(0.7)


@pytest.mark.slow
def test_a_goal_close_by_is_driven_to_unless_the_base_has_come_to_it_already(simulate):
    simulated = simulate(1)
    here = simulated.world.base.pose
    goal = here @ Pose2D(0.018, 0.0, 0.0)
    path = Path2D(np.array([here.xy, goal.xy]), goal)
    simulated.base.follow(path).cancel()
    simulated.wait(simulated.base.follow(path))
    assert (here.inverse() @ simulated.world.base.pose).x == pytest.approx(0.018, abs=0.006)


@pytest.mark.slow
def test_parking_ends_at_rest_with_the_believed_pose_as_result(simulate):
    simulated = simulate(1)
    driving = simulated.base.drive(1.0)
    simulated.robot.clock.sleep(1.0)
    parked = simulated.wait(simulated.base.park())
    assert driving.status is MotionStatus.CANCELED
    assert driving.failure.code is MotionErrorCode.SUPERSEDED
    assert parked.result == simulated.world.base
    before = simulated.true_pose
    simulated.robot.clock.sleep(0.5)
    assert difference(before, simulated.true_pose)[0] < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("how", ["cancel", "stop"])
def test_an_action_that_is_cancelled_or_stopped_leaves_the_base_at_rest_within_half_a_second(simulate, how):
    simulated = simulate(1)
    handle = simulated.base.drive(1.5)
    simulated.robot.clock.sleep(1.5)
    assert simulated.robot.parts["base"].velocity().vx > 0.3
    if how == "cancel":
        handle.cancel()
    else:
        simulated.base.stop()
    assert handle.status is MotionStatus.CANCELED
    simulated.robot.clock.sleep(0.5)
    before = simulated.true_pose
    simulated.robot.clock.sleep(0.5)
    assert difference(before, simulated.true_pose)[0] < 0.002


@pytest.mark.slow
def test_a_stop_of_the_robot_cancels_the_action(simulate):
    simulated = simulate(1)
    handle = simulated.base.drive(1.5)
    simulated.robot.clock.sleep(1.0)
    simulated.robot.stop()
    simulated.robot.clock.sleep(0.1)
    assert handle.status is MotionStatus.CANCELED
    assert handle.failure.code is MotionErrorCode.STOPPED


def test_a_base_whose_lidar_falls_silent_is_stopped_at_once_and_drives_again_when_it_is_back(simulate):
    simulated = simulate(1)
    base, lidar = simulated.robot.part("base", MobileBase), simulated.robot.parts["lidar"]
    handle = simulated.base.drive(1.5)
    simulated.robot.clock.sleep(1.5)
    lidar.fault = SensorFault.SILENT
    simulated.wait(handle, limit=0.2)
    assert handle.failure.code is MotionErrorCode.NO_DATA
    speed = base.velocity().vx
    simulated.robot.clock.sleep(0.1)  # its dead-man would let it drive on for longer
    assert base.velocity().vx < speed - 0.1
    lidar.fault = None
    assert simulated.wait(simulated.base.drive(-0.2)).status is MotionStatus.SUCCEEDED


@pytest.mark.slow
def test_a_wall_in_the_way_is_reported_as_blocked(simulate):
    world = draw_world(load_scene("kitchen"), 1)
    simulated = simulate(1, replace(world, robot_start=Pose2D(-2.9, 0.0, math.pi)))
    handle = simulated.wait(simulated.base.drive(1.0), limit=15.0)
    assert handle.status is MotionStatus.FAILED
    assert handle.failure.code is MotionErrorCode.BLOCKED


@pytest.mark.slow
def test_the_base_stops_before_what_nobody_knows_of_and_reports_where_it_is(simulate):
    world = draw_world(load_scene("kitchen"), 1)
    part = PlacedShape(Box((0.3, 0.3, 0.5)), Pose(np.array([0.0, 0.0, 0.25])))
    place = world.robot_start @ Pose2D(1.1, 0.05, 0.0)
    model = FurnitureModel("crate", (0.3, 0.3), (part,), ((0.6, 0.5, 0.3, 1.0),), ())
    crate = PlacedFurniture("crate", model, place, place)
    simulated = simulate(1, replace(world, furniture=(*world.furniture, crate)), semantic_map(world))
    before = simulated.true_pose
    handle = simulated.wait(simulated.base.drive(1.5), limit=15.0)
    assert handle.failure.code is MotionErrorCode.BLOCKED
    assert "ahead" in handle.failure.text
    assert simulated.touched() == []
    assert simulated.true_pose.distance_to(before) > 0.5


@pytest.mark.slow
def test_a_base_whose_scans_do_not_fit_the_map_reports_that_it_is_lost(simulate):
    world = draw_world(load_scene("kitchen"), 1)
    elsewhere = SemanticMap(semantic_map(world).walls @ np.diag([0.7, 1.6, 0.7, 1.6]), {})
    simulated = simulate(1, world, elsewhere)
    handle = simulated.wait(simulated.base.drive(2.0), limit=15.0)
    assert handle.status is MotionStatus.FAILED
    assert handle.failure.code is MotionErrorCode.LOST


@pytest.mark.slow
def test_a_base_that_is_sent_on_again_and_again_finds_out_that_it_is_lost(simulate):
    world = draw_world(load_scene("kitchen"), 1)
    elsewhere = SemanticMap(semantic_map(world).walls @ np.diag([0.7, 1.6, 0.7, 1.6]), {})
    simulated = simulate(1, world, elsewhere)
    for _ in range(20):
        handle = simulated.base.drive(0.3)
        simulated.robot.clock.sleep(0.2)
        if handle.done:
            break
    assert handle.failure.code is MotionErrorCode.LOST


@pytest.mark.slow
def test_a_lost_base_does_not_drive_until_a_scan_fits_again(simulate):
    simulated = simulate(1)
    where, base = simulated.base.localisation, simulated.robot.part("base", MobileBase)
    # As if it had been carried off: what it believes is another place.
    known = where.estimate.pose
    elsewhere = Pose2D(known.x + 0.8, known.y - 0.5, known.theta + 1.2)
    where.estimate = where.localizer.start(elsewhere, base.odometry(), 0.002, 0.002)
    first = simulated.wait(simulated.base.drive(1.5), limit=15.0)
    assert first.failure.code is MotionErrorCode.LOST
    assert len(simulated.base.layer.points) == 0  # walls that stand elsewhere on the map are no obstacles
    simulated.robot.clock.sleep(1.0)
    before = simulated.true_pose
    again = simulated.wait(simulated.base.drive(0.5), limit=15.0)
    assert again.failure.code is MotionErrorCode.LOST
    assert simulated.true_pose.distance_to(before) < 1e-3
    where.estimate = where.localizer.start(before, base.odometry(), 0.02, 0.012)
    simulated.robot.clock.sleep(0.05)
    found = simulated.wait(simulated.base.drive(-0.2), limit=15.0)
    assert found.status is MotionStatus.SUCCEEDED, found.failure
