from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Path2D, Pose2D, Twist2D, wrap_angle
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.navigation.local_planning.pure_pursuit import PurePursuit
from bestman_bt.navigation.local_planning.rotate_to_heading import RotateToHeading

DT = 0.025


def drive(path, start, follower=None, lag=0.05, limit=60.0, at=math.inf, then=None):
    """A unicycle whose wheels answer with a lag: all poses (N, 3) and commands (N, 2), to the end of the path.

    After ``at`` seconds it is given another path, that ``then`` makes of its pose.
    """
    follower = follower or PurePursuit()
    follower.reset(path)
    pose, v, w = start, 0.0, 0.0
    poses, commands = [], []
    for tick in range(int(limit / DT)):
        if tick * DT == at:
            follower.reset(then(pose))
        command = follower.compute(pose, Twist2D(v, 0.0, w), DT)
        if command.done:
            return np.array(poses), np.array(commands), pose
        for _ in range(6):
            h = DT / 6
            v += (command.twist.vx - v) * h / lag
            w += (command.twist.wz - w) * h / lag
            pose = pose @ Pose2D(v * h, 0.0, w * h)
        poses.append((pose.x, pose.y, pose.theta))
        commands.append((command.twist.vx, command.twist.wz))
    pytest.fail(f"the end was not reached in {limit} s; the base is at {pose}")


def test_a_planned_path_ends_within_a_centimetre_of_the_stand_pose_and_touches_nothing(costmap):
    start, goal = Pose2D(0.0, 0.0, 0.3), Pose2D(3.0 - 0.28 - 0.06, -0.9, 0.0)
    poses, _, end = drive(GridAStar().plan(start, goal, costmap), start)
    assert end.distance_to(goal) < 0.01
    assert abs(wrap_angle(end.theta - goal.theta)) < math.radians(0.5)
    assert costmap.footprint_clearance(poses).min() > 0.0


def test_a_reverse_segment_is_driven_backwards_without_turning():
    path = Path2D([(0, 0), (-0.5, 0)], Pose2D(-0.5, 0.0, 0.0), reverse=[True])
    poses, commands, end = drive(path, Pose2D())
    assert commands[:, 0].max() <= 0.0
    assert np.abs(poses[:, 2]).max() < 0.01
    assert end.x == pytest.approx(-0.5, abs=0.01)


def test_the_base_turns_on_the_spot_at_a_sharp_corner():
    path = Path2D([(0, 0), (1, 0), (1, 1)], Pose2D(1.0, 1.0, math.pi / 2))
    poses, _, _ = drive(path, Pose2D())
    segment = np.clip(poses[:, 1], 0.0, None)
    beside = np.where(poses[:, 0] < 0.98, np.abs(poses[:, 1]), np.where(segment > 0.02, np.abs(poses[:, 0] - 1.0), 0.0))
    assert beside.max() < 0.02


def test_a_gentle_bend_is_driven_without_stopping():
    path = Path2D([(0, 0), (1, 0), (2, 0.4)], Pose2D(2.0, 0.4, 0.38))
    poses, commands, _ = drive(path, Pose2D())
    around_bend = (poses[:, 0] > 0.6) & (poses[:, 0] < 1.4)
    assert commands[around_bend, 0].min() > 0.3


@pytest.mark.parametrize("side", [0.0, 0.15, -0.15])
def test_a_moving_base_goes_over_to_another_path_without_slowing_down(side):
    path = Path2D([(0, 0), (4, 0)], Pose2D(4.0, 0.0, 0.0))

    def another(pose):
        return Path2D([pose.xy, (pose.x + 1.0, pose.y + side), (4, side)], Pose2D(4.0, side, 0.0))

    _, commands, end = drive(path, Pose2D(), at=2.5, then=another)
    before, after = commands[99, 0], commands[100:140, 0]
    assert before > 0.55
    assert after.min() > 0.9 * before
    assert end.distance_to(Pose2D(4.0, side, 0.0)) < 0.02


def test_a_moving_base_stops_for_a_path_that_leads_back():
    path = Path2D([(0, 0), (4, 0)], Pose2D(4.0, 0.0, 0.0))
    home = Pose2D(0.0, 0.0, math.pi)
    poses, commands, end = drive(path, Pose2D(), at=2.5, then=lambda pose: Path2D([pose.xy, (0, 0)], home))
    assert commands[100, 0] > 0.5
    assert np.abs(np.diff(commands[98:], axis=0))[:, 0].max() / DT <= 1.0 + 1e-9
    assert poses[:, 0].max() < poses[99, 0] + 0.3  # from 0.6 m/s, at 0.7 m/s² and with the lag of the wheels
    assert end.distance_to(home) < 0.02


def test_speeds_and_accelerations_stay_within_the_limits(costmap):
    p = PurePursuit(max_speed=0.4, max_turn_rate=0.8)
    path = Path2D([(0, 0), (1, 0), (1.5, 0.8), (0.5, 1.5)], Pose2D(0.5, 1.5, 0.0))
    _, commands, _ = drive(path, Pose2D(), p)
    assert np.abs(commands[:, 0]).max() <= 0.4
    assert np.abs(commands[:, 1]).max() <= max(0.8, p.turning.max_speed)
    assert np.abs(np.diff(commands[:, 0])).max() / DT <= 2 * p.acceleration + 1e-9
    assert np.abs(np.diff(commands[:, 1])).max() / DT <= p.turn_acceleration + 1e-9


def test_an_offset_from_the_path_is_driven_out():
    path = Path2D([(0, 0), (2, 0)], Pose2D(2.0, 0.0, 0.0))
    _, _, end = drive(path, Pose2D(0.0, 0.15, 0.2))
    assert abs(end.y) < 0.01


