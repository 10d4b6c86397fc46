"""How the dynamic window and MPPI choose among velocities, on fields that are made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.navigation.local_planning.cost_to_go import CostToGo, DistanceGrid, cost_to_go
from bestman_bt.navigation.local_planning.critics import Critics, CriticWeights, Drives, Surroundings
from bestman_bt.navigation.local_planning.dwa import DWA
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle
from bestman_bt.navigation.local_planning.mppi import MPPI
from bestman_bt.navigation.local_planning.rotate_to_heading import PathProgress
from bestman_bt.robot_model.model import BaseModel
from tests.robot_models import base_model

DT, SIZE, RESOLUTION = 0.025, 240, 0.025
CENTRES = (np.arange(SIZE) + 0.5) * RESOLUTION - 3.0
X, Y = np.meshgrid(CENTRES, CENTRES)
POSE = Pose2D(0.2, -0.3, 2.2)


def grid(values: np.ndarray) -> DistanceGrid:
    return DistanceGrid(np.asarray(values, dtype=np.float32), (-3.0, -3.0), RESOLUTION)


def limits(footprint, sideways: float = 0.0) -> BaseModel:
    return base_model(footprint.corners, max_vy=sideways)


def towards(place: np.ndarray, wall: np.ndarray | None = None, moving=()) -> Surroundings:
    """Free floor, but for points ``wall`` (N, 2); the nearer to ``place`` (2,) the better."""
    distance = np.full(X.shape, 10.0)
    for x, y in [] if wall is None else wall:
        distance = np.minimum(distance, np.hypot(X - x, Y - y))
    away = np.hypot(X - place[0], Y - place[1])
    return Surroundings(grid(distance), CostToGo(grid(away), grid(0.0 * X), place, 0, True), list(moving), 0.03)


@pytest.mark.parametrize("planner", [DWA, MPPI])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_drives_towards_a_place_ahead_and_turns_to_its_side(planner, side, footprint):
    follower = planner()
    follower.configure(limits(footprint))
    around, twist = towards(POSE.apply([1.5, 0.9 * side])), Twist2D(0.2)
    for _ in range(4):
        twist = follower.choose(POSE, twist, around, DT)
    assert twist.vx > 0.2
    assert math.copysign(1.0, twist.wz) == side
    assert abs(twist.wz) > 0.1
    assert twist.vy == 0.0


@pytest.mark.parametrize("planner", [DWA, MPPI])
def test_with_something_right_before_it_it_stands_and_with_a_walker_there_as_well(planner, footprint):
    place = POSE.apply([2.0, 0.0])
    wall = POSE.apply(np.column_stack([np.full(41, 0.28 + 0.06), np.linspace(-0.5, 0.5, 41)]))
    x, y = POSE.apply([0.28 + 0.04 + 0.2, 0.0])
    person = MovingObstacle(float(x), float(y), 0.0, 0.0, 0.2)
    for around in (towards(place, wall), towards(place, moving=[person])):
        follower = planner()
        follower.configure(limits(footprint))
        chosen = follower.choose(POSE, Twist2D(0.5), around, DT)
        assert chosen.vx <= 0.0


def test_a_velocity_that_cannot_be_stopped_in_time_is_not_admissible(footprint):
    """0.36 m before a wall, 0.6 m/s are too fast: 0.06 m of reaction and 0.3 m of braking."""
    follower = DWA(critics=CriticWeights(contact=0.0, goal_early=0.0, obstacle=0.0))
    follower.configure(limits(footprint))
    for gap, least, most in ((1.2, 0.59, 0.6), (0.30, 0.0, 0.55), (0.12, 0.0, 0.35)):
        wall = POSE.apply(np.column_stack([np.full(61, 0.28 + 0.05 + gap), np.linspace(-0.8, 0.8, 61)]))
        chosen = follower.choose(POSE, Twist2D(0.55), towards(POSE.apply([2.5, 0.0]), wall), DT)
        assert least <= chosen.vx <= most + 1e-6


def test_a_turn_that_has_changed_its_side_keeps_it_until_the_base_got_on(footprint):
    left, right = (towards(POSE.apply([0.3, 1.2 * side])) for side in (1.0, -1.0))

    def after(pose: Pose2D, dt: float, restarted: bool = False) -> float:
        follower = DWA()
        follower.configure(limits(footprint))
        assert follower.choose(POSE, Twist2D(), left, DT).wz > 0.05
        assert follower.choose(POSE, Twist2D(), right, DT).wz < -0.05
        if restarted:
            follower.restart()
        return follower.choose(pose, Twist2D(), left, dt).wz

    assert after(POSE, DT) <= 0.0
    assert after(POSE @ Pose2D(0.04, 0.0, 0.0), DT) <= 0.0
    assert after(POSE @ Pose2D(0.06, 0.0, 0.0), DT) > 0.0
    assert after(POSE @ Pose2D(0.0, 0.0, -0.21), DT) > 0.0
    assert after(POSE, 1.1) > 0.0
    assert after(POSE, DT, restarted=True) > 0.0


def test_a_base_that_can_goes_sideways_and_no_faster_than_in_its_window(footprint):
    follower = DWA()
    follower.configure(limits(footprint, 0.6))
    chosen = follower.choose(POSE, Twist2D(0.0, 0.1, 0.0), towards(POSE.apply([0.0, 1.5])), DT)
    assert chosen.vy == pytest.approx(0.1 + 0.6 * 0.3, abs=1e-6)
    assert math.hypot(chosen.vx, chosen.vy) <= 0.6 + 1e-6


def critics(footprint, **weights) -> Critics:
    names = (
        "goal",
        "goal_early",
        "path",
        "obstacle",
        "heading",
        "backwards",
        "sideways",
        "turning",
        "contact",
        "moving",
    )
    return Critics(CriticWeights(**({name: 0.0 for name in names} | weights)), footprint, True)


def drive(pose: Pose2D, twist: Twist2D, steps: int = 20, dt: float = 0.1) -> Drives:
    poses, at = [], pose
    for _ in range(steps):
        at = at @ Pose2D(twist.vx * dt, twist.vy * dt, twist.wz * dt)
        poses.append((at.x, at.y, at.theta))
    x, y, theta = np.array(poses, dtype=np.float32).T
    twists = tuple(np.full((1, 1), value, dtype=np.float32) for value in (twist.vx, twist.vy, twist.wz))
    return Drives(x[None], y[None], theta[None], twists, dt)


@pytest.mark.parametrize(
    ("weights", "twist", "cost"),
    [
        ({"backwards": 0.5}, Twist2D(-0.2), 0.5 * 0.4),
        ({"backwards": 0.5}, Twist2D(0.2), 0.0),
        ({"sideways": 0.5}, Twist2D(0.0, -0.2), 0.5 * 0.4),
        ({"turning": 0.5}, Twist2D(wz=-0.3), 0.5 * 0.6),
        ({"goal": 1.0}, Twist2D(0.25), 1.0),
        ({"goal_early": 1.0}, Twist2D(0.25), 1.5 - 0.25 * 1.1),
    ],
)
def test_each_critic_costs_what_it_says(weights, twist, cost, footprint):
    around = towards(POSE.apply([1.5, 0.0]))
    costs, first = critics(footprint, **weights).judge(drive(POSE, twist), around)
    assert costs[0] == pytest.approx(cost, abs=0.03)
    assert first.tolist() == [20]


def test_being_off_the_way_ahead_costs_by_the_angle_on_either_side_and_nothing_at_the_carrot(footprint):
    judge = critics(footprint, heading=1.0).judge
    for bearing in (0.0, 0.8, -0.8, 3.0):
        carrot = POSE.apply([math.cos(bearing), math.sin(bearing)])
        costs, _ = judge(drive(POSE, Twist2D()), towards(carrot))
        assert costs[0] == pytest.approx(abs(bearing), abs=1e-3)
    assert judge(drive(POSE, Twist2D()), towards(POSE.xy))[0][0] == pytest.approx(0.0, abs=1e-6)


def test_a_walker_is_met_where_it_will_be_and_no_further_ahead_than_it_can_be_foreseen(footprint):
    judge = critics(footprint, contact=1.0).judge

    def met(x: float, y: float, vx: float, vy: float, twist: Twist2D = Twist2D(0.5)) -> int:  # noqa: B008
        (px, py), (wx, wy) = POSE.apply([x, y]), POSE.apply([vx, vy]) - POSE.xy
        walker = MovingObstacle(float(px), float(py), float(wx), float(wy), 0.2)
        return int(judge(drive(POSE, twist), towards(POSE.xy, moving=[walker]))[1][0])

    assert met(1.0, -0.8, 0.0, 0.8) < 12  # it comes into the way
    assert met(1.0, 0.8, 0.0, 0.8) == 20
    assert met(1.0, 0.0, 0.6, 0.0) == 20  # it walks ahead, faster
    assert met(1.4, 0.0, 0.0, 0.0) == 20  # 0.92 m away: farther than 1.2 s at 0.5 m/s
    assert met(0.98, 0.0, 0.0, 0.0) == 8  # within 8 cm of it after 0.42 m
    for side in (1.0, -1.0):  # beside it, within the circle around its corners
        assert met(0.1, side * (0.26 + 0.2 + 0.07), 0.0, 0.0, Twist2D()) == 0
        assert met(0.1, side * (0.26 + 0.2 + 0.09), 0.0, 0.0, Twist2D()) == 20


def test_coming_near_a_walker_costs_the_more_the_nearer(footprint):
    judge = critics(footprint, moving=1.0).judge
    costs = []
    for gap in (0.1, 0.3, 0.6):
        x, y = POSE.apply([math.hypot(0.28, 0.26) + 0.2 + gap, 0.0])
        walker = MovingObstacle(float(x), float(y), 0.0, 0.0, 0.2)
        costs.append(float(judge(drive(POSE, Twist2D()), towards(POSE.xy, moving=[walker]))[0][0]))
    assert costs == pytest.approx([0.8, 0.4, 0.0], abs=0.02)


def test_a_grid_is_read_by_x_and_y_and_beyond_its_edge_as_at_it():
    values = grid(100.0 * Y + X)
    x, y = np.array([1.0125, 9.0, -9.0], np.float32), np.array([-0.4875, 0.0125, 9.0], np.float32)
    assert values.at(x, y) == pytest.approx(
        [100 * -0.4875 + 1.0125, 100 * 0.0125 + CENTRES[-1], 100 * CENTRES[-1] + CENTRES[0]], abs=0.02
    )


def field(wall_x: float | None, opening: float, clearances=(0.31, 0.27)) -> CostToGo:
    """Down a path along x at y = -0.5, through a wall at ``wall_x`` with a gap above it."""
    distance = np.full(X.shape, 10.0)
    if wall_x is not None:
        closed = (np.abs(X - wall_x) < 0.02) & ~(np.abs(Y - 0.5 - opening / 2) < opening / 2)
        points = np.column_stack([X[closed], Y[closed]])
        for x, y in points[::2]:
            distance = np.minimum(distance, np.hypot(X - x, Y - y))
    path = np.column_stack([np.linspace(-1.5, 2.0, 71), np.full(71, -0.5)])
    left = 2.0 - path[:, 0]
    return cost_to_go(grid(distance), clearances, path, left, path[0], 0.7)


def test_where_nothing_stands_the_field_is_what_is_left_of_the_path_and_the_carrot_lies_ahead():
    free = field(None, 0.0)
    assert free.reachable
    at = free.field.at(np.array([-1.5, 0.0, 1.5], np.float32), np.full(3, -0.5, np.float32))
    assert at == pytest.approx([3.5, 2.0, 0.5], abs=0.2)
    assert free.carrot[0] == pytest.approx(-0.8, abs=0.12)
    assert free.beside.at(np.array([0.0], np.float32), np.array([0.6], np.float32))[0] == pytest.approx(1.1, abs=0.1)


def test_around_a_wall_the_field_leads_through_its_gap_by_the_lesser_clearance_if_need_be():
    for opening, reachable in ((1.0, True), (0.7, True), (0.4, False)):
        around = field(0.5, opening)
        assert around.reachable == reachable
        if reachable:
            here = around.field.at(np.array([-1.5], np.float32), np.array([-0.5], np.float32))[0]
            assert 3.8 < here < 6.0


def test_progress_along_a_path_does_not_jump_to_a_later_strand_close_by():
    path = PathProgress(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 0.1], [0.0, 0.1]]))
    for x in np.arange(0.0, 0.9, 0.05):
        path.advance(np.array([x, 0.06]))
    assert path.remaining == pytest.approx(6.1 - 0.85, abs=0.03)
    assert path.beside(np.array([0.85, 0.4])) == pytest.approx(0.4, abs=0.01)
    ahead, left = path.ahead
    assert left[0] == path.remaining
    assert ahead[0] == pytest.approx([0.85, 0.0], abs=0.03)


def test_the_last_metres_of_a_path_begin_so_far_before_its_end_with_the_corners_after_that():
    path = PathProgress(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0]]))
    assert path.last(1.5).tolist() == [pytest.approx([2.5, 0.0], abs=0.06), [3.0, 0.0], [3.0, 1.0]]
    assert path.last(0.5).tolist() == [pytest.approx([3.0, 0.5], abs=0.03), [3.0, 1.0]]
