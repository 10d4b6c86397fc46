"""Dynamic window and MPPI among things that the map lacks; the base lags, its lidar casts rays."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import LaserScan, Path2D, Pose2D, Twist2D, wrap_angle
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.navigation.local_planning.dwa import DWA
from bestman_bt.navigation.local_planning.footprint_check import FootprintMotion
from bestman_bt.navigation.local_planning.mppi import MPPI
from bestman_bt.navigation.localization.scan_to_map import cast_rays
from bestman_bt.world_model.semantic_map import SemanticMap
from tests.robot_models import base_model

DT, BEAMS = 0.025, 180
ANGLES = np.linspace(-math.pi, math.pi, BEAMS, endpoint=False)
START, GOAL = Pose2D(0.0, 0.0, 0.3), Pose2D(3.0 - 0.28 - 0.06, -0.9, 0.0)


def limits(footprint, sideways=False):
    return base_model(footprint.corners, max_vy=0.6 if sideways else 0.0)


def box(x, y, width, depth):
    return np.array(
        [
            (x, y, x + width, y),
            (x + width, y, x + width, y + depth),
            (x + width, y + depth, x, y + depth),
            (x, y + depth, x, y),
        ]
    )


def disc(x, y, radius):
    turn = np.linspace(0.0, 2 * math.pi, 13)
    ring = np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])
    return np.hstack([ring[:-1], ring[1:]])


def along(segments):
    return np.vstack([s[:2] + np.linspace(0.0, 1.0, 15)[:, None] * (s[2:] - s[:2]) for s in segments])


class Drive:
    """What came of following a path: the end, commands, and how near the base came to what the map does not know."""

    def __init__(self, follower, costmap, walls, start, goal, unknown=None, sideways=False, seconds=40.0):
        follower.configure(limits(costmap.footprint, sideways))
        path = GridAStar().plan(start, goal, costmap)
        follower.reset(path, costmap)
        outline, noise = FootprintMotion(costmap.footprint.corners, 0.0), np.random.default_rng(1)
        self.pose, velocity, self.commands, self.poses, self.nearest = start, np.zeros(3), [], [], math.inf
        self.done, self.path = False, path
        for tick in range(int(seconds / DT)):
            there = unknown(tick * DT) if unknown is not None else np.zeros((0, 4))
            if tick % 4 == 0:
                ranges, _ = cast_rays(np.vstack([walls, there]), self.pose, ANGLES)
                ranges = ranges + 0.01 * noise.standard_normal(BEAMS)
                ranges = np.where((ranges > 0.45) & (ranges < 8.0), ranges, np.inf)
                scan = LaserScan(ranges, -math.pi, 2 * math.pi / BEAMS, 0.45, 8.0, tick * DT)
                follower.observe(scan, self.pose)
            command = follower.compute(self.pose, Twist2D(*velocity), DT)
            if command.done:
                self.done = True
                break
            wanted = np.array([command.twist.vx, command.twist.vy, command.twist.wz])
            self.commands.append(wanted)
            velocity = velocity + 0.4 * (wanted - velocity)
            self.pose = self.pose @ Pose2D(*(velocity * DT))
            self.poses.append((self.pose.x, self.pose.y, self.pose.theta))
            if len(there):
                gap = outline.distance(self.pose.inverse().apply(along(there))).min()
                self.nearest = min(self.nearest, float(gap))
        self.commands = np.array(self.commands)


@pytest.mark.parametrize(
    ("planner", "sideways"), [(MPPI, False), pytest.param(DWA, True, marks=pytest.mark.slow)], ids=["mppi", "dwa-omni"]
)
def test_a_box_on_the_path_is_gone_around_and_the_end_is_as_exact_as_ever(planner, sideways, costmap, kitchen):
    obstacle = box(0.7, -0.1, 0.3, 0.3)
    drive = Drive(planner(), costmap, kitchen.walls, START, GOAL, lambda _: obstacle, sideways)
    assert drive.done
    assert drive.nearest > 0.0
    assert costmap.footprint_clearance(np.array(drive.poses)).min() > 0.0
    assert drive.pose.distance_to(GOAL) < 0.005
    assert abs(wrap_angle(drive.pose.theta - GOAL.theta)) < math.radians(0.5)
    assert np.abs(drive.commands).max(axis=0)[1] == 0.0 or sideways


@pytest.mark.slow
@pytest.mark.parametrize("planner", [pytest.param(MPPI, marks=pytest.mark.slow), DWA])
def test_an_arm_that_stands_out_keeps_clear_of_walls_where_the_base_goes_around_what_the_map_lacks(
    planner, footprint, kitchen
):
    beside = np.array([[x, y, z] for x in (0.0, 0.1) for y in (0.2, 0.4) for z in (0.9, 1.2)])
    costmap, obstacle = Costmap.from_map(kitchen, footprint.carrying([beside], 0.01)), box(0.7, -0.75, 0.3, 0.3)
    follower = planner()
    drive = Drive(follower, costmap, kitchen.walls, START, GOAL, lambda _: obstacle)
    assert drive.done
    assert drive.nearest > 0.0
    assert costmap.overhang_clearance(np.array(drive.poses)).min() > 0.0
    assert drive.pose.distance_to(GOAL) < 0.005


def test_commands_keep_to_the_limits_of_speed_and_acceleration(costmap, kitchen):
    drive = Drive(MPPI(), costmap, kitchen.walls, START, GOAL, seconds=8.0)
    assert np.abs(drive.commands[:, 0]).max() <= 0.6 + 1e-6
    assert np.abs(drive.commands[:, 2]).max() <= 1.2 + 1e-6
    change = np.abs(np.diff(drive.commands, axis=0)) / DT
    assert change[:, 0].max() <= 1.0 + 1e-6  # as pure pursuit brakes at the end
    assert change[:, 2].max() <= 2.0 + 1e-6


@pytest.mark.slow
def test_nobody_is_run_into_who_walks_across(footprint):
    walls = np.array([(-3, -3, 3, -3), (3, -3, 3, 3), (3, 3, -3, 3), (-3, 3, -3, -3)], dtype=float)
    hall = Costmap.from_map(SemanticMap(walls, {}), footprint)

    def walker(now):
        return disc(0.0, max(2.6 - 0.5 * max(0.0, now - 1.0), -2.5), 0.22)

    drive = Drive(MPPI(), hall, walls, Pose2D(-2.0, 0.0, 0.0), Pose2D(2.0, 0.0, 0.0), walker)
    assert drive.done
    assert drive.nearest > 0.05


def test_equal_calls_give_equal_drives(costmap, kitchen):
    drives = [Drive(MPPI(), costmap, kitchen.walls, START, GOAL, seconds=2.0) for _ in range(2)]
    assert np.array_equal(drives[0].commands, drives[1].commands)


def test_before_what_comes_suddenly_it_brakes_as_hard_as_it_can_at_once(costmap, footprint):
    """Whatever its jerk: 0.6 m/s² at the first command."""
    follower, path = DWA(), GridAStar().plan(START, GOAL, costmap)
    follower.configure(limits(footprint))
    follower.reset(path, costmap)
    wall = START @ Pose2D(0.55, 0.0, 0.0)
    across = (wall @ Pose2D(0.0, 0.3, 0.0)).xy, (wall @ Pose2D(0.0, -0.3, 0.0)).xy
    ranges, _ = cast_rays(np.array([np.concatenate(across)]), START, ANGLES)
    for stamp in (0.0, 0.1, 0.2, 0.3):
        follower.observe(LaserScan(ranges, -math.pi, 2 * math.pi / BEAMS, 0.1, 8.0, stamp), START)
    command = follower.compute(START, Twist2D(0.6), DT)
    assert command.twist.vx == pytest.approx(0.6 - 0.6 * DT)


def test_a_path_after_another_is_driven_as_if_it_was_the_first(costmap):
    ahead, back = (GridAStar().plan(START, goal, costmap) for goal in (GOAL, Pose2D(0.5, 1.5, math.pi / 2)))
    used, fresh = DWA(), DWA()
    for follower in (used, fresh):
        follower.configure(limits(costmap.footprint))
    used.reset(ahead, costmap)
    used.compute(START, Twist2D(), DT)
    for follower in (used, fresh):
        follower.reset(back, costmap)
    assert used.compute(START, Twist2D(), DT) == fresh.compute(START, Twist2D(), DT)


@pytest.mark.slow
def test_a_path_that_is_closed_off_makes_the_base_stand(costmap, kitchen):
    door = box(1.45, -0.05, 0.2, 1.05)
    drive = Drive(MPPI(), costmap, kitchen.walls, START, GOAL, lambda _: door, seconds=9.0)
    assert not drive.done
    assert drive.nearest > 0.0
    assert np.abs(drive.commands[-40:]).max() < 0.1


@pytest.mark.parametrize("planner", [DWA, MPPI])
def test_a_path_without_a_costmap_is_driven_as_it_is(planner, footprint):
    follower, pose = planner(), Pose2D()
    follower.configure(limits(footprint))
    follower.reset(Path2D([(0, 0), (-1.5, 0)], Pose2D(-1.5, 0.0, 0.0), reverse=[True]))
    for _ in range(400):
        command = follower.compute(pose, Twist2D(), DT)
        assert command.twist.vx <= 0.0
        pose = pose @ Pose2D(command.twist.vx * DT, 0.0, command.twist.wz * DT)
        if command.done:
            break
    assert pose.x == pytest.approx(-1.5, abs=0.01)


def test_a_follower_without_a_configured_base_raises_an_error(costmap):
    with pytest.raises(RuntimeError, match="configure"):
        DWA().reset(Path2D([(0, 0), (1, 0)], Pose2D(1.0, 0.0, 0.0)), costmap)