@pytest.mark.parametrize("theta", [0.5, -2.0, 3.1, math.pi])
def test_a_path_of_one_point_is_a_turn_on_the_spot(theta):
    poses, _, end = drive(Path2D([(0, 0)], Pose2D(0.0, 0.0, theta)), Pose2D())
    assert abs(wrap_angle(end.theta - theta)) < math.radians(0.5)
    assert np.abs(poses[:, :2]).max() < 1e-6


def test_a_turn_ends_even_where_friction_holds_slow_wheels():
    follower, pose = RotateToHeading(), Pose2D()
    follower.turn_to(1.0)
    for _ in range(200):
        command = follower.compute(pose, Twist2D(), DT)
        if command.done:
            break
        moves = abs(command.twist.wz) > 0.04
        pose = pose @ Pose2D(0.0, 0.0, command.twist.wz * DT if moves else 0.0)
    assert command.done
    assert abs(pose.theta - 1.0) < math.radians(0.5)


def test_a_path_without_points_is_refused():
    with pytest.raises(ValueError, match="at least one point"):
        PurePursuit().reset(Path2D(np.zeros((0, 2)), Pose2D()))


@pytest.mark.parametrize(("apart", "aside"), [(0.1, 0.07), (0.5, 0.4)])
def test_progress_does_not_jump_to_a_later_strand_close_by(apart, aside):
    radius = apart / 2
    bend = [  # without a sharp corner: one leg
        (2 + radius * math.sin(a), radius - radius * math.cos(a)) for a in np.arange(1, 7) * math.pi / 7
    ]
    path = Path2D([(0.0, 0.0), (2.0, 0.0), *bend, (2.0, apart), (0.0, apart)], Pose2D(0.0, apart, math.pi))
    follower = PurePursuit()
    follower.reset(path)
    for x in np.arange(0.0, 1.2, 0.1):
        command = follower.compute(Pose2D(float(x), aside, 0.0), Twist2D(0.4), DT)
    assert command.remaining == pytest.approx(path.length - 1.1, abs=0.05)
    assert command.twist.vx > 0.0


@pytest.mark.parametrize("heading", [0.0, 2.5])
@pytest.mark.parametrize(
    ("reverse", "speed", "goes_on"),
    [(False, 0.3, True), (False, -0.3, False), (True, -0.3, True), (True, 0.3, False), (False, 0.01, False)],
)
def test_a_base_goes_on_at_its_speed_only_where_it_drives_along_the_path(heading, reverse, speed, goes_on):
    pose = Pose2D(1.0, -2.0, heading)
    end = pose @ Pose2D(-2.0 if reverse else 2.0, 0.0, 0.0)
    for turned, may in ((0.5, True), (0.7, False)):
        follower = PurePursuit()
        for _ in range(2):  # also the second path that it is given
            follower.reset(Path2D([pose.xy, end.xy], end, reverse=[reverse]))
            command = follower.compute(pose @ Pose2D(0.0, 0.0, turned), Twist2D(speed), DT)
            if goes_on and may:
                assert command.twist.vx == pytest.approx(speed, abs=0.02)
            else:
                onward = math.copysign(command.twist.vx, command.twist.vx * speed)  # it brakes, it does not turn round
                assert 0.0 <= onward <= max(0.02, abs(speed) - 2 * follower.deceleration * DT + 1e-9)


def test_a_base_that_is_faster_than_it_may_goes_on_at_its_limit():
    follower = PurePursuit(max_speed=0.4)
    follower.reset(Path2D([(0, 0), (3, 0)], Pose2D(3.0, 0.0, 0.0)))
    assert follower.compute(Pose2D(), Twist2D(0.9), DT).twist.vx == pytest.approx(0.4)


@pytest.mark.parametrize("reverse", [False, True])
def test_it_slows_down_in_time_and_does_not_overrun_its_end(reverse):
    start = Pose2D(0.5, 0.3, -2.3)
    end = start @ Pose2D(-1.5 if reverse else 1.5, 0.0, 0.0)
    poses, commands, last = drive(Path2D([start.xy, end.xy], end, reverse=[reverse]), start)
    along = np.array([(start.inverse() @ Pose2D(*pose)).x for pose in poses]) * (-1.0 if reverse else 1.0)
    assert along.max() < 1.505
    left, speed = 1.5 - along, np.abs(commands[:, 0])
    braking = (left > 0.05) & (left < 0.45) & (np.arange(len(left)) > 60)
    assert np.all(speed[braking] ** 2 <= 2.0 * 0.35 * (left[braking] + 0.05))
    assert last.distance_to(end) < 0.006


def test_the_remaining_way_counts_all_legs_and_a_bend_is_driven_within_its_lateral_acceleration():
    corners = [(0.0, 0.0), (1.5, 0.0), (1.5, 1.0), (0.0, 1.0)]
    follower = PurePursuit()
    follower.reset(Path2D(corners, Pose2D(0.0, 1.0, 0.0)))
    assert follower.compute(Pose2D(), Twist2D(), DT).remaining == pytest.approx(4.0)
    around = 0.5 * np.column_stack([np.sin(np.linspace(0, 3, 40)), 1.0 - np.cos(np.linspace(0, 3, 40))])
    bend = Path2D(around, Pose2D(*around[-1].tolist(), 3.0))
    _, commands, _ = drive(bend, Pose2D(), PurePursuit(lateral_acceleration=0.1))
    on_bend = commands[40:-60]
    assert np.abs(on_bend[:, 0] * on_bend[:, 1]).max() < 0.14


def test_a_compute_before_a_path_is_an_error():
    for follower in (PurePursuit(), RotateToHeading()):
        with pytest.raises(RuntimeError, match="before reset"):
            follower.compute(Pose2D(), Twist2D(), DT)
