"""The monitor alone: scans of points, commands, and a base that does what it is let."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

from bestman_bt.control.wheeled.collision_monitor import CollisionMonitor, MonitorAction
from bestman_bt.control.wheeled.velocity_gate import VelocityGate
from bestman_bt.messages import LaserScan, Pose2D, Twist2D
from bestman_bt.navigation.global_planning.footprint import Footprint, Overhang
from bestman_bt.navigation.local_planning.footprint_check import FootprintMotion
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle
from hal.api import Bumper, BumperReading, BumperZone
from tests.robot_models import base_model

CORNERS = ((0.28, -0.26), (0.28, 0.26), (-0.28, 0.26), (-0.28, -0.26))
BASE = base_model(CORNERS, max_vy=0.6)
OUTLINE = FootprintMotion(np.array(CORNERS), 0.0)
DT, BEAMS = 0.025, 360
MIDDLE = Pose2D()


class PressedBumper(Bumper):
    """One strip at the front."""

    def __init__(self, pressed: bool) -> None:
        super().__init__("bumper")
        self.pressed = pressed

    @property
    def zones(self) -> tuple[BumperZone, ...]:
        return (BumperZone((0.28, -0.2), (0.28, 0.2)),)

    def read(self) -> BumperReading:
        return BumperReading((0,) if self.pressed else (), 0.0)


def scan_of(points: np.ndarray, pose: Pose2D, stamp: float, noise: np.random.Generator | None = None) -> LaserScan:
    """What a lidar in the middle of the base sees of points; nothing within 45 cm."""
    own = pose.inverse().apply(points)
    beam = np.round((np.arctan2(own[:, 1], own[:, 0]) + math.pi) / (2 * math.pi) * BEAMS).astype(int) % BEAMS
    ranges = np.full(BEAMS, np.inf)
    np.minimum.at(ranges, beam, np.hypot(own[:, 0], own[:, 1]))
    if noise is not None:
        ranges = ranges + 0.01 * noise.standard_normal(BEAMS)
    ranges = np.where(ranges >= 0.45, ranges, np.inf)
    return LaserScan(ranges, -math.pi, 2 * math.pi / BEAMS, 0.45, 8.0, stamp)


def drive(monitor, wanted: Twist2D, points, seconds: float = 6.0, noise=None, are_tall=None, dead_band: float = 0.0):
    """A base whose wheels keep to its acceleration: poses, speeds, the actions taken and the texts.

    ``dead_band``: commands below it, m/s and rad/s, turn no wheel.
    """
    limits = monitor.base.part
    acceleration = np.array([limits.max_acceleration, limits.max_acceleration, limits.max_angular_acceleration])
    pose, velocity, poses, actions, texts = Pose2D(), np.zeros(3), [], [], []
    for tick in range(int(seconds / DT)):
        if tick % 4 == 0:
            monitor.observe(scan_of(points, pose, tick * DT, noise), Pose2D(), pose)
        command = monitor.limit(wanted, Twist2D(*velocity), pose, are_tall=are_tall)
        told = np.array([command.twist.vx, command.twist.vy, command.twist.wz])
        target = np.zeros(3) if command.brake or np.abs(told).max() < dead_band else told
        change = acceleration * (2.0 if command.brake else 1.0) * DT
        velocity = velocity + np.clip(target - velocity, -change, change)
        pose = pose @ Pose2D(*(velocity * DT))
        poses.append(pose)
        actions.append(command.action)
        texts.append(command.text)
    return poses, velocity, actions, texts


def clearance(poses, points) -> float:
    return min(float(OUTLINE.distance(pose.inverse().apply(points)).min()) for pose in poses)


def wall_ahead(x: float) -> np.ndarray:
    return np.column_stack([np.full(161, x), np.linspace(-0.8, 0.8, 161)])


@pytest.mark.parametrize(
    "twist",
    [
        Twist2D(0.6),
        Twist2D(0.2),
        Twist2D(-0.6),
        Twist2D(0.4, 0.0, 0.5),
        Twist2D(0.0, 0.5, 0.0),
        Twist2D(0.3, -0.3, 0.2),
    ],
    ids=str,
)
def test_whatever_is_commanded_the_base_stops_before_a_ring_of_posts(twist):
    turn = np.arange(0.0, 2 * math.pi, math.radians(9))
    posts = 1.1 * np.column_stack([np.cos(turn), np.sin(turn)])
    poses, velocity, _, texts = drive(CollisionMonitor(BASE), twist, posts)
    assert clearance(poses, posts) > 0.0
    assert np.abs(velocity[:2]).max() < 0.01
    assert texts[-1]
    unmonitored = CollisionMonitor(BASE, enabled=False)
    assert clearance(drive(unmonitored, twist, posts)[0], posts) < -0.1


@pytest.mark.parametrize("twist", [Twist2D(0.6), Twist2D(0.0, 0.0, 1.0)], ids=str)
def test_an_arm_that_stands_out_is_kept_from_what_is_tall_and_passes_over_what_is_not(twist):
    """Half a metre ahead of the base, above what the lidar sees."""
    arm = np.array([(-0.28, -0.22), (0.28, -0.22), (0.8, -0.1), (0.8, 0.1), (0.28, 0.22), (-0.28, 0.22)])
    outline = FootprintMotion(arm, 0.0)
    wall = np.column_stack([np.full(200, 1.1), np.linspace(-2.0, 2.0, 200)])
    posts = np.array([[0.5, 0.5], [0.0, 0.75], [-0.6, 0.5]]) if twist.vx == 0.0 else wall
    for tall in (True, False):
        monitor = CollisionMonitor(BASE)
        monitor.use_footprint(Footprint(np.array(CORNERS), overhang=Overhang(arm, 0.9, 0.52)))
        poses, *_ = drive(monitor, twist, posts, are_tall=lambda points, tall=tall: np.full(len(points), tall))
        nearest = min(outline.distance(pose.inverse().apply(posts)).min() for pose in poses)
        assert bool(nearest > 0.0) is tall
        assert clearance(poses, posts) > 0.0


def arm_at_a_wall(side: int) -> tuple[np.ndarray, np.ndarray]:
    """The outline (N, 2) of an arm ahead of a base, and a wall (M, 2) 2 mm beside its tip."""
    arm = np.array([(-0.28, -0.22), (0.28, -0.22), (0.98, -0.05), (0.98, 0.05), (0.28, 0.22), (-0.28, 0.22)])
    turned = Pose2D(theta=side * math.radians(65.0))
    away = side * (np.abs(turned.apply(arm)[:, 1]).max() + 0.002)
    return arm, turned.inverse().apply(np.column_stack([np.linspace(-1.5, 1.5, 301), np.full(301, away)]))


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("acceleration", "dead_band"), [(0.6, 0.0), (0.6, 0.035), (0.09, 0.0), (0.09, 0.035)])
def test_an_arm_does_not_swing_into_a_wall_while_the_base_begins_to_back_away_from_it(side, acceleration, dead_band):
    """The base turns faster sooner than it drives faster; again and again from rest, it would creep to the wall."""
    arm, wall = arm_at_a_wall(side)
    outline = FootprintMotion(arm, 0.0)
    part = dataclasses.replace(BASE.part, max_acceleration=acceleration)
    monitor = CollisionMonitor(dataclasses.replace(BASE, part=part))
    monitor.use_footprint(Footprint(np.array(CORNERS), overhang=Overhang(arm, 0.9, 0.7)))
    away, seconds = Twist2D(-0.6, 0.0, side * 0.34), 0.6 / acceleration + 0.5
    poses, velocity, actions, _ = drive(
        monitor, away, wall, seconds, are_tall=lambda points: np.full(len(points), True), dead_band=dead_band
    )
    assert min(outline.distance(pose.inverse().apply(wall)).min() for pose in poses) > 0.001
    assert velocity[0] < -0.3
    assert MonitorAction.STOP not in actions


def test_the_speed_that_a_base_had_in_one_drive_is_not_expected_at_the_start_of_the_next():
    """An arm ahead of it would swing into the wall while the base gathers that speed again."""
    arm, wall = arm_at_a_wall(1)
    footprint = Footprint(np.array(CORNERS), overhang=Overhang(arm, 0.9, 0.7))
    monitor, away, stamps = CollisionMonitor(BASE), Twist2D(-0.6, 0.0, 0.34), itertools.count()

    def command_from_rest(pose: Pose2D) -> Twist2D:
        monitor.observe(scan_of(wall, pose, float(next(stamps))), Pose2D(), pose)
        return monitor.limit(away, Twist2D(), pose, are_tall=lambda points: np.full(len(points), True)).twist

    monitor.use_footprint(footprint)
    first = command_from_rest(Pose2D())
    assert 0.0 < -first.vx <= 0.6 * DT
    far = [command_from_rest(Pose2D(20.0)) for _ in range(60)]
    assert far == [away] * 60
    assert -command_from_rest(Pose2D()).vx > 0.5  # it should drive by now
    monitor.use_footprint(footprint)  # as each drive does
    assert command_from_rest(Pose2D()) == first


def test_a_noisy_wall_is_approached_to_a_finger_and_not_touched():
    wall = wall_ahead(1.5)
    poses, _, actions, _ = drive(CollisionMonitor(BASE), Twist2D(0.5), wall, noise=np.random.default_rng(1))
    assert 0.005 < clearance(poses, wall) < 0.05
    assert MonitorAction.APPROACH in actions


def test_a_slow_approach_to_six_centimetres_goes_through_as_it_is():
    """As pure pursuit does it: the speed falls with the root of the distance that is left."""
    wall, noise = wall_ahead(1.2), np.random.default_rng(2)
    monitor, pose, speed = CollisionMonitor(BASE), Pose2D(), 0.0
    goal = 1.2 - 0.28 - 0.06
    for tick in range(400):
        if tick % 4 == 0:
            monitor.observe(scan_of(wall, pose, tick * DT, noise), Pose2D(), pose)
        left = goal - pose.x
        wanted = min(0.6, max(0.015, math.sqrt(0.7 * left))) if left > 0.003 else 0.0
        speed += min(max(wanted - speed, -0.7 * DT), 0.5 * DT)
        command = monitor.limit(Twist2D(speed), Twist2D(speed), pose)
        assert command.action is MonitorAction.NONE, command
        pose = pose @ Pose2D(speed * DT, 0.0, 0.0)
    assert abs(pose.x - goal) < 0.004


def test_what_is_too_close_to_be_seen_is_remembered_until_it_would_be_seen_again():
    wall = wall_ahead(1.0)
    monitor = CollisionMonitor(BASE)
    poses, _, _, _ = drive(monitor, Twist2D(0.3), wall, seconds=8.0)
    assert 0.45 > 1.0 - poses[-1].x > 0.28  # blind, and standing
    pose = poses[-1]
    nothing = np.zeros((0, 2))
    monitor.observe(scan_of(nothing, pose, 9.0), Pose2D(), pose)
    assert monitor.limit(Twist2D(0.3), Twist2D(), pose).action is MonitorAction.STOP
    back = pose @ Pose2D(-0.4, 0.0, 0.0)
    monitor.observe(scan_of(nothing, back, 10.0), Pose2D(), back)
    assert monitor.limit(Twist2D(0.3), Twist2D(), back).action is MonitorAction.NONE


class RecordingBase:
    """Remembers what its wheels are told."""

    model = BASE

    def set_velocity(self, vx: float, vy: float, wz: float) -> None:
        self.told = Twist2D(vx, vy, wz)


@pytest.mark.parametrize(
    ("person", "lowest", "most"),
    [(MovingObstacle(0.6, 0.0, 0.0, 0.0, 0.15), 0.1, 0.2), (MovingObstacle(0.6, 1.5, 0.0, 0.0, 0.15), 0.25, 0.25)],
)
def test_an_arm_that_stands_out_is_kept_from_people_and_passes_over_what_else_stands_there(person, lowest, most):
    arm = np.array([[x, y, z] for x in (0.2, 0.4) for y in (-0.1, 0.1) for z in (0.9, 1.1)])
    base = RecordingBase()
    gate = VelocityGate(base, CollisionMonitor(BASE))
    gate.use_footprint(Footprint(np.array(CORNERS)).carrying([arm], 0.0))
    legs = np.column_stack([np.full(41, 0.46), np.linspace(-0.1, 0.1, 41)])
    pose = Pose2D(2.0, 1.0, 0.5)
    gate.observe(scan_of(legs, Pose2D(), 0.0), Pose2D(), Pose2D())
    x, y = pose.apply(np.array([[person.x, person.y]]))[0]
    tall = [dataclasses.replace(person, x=x, y=y)]
    gate.command(Twist2D(0.25), None, Twist2D(), pose, Pose2D(), (), tall, DT)
    assert lowest <= base.told.vx <= most


def test_moving_away_from_what_is_close_is_free_and_towards_it_is_not():
    wall = wall_ahead(0.5)
    monitor = CollisionMonitor(BASE, margin=0.25)
    monitor.observe(scan_of(wall, Pose2D(), 0.0), Pose2D(), Pose2D())
    assert monitor.limit(Twist2D(-0.4), Twist2D(), Pose2D()).twist == Twist2D(-0.4)
    ahead = monitor.limit(Twist2D(0.1), Twist2D(), Pose2D())
    assert ahead.twist == Twist2D()
    assert "ahead" in ahead.text


def test_somebody_who_steps_in_the_way_makes_a_driving_base_brake_at_once():
    monitor = CollisionMonitor(BASE)
    monitor.observe(scan_of(wall_ahead(5.0), Pose2D(), 0.0), Pose2D(), Pose2D())
    assert monitor.limit(Twist2D(0.6), Twist2D(0.6), Pose2D()).action is MonitorAction.NONE
    legs = np.array([[0.48, 0.1], [0.48, 0.12], [0.48, -0.05]])
    monitor.observe(scan_of(legs, Pose2D(), 0.1), Pose2D(), Pose2D())
    command = monitor.limit(Twist2D(0.6), Twist2D(0.6), Pose2D())
    assert command.brake
    assert command.action is MonitorAction.STOP


def test_the_slowdown_zone_limits_the_speed_of_a_base_that_comes_close():
    monitor = CollisionMonitor(BASE, slowdown_margin=0.3, slowdown_time=1.0, slowdown_speed=0.2)
    monitor.observe(scan_of(wall_ahead(1.1), Pose2D(), 0.0), Pose2D(), Pose2D())
    command = monitor.limit(Twist2D(0.55, 0.0, 0.1), Twist2D(), Pose2D())
    assert command.action is MonitorAction.SLOWDOWN
    assert command.twist.vx == pytest.approx(0.2)
    assert monitor.limit(Twist2D(-0.55), Twist2D(), Pose2D()).action is MonitorAction.NONE


def test_a_pressed_bumper_stops_the_base_and_lets_it_back_away():
    bumper = PressedBumper(True)
    monitor = CollisionMonitor(BASE, [bumper])
    monitor.observe(scan_of(wall_ahead(3.0), Pose2D(), 0.0), Pose2D(), Pose2D())
    command = monitor.limit(Twist2D(0.3), Twist2D(), Pose2D())
    assert command.action is MonitorAction.BUMPED
    assert "bumper" in command.text
    assert monitor.limit(Twist2D(-0.3), Twist2D(), Pose2D()).twist == Twist2D(-0.3)
    bumper.pressed = False
    assert monitor.limit(Twist2D(0.3), Twist2D(), Pose2D()).action is MonitorAction.STOP  # it is still there


def test_a_lidar_that_reports_the_same_scan_for_ever_stops_the_base():
    monitor = CollisionMonitor(BASE)
    scan = scan_of(wall_ahead(3.0), Pose2D(), 0.0)
    for _ in range(5):
        monitor.observe(scan, Pose2D(), Pose2D())
    assert monitor.limit(Twist2D(0.3), Twist2D(0.3), Pose2D()).action is MonitorAction.NONE
    monitor.observe(scan, Pose2D(), Pose2D())
    frozen = monitor.limit(Twist2D(0.3), Twist2D(0.3), Pose2D())
    assert frozen.brake
    assert "lidar" in frozen.text


def test_scans_that_are_new_in_between_are_no_frozen_lidar():
    monitor, wall = CollisionMonitor(BASE), wall_ahead(3.0)
    for stamp in (0.0, 0.1):
        for _ in range(5):
            monitor.observe(scan_of(wall, Pose2D(), stamp), Pose2D(), Pose2D())
            assert monitor.limit(Twist2D(0.3), Twist2D(0.3), Pose2D()).action is MonitorAction.NONE


@pytest.mark.parametrize(
    "velocity", [Twist2D(0.4), Twist2D(-0.4), Twist2D(0.0, 0.4, 0.0), Twist2D(0.0, 0.0, 1.0)], ids=str
)
@pytest.mark.parametrize(("sooner", "brakes"), [(0.01, True), (-0.01, False)])
def test_a_base_brakes_for_what_it_meets_within_its_reaction_and_a_quarter_of_its_braking_time(
    velocity, sooner, brakes
):
    """Whatever it wants next: here it wants to stand."""
    monitor = CollisionMonitor(BASE)
    braking = max(math.hypot(velocity.vx, velocity.vy) / 0.6, abs(velocity.wz) / 2.0)
    time = monitor.reaction + braking / 4.0 - sooner
    grown = 0.28 + monitor.margin
    if velocity.wz:
        # The corner at 43 degrees comes round; it touches a point before it at its own radius.
        radius = math.hypot(0.28, 0.26)
        bearing = math.atan2(0.26, 0.28) + velocity.wz * time
        point = np.array([[radius * math.cos(bearing), radius * math.sin(bearing)]])
        first, _ = FootprintMotion(np.array(CORNERS), monitor.margin).contact(point, velocity, 2.0)
        point = Pose2D(0.0, 0.0, velocity.wz * (time - first)).apply(point)
    elif velocity.vy:
        point = np.array([[0.1, 0.26 + monitor.margin + velocity.vy * time]])
    else:
        point = np.array([[math.copysign(grown + abs(velocity.vx) * time, velocity.vx), 0.1]])
    pose = Pose2D(1.0, 2.0, 2.3)
    monitor.observe(scan_at(pose.apply(point), pose), Pose2D(), pose)
    command = monitor.limit(Twist2D(), velocity, pose)
    assert command.brake == brakes
    assert command.action is (MonitorAction.STOP if brakes else MonitorAction.NONE)


def scan_at(points: np.ndarray, pose: Pose2D, base_from_lidar: Pose2D = MIDDLE) -> LaserScan:
    """One point (1, 2) exactly on a beam, as a lidar that is turned suitably sees it."""
    own = (pose @ base_from_lidar).inverse().apply(points)
    bearing = math.atan2(own[0, 1], own[0, 0])
    beam = round((bearing + math.pi) / (2 * math.pi) * BEAMS)
    ranges = np.full(BEAMS, np.inf)
    ranges[beam % BEAMS] = math.hypot(*own[0])
    angle_min = bearing - 2 * math.pi / BEAMS * (beam % BEAMS)
    return LaserScan(ranges, angle_min, 2 * math.pi / BEAMS, 0.1, 8.0, 0.0)


def test_an_approach_is_slowed_to_the_share_that_stops_a_margin_before_what_is_there():
    monitor, gap = CollisionMonitor(BASE), 0.2
    pose = Pose2D(-1.0, 0.5, -2.0)
    point = pose.apply(np.array([[0.28 + monitor.margin + gap, 0.0]]))
    monitor.observe(scan_at(point, pose), Pose2D(), pose)
    wanted = Twist2D(0.6, 0.0, 0.01)
    command = monitor.limit(wanted, Twist2D(), pose)
    speed = command.twist.vx
    assert command.action is MonitorAction.APPROACH
    assert speed * monitor.reaction + speed**2 / (2 * 0.6) == pytest.approx(gap, abs=0.003)
    assert command.twist.wz == pytest.approx(0.01 * speed / 0.6)
    assert "22 cm ahead slows it down" in command.text


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_turn_on_the_spot_towards_something_is_slowed_and_not_refused(side):
    monitor = CollisionMonitor(BASE)
    monitor.observe(scan_at(np.array([[0.33, 0.20 * side]]), Pose2D()), Pose2D(), Pose2D())
    command = monitor.limit(Twist2D(0.0, 0.0, -1.2 * side), Twist2D(), Pose2D())
    assert command.action is MonitorAction.APPROACH
    assert 0.1 < abs(command.twist.wz) < 1.2


def test_what_a_lidar_that_is_mounted_askew_sees_is_where_it_is():
    base_from_lidar, pose = Pose2D(0.2, -0.1, 2.5), Pose2D(3.0, -2.0, 1.2)
    for where, twist, words in (
        ((0.35, 0.0), Twist2D(0.3), "ahead is"),
        ((-0.35, 0.0), Twist2D(-0.3), "behind is"),
        ((0.0, 0.33), Twist2D(0.0, 0.3), "on the left is"),
        ((0.0, -0.33), Twist2D(0.0, -0.3), "on the right is"),
        ((0.31, 0.29), Twist2D(0.2, 0.2), "ahead on the left is"),
        ((-0.31, -0.29), Twist2D(-0.2, -0.2), "behind on the right is"),
        ((-0.31, 0.29), Twist2D(-0.2, 0.2), "behind on the left is"),
        ((0.31, -0.29), Twist2D(0.2, -0.2), "ahead on the right is"),
    ):
        monitor = CollisionMonitor(BASE)
        monitor.observe(scan_at(pose.apply(np.array([where])), pose, base_from_lidar), base_from_lidar, pose)
        further = pose @ Pose2D(*[0.02 * v for v in (twist.vx, twist.vy)], 0.0)
        command = monitor.limit(Twist2D(0.5 * twist.vx, 0.5 * twist.vy), twist, further)
        assert command.brake
        assert words in command.text
        assert not monitor.limit(Twist2D(-twist.vx, -twist.vy), Twist2D(), further).text


def test_the_slowdown_zone_leaves_slow_motion_and_what_is_reached_later_as_it_is():
    zone = {"slowdown_margin": 0.3, "slowdown_time": 0.5, "slowdown_speed": 0.2}
    for x, wanted, action in (
        (0.28 + 0.3 + 0.24, Twist2D(0.5), MonitorAction.SLOWDOWN),
        (0.28 + 0.3 + 0.26, Twist2D(0.5), MonitorAction.NONE),
        (0.28 + 0.3 + 0.05, Twist2D(0.2), MonitorAction.NONE),
        (0.28 + 0.3 + 0.05, Twist2D(0.21), MonitorAction.SLOWDOWN),
    ):
        monitor = CollisionMonitor(BASE, **zone)
        monitor.observe(scan_at(np.array([[x, 0.0]]), Pose2D()), Pose2D(), Pose2D())
        command = monitor.limit(wanted, Twist2D(), Pose2D())
        assert command.action is action
        assert command.twist.vx == pytest.approx(0.2 if action is MonitorAction.SLOWDOWN else wanted.vx)


def test_what_pressed_on_the_bumper_stays_where_it_was_when_the_base_has_turned():
    bumper = PressedBumper(True)
    monitor, pose = CollisionMonitor(BASE, [bumper]), Pose2D(2.0, 1.0, 1.8)
    monitor.observe(scan_of(wall_ahead(3.0) + 50.0, pose, 0.0), Pose2D(), pose)
    assert monitor.limit(Twist2D(0.3), Twist2D(), pose).brake
    bumper.pressed = False
    backed = pose @ Pose2D(-0.02, 0.0, math.pi / 2)
    left, right = (monitor.limit(Twist2D(0.0, side, 0.0), Twist2D(), backed) for side in (0.3, -0.3))
    assert left.action is MonitorAction.NONE
    assert right.action is not MonitorAction.NONE
    assert "on the right" in right.text


def test_a_disabled_monitor_lets_everything_through_and_a_command_to_stand_is_never_changed():
    off = CollisionMonitor(BASE, [PressedBumper(True)], enabled=False)
    for _ in range(8):
        off.observe(scan_of(wall_ahead(0.5), Pose2D(), 0.0), Pose2D(), Pose2D())
    assert off.limit(Twist2D(0.6), Twist2D(0.6), Pose2D()).twist == Twist2D(0.6)
    on = CollisionMonitor(BASE)
    on.observe(scan_of(wall_ahead(0.5), Pose2D(), 0.0), Pose2D(), Pose2D())
    assert on.limit(Twist2D(), Twist2D(), Pose2D()).action is MonitorAction.NONE


@pytest.mark.parametrize(("aside", "is_a_person"), [(0.14, True), (0.16, False)])
def test_hits_right_before_a_person_are_that_person_s_and_kept_from_the_arm(aside, is_a_person):
    arm = np.array([[x, y, z] for x in (0.2, 0.6) for y in (-0.1, 0.1) for z in (0.9, 1.1)])
    monitor = CollisionMonitor(BASE)
    monitor.use_footprint(Footprint(np.array(CORNERS)).carrying([arm], 0.0))
    monitor.observe(scan_at(np.array([[0.65, 0.0]]), Pose2D()), Pose2D(), Pose2D())
    person = np.array([[0.65, 0.2 + aside, 0.2]])
    held = monitor.limit(Twist2D(0.2), Twist2D(), Pose2D(), np.vstack([[9.0, 9.0, 0.3], person]))
    assert (held.action is not MonitorAction.NONE) == is_a_person
    monitor.use_footprint(Footprint(np.array(CORNERS)))
    assert monitor.limit(Twist2D(0.2), Twist2D(), Pose2D(), person).action is MonitorAction.NONE
