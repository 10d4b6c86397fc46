"""Followers brake for what is around, seen or moving, whatever they would choose."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestman_bt.messages import LaserScan, Path2D, Pose2D, Twist2D
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.local_planning.braking import JerkLimit, braking_time, safe_share
from bestman_bt.navigation.local_planning.critics import Critics, Surroundings
from bestman_bt.navigation.local_planning.obstacle_aware import ObstacleAwareFollower
from bestman_bt.navigation.localization.scan_to_map import cast_rays
from bestman_bt.robot_model.model import BaseModel
from bestman_bt.robot_model.part_config import MobilePart
from bestman_bt.world_model.semantic_map import SemanticMap
from tests.robot_models import base_model

DT, BEAMS = 0.025, 360
ANGLES = np.linspace(-math.pi, math.pi, BEAMS, endpoint=False)
HALL = np.array([(-6, -6, 6, -6), (6, -6, 6, 6), (6, 6, -6, 6), (-6, 6, -6, -6)], dtype=float)
POSE = Pose2D(0.5, -0.8, 2.0)
AHEAD = Twist2D(0.5)


class Straight(ObstacleAwareFollower):
    """Would always drive straight ahead."""

    def __init__(self) -> None:
        super().__init__()
        self.chosen = AHEAD
        self.moving: list = []

    def begin(self, limits: MobilePart, critics: Critics) -> None:
        return

    def restart(self) -> None:
        return

    def choose(self, pose: Pose2D, twist: Twist2D, around: Surroundings, dt: float) -> Twist2D:
        self.moving = around.moving
        return self.chosen


def disc(x: float, y: float, radius: float = 0.2) -> np.ndarray:
    """In the frame of the base."""
    turn = np.linspace(0.0, 2 * math.pi, 25)
    ring = POSE.apply(np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)]))
    return np.hstack([ring[:-1], ring[1:]])


def limits(footprint) -> BaseModel:
    return base_model(footprint.corners)


def first_command(footprint, places, velocity: Twist2D = AHEAD, chosen: Twist2D = AHEAD) -> Twist2D:
    """What is commanded at ``velocity`` after scans of a disc at ``places``, a tenth of a second apart."""
    follower = Straight()
    follower.chosen = chosen
    follower.configure(limits(footprint))
    goal = POSE @ Pose2D(4.0, 0.0, 0.0)
    follower.reset(Path2D(np.array([POSE.xy, goal.xy]), goal), Costmap.from_map(SemanticMap(HALL, {}), footprint))
    for number, place in enumerate(places):
        ranges, _ = cast_rays(np.vstack([HALL, disc(*place)]), POSE, ANGLES)
        ranges = np.where((ranges > 0.3) & (ranges < 8.0), ranges, np.inf)
        scan = LaserScan(ranges, -math.pi, 2 * math.pi / BEAMS, 0.3, 8.0, 0.1 * number)
        follower.observe(scan, POSE)
    return follower.compute(POSE, velocity, DT).twist


def crossing(x: float, last_y: float, speed: float) -> list[tuple[float, float]]:
    return [(x, last_y - speed * 0.1 * k) for k in range(14, -1, -1)]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_brakes_for_where_a_walker_will_be_in_a_moment(footprint, side):
    coming, gone = crossing(0.62, -0.62 * side, 0.8 * side), crossing(0.62, 0.62 * side, 0.8 * side)
    assert first_command(footprint, coming).vx < AHEAD.vx - 0.01
    assert first_command(footprint, gone).vx >= AHEAD.vx


@pytest.mark.parametrize(("gap", "brakes"), [(0.25, True), (0.36, False)])
def test_it_brakes_for_what_the_map_lacks_within_the_way_that_it_needs_to_stop(footprint, gap, brakes):
    # 0.1 s of reaction at 0.5 m/s and 0.5² / (2 · 0.6) m of braking, before 3 cm around the outline.
    seen = [(0.28 + 0.03 + gap + 0.2, 0.0)] * 4
    assert (first_command(footprint, seen).vx < AHEAD.vx - 1e-3) == brakes
    assert first_command(footprint, seen, Twist2D(-0.1), Twist2D(-0.1)).vx == pytest.approx(-0.1)


def test_a_base_that_drives_goes_on_from_its_speed_and_no_faster_than_its_limits(footprint):
    far = [(4.0, 3.0)] * 4
    for chosen in (0.6, 0.0):
        twist = first_command(footprint, far, Twist2D(0.4), Twist2D(chosen))
        assert 0.0 < abs(twist.vx - 0.4) <= 0.6 * DT + 1e-9
        assert (twist.vx > 0.4) == (chosen > 0.4)


@settings(deadline=None, derandomize=True)
@given(time=st.floats(0.0, 5.0), reaction=st.floats(0.01, 1.0), braking=st.floats(0.0, 5.0))
def test_at_the_safe_share_a_base_stops_just_before_what_is_in_its_way(time, reaction, braking):
    share = safe_share(time, reaction, braking)
    way = share * reaction + share**2 * braking / 2.0
    assert 0.0 <= share <= 1.0
    assert way <= time + 1e-6
    assert share == 1.0 or way >= time - 1e-5


def test_braking_takes_as_long_as_the_slower_of_driving_and_turning():
    assert braking_time(Twist2D(0.3, -0.4, 0.1), 0.5, 2.0) == pytest.approx(1.0)
    assert braking_time(Twist2D(-0.1, 0.0, -1.0), 0.5, 2.0) == pytest.approx(0.5)


def test_braking_for_safety_is_as_hard_as_the_acceleration_allows_and_jerk_counts_again_after_it(footprint):
    smooth = JerkLimit(limits(footprint).part)
    smooth.reset(Twist2D(0.5, 0.0, -1.0))
    first, second = smooth.brake(Twist2D(), DT), smooth.brake(Twist2D(), DT)
    assert [first.vx, first.wz] == pytest.approx([0.5 - 0.6 * DT, -1.0 + 2.0 * DT])
    assert [second.vx, second.wz] == pytest.approx([0.5 - 1.2 * DT, -1.0 + 4.0 * DT])
    onward = smooth.towards(Twist2D(0.5, 0.0, -1.0), DT)
    assert onward.vx == pytest.approx(second.vx - 0.6 * DT + 2.0 * DT * DT)
    for _ in range(60):
        smooth.brake(Twist2D(0.1), DT)
    assert smooth.twist == Twist2D(pytest.approx(0.1), 0.0, 0.0)
    smooth.reset(Twist2D(0.2))
    assert smooth.towards(Twist2D(0.2), DT) == Twist2D(0.2)


def test_a_new_path_begins_without_the_acceleration_of_the_one_before(footprint):
    smooth = JerkLimit(limits(footprint).part)
    for _ in range(10):
        smooth.towards(Twist2D(0.6, 0.0, -1.0), DT)
    smooth.reset(Twist2D(0.2))
    onward = smooth.towards(Twist2D(0.6, 0.0, 1.0), DT)
    assert [onward.vx, onward.wz] == pytest.approx([0.2 + 2.0 * DT * DT, 10.0 * DT * DT])
