"""Driving actions on a base without physics: how they begin, end, are cancelled, blocked, lost, and begun again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from bestman_bt.control.inertial import FusedOdometry
from bestman_bt.control.lidar import LidarSensor
from bestman_bt.control.wheeled.base_controller import BaseController, Driving
from bestman_bt.control.wheeled.collision_monitor import CollisionMonitor
from bestman_bt.control.wheeled.localisation_cycle import LocalisationCycle
from bestman_bt.errors import WrongResultError
from bestman_bt.messages import LaserScan, MotionErrorCode, Path2D, Pose, Pose2D, Twist2D, wrap_angle
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.base import FollowerCommand, PathFollower
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle
from bestman_bt.navigation.local_planning.obstacle_layer import ObstacleLayer
from bestman_bt.navigation.local_planning.pure_pursuit import PurePursuit
from bestman_bt.navigation.local_planning.rotate_to_heading import RotateToHeading
from bestman_bt.navigation.localization.base import LocalizationEstimate, Localizer, ScanMatch
from bestman_bt.navigation.localization.ekf import WheelOdometry
from bestman_bt.world_model.semantic_map import SemanticMap
from bestman_bt.world_model.world_model import BasePose, WorldModel
from hal.api import Bumper, BumperReading, BumperZone, MotionStatus, NoDataError, NotConnectedError, RobotStoppedError
from tests.control.scripted_parts import CORNERS, RoomLidar, ScriptedBase

ROOM = np.array([(-4, -4, 4, -4), (4, -4, 4, 4), (4, 4, -4, 4), (-4, 4, -4, -4)], dtype=float)
START, ODOMETRY = Pose2D(-0.5, 0.7, 2.0), Pose2D(3.0, -5.0, -1.3)
BASE_FROM_LIDAR = Pose2D(0.1, -0.05, 0.6)


class Told(Localizer):
    """Believes the odometry; scans fit as long as ``fits``, and ``position_std`` is what it says."""

    def __init__(self) -> None:
        self.fits, self.position_std, self.reason = True, 0.01, ""
        self.resets: list[Pose2D] = []
        self._from = self._pose = Pose2D()
        self._match: ScanMatch | None = None

    def start(self, pose: Pose2D, odometry: Pose2D, position_std: float, heading_std: float) -> LocalizationEstimate:
        self.resets.append(pose)
        self._from, self._pose = pose @ odometry.inverse(), pose
        return self._estimate()

    def predict(self, before: LocalizationEstimate, odometry: Pose2D) -> LocalizationEstimate:
        self._pose = self._from @ odometry
        return self._estimate()

    def correct(self, before: LocalizationEstimate, scan: LaserScan, base_from_lidar: Pose2D) -> LocalizationEstimate:
        self._match = ScanMatch(self.fits, 1.0, 0.0, self.reason)
        return self._estimate()

    def _estimate(self) -> LocalizationEstimate:
        return LocalizationEstimate(self._pose, np.diag([self.position_std**2] * 2 + [1e-4]), self._match)


class At:
    """As much of forward kinematics as a lidar that is fixed to a base needs."""

    def pose(self, frame: str, joints: dict[str, float]) -> Pose:
        return BASE_FROM_LIDAR.to_pose(0.2)


@dataclass
class Driven:
    base: ScriptedBase
    lidar: RoomLidar
    localizer: Told
    world: WorldModel
    controller: BaseController

    def sleep(self, seconds: float) -> None:
        self.base.clock.sleep(seconds)

    def wait(self, handle, limit: float = 30.0):
        end = self.base.clock.now() + limit
        while not handle.done and self.base.clock.now() < end:
            self.sleep(0.05)
        return handle


def driven(
    segments=ROOM,
    follower: PathFollower | None = None,
    rotation: RotateToHeading | None = None,
    bumpers: Sequence[Bumper] = (),
    layer: ObstacleLayer | None = None,
    start: Pose2D = START,
) -> Driven:
    base = ScriptedBase(start, ODOMETRY)
    lidar = RoomLidar(base, BASE_FROM_LIDAR, segments)
    localizer = Told()
    world = WorldModel(SemanticMap(ROOM, {}), base=BasePose(start, 0.01, 0.01, 0.0))
    odometer = FusedOdometry(base, base.clock, WheelOdometry())
    controller = BaseController(
        base,
        LocalisationCycle(base.clock, LidarSensor(lidar, At()), localizer, odometer, world),
        follower or PurePursuit(),
        Driving(rotation=rotation or RotateToHeading()),
        CollisionMonitor(base.model, bumpers),
        layer,
    )
    controller.start()
    base.clock.sleep(0.2)
    return Driven(base, lidar, localizer, world, controller)


class Ends(PathFollower):
    """A follower that drives nowhere and is done at once; ``resets`` and ``scans``: how often it was told."""

    def __init__(self) -> None:
        self.resets = self.scans = 0

    def observe(self, scan: LaserScan, map_from_lidar: Pose2D) -> None:
        self.scans += 1

    def reset(self, path: Path2D, costmap: Costmap | None = None) -> None:
        self.resets += 1

    def compute(self, pose: Pose2D, velocity: Twist2D, dt: float) -> FollowerCommand:
        return FollowerCommand(Twist2D(), True, 0.0)


class Turns(RotateToHeading):
    """Corrections that turn nothing; ``wanted``: the headings that were asked for."""

    def __init__(self) -> None:
        super().__init__()
        self.wanted: list[float] = []

    def turn_to(self, heading: float, speed: float = 0.0) -> None:
        self.wanted.append(heading)

    def compute(self, pose: Pose2D, velocity: Twist2D, dt: float) -> FollowerCommand:
        return FollowerCommand(Twist2D(), True, 0.0)


def here_to(goal: Pose2D) -> Path2D:
    return Path2D(np.array([START.xy, goal.xy]), goal)


@pytest.mark.parametrize(("distance", "speed"), [(1.0, None), (-0.6, None), (0.8, 0.2), (-0.8, 0.2)])
def test_a_drive_ends_where_it_should_and_no_faster_than_it_is_asked(distance, speed):
    it = driven()
    handle = it.wait(it.controller.drive(distance, speed))
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    assert handle.result == it.world.base
    assert it.base.true_pose.distance_to(START @ Pose2D(distance, 0.0, 0.0)) < 0.01
    fastest = max(abs(twist.vx) for twist in it.base.told)
    assert fastest == pytest.approx(speed, abs=1e-9) if speed else 0.3 < fastest <= 0.6


@pytest.mark.parametrize("wrong", [None, Twist2D(math.nan, 0.0, 0.0), Twist2D(0.5, 0.0, math.inf)])
def test_a_follower_that_breaks_its_interface_fails_the_drive_with_the_base_at_rest(wrong):
    class Breaks(Ends):
        def compute(self, pose: Pose2D, velocity: Twist2D, dt: float) -> FollowerCommand:
            if it.base.speed[0] < 0.3:
                return FollowerCommand(Twist2D(0.5), False, 1.0)
            if wrong is not None:
                return FollowerCommand(wrong, False, 1.0)
            raise WrongResultError("Breaks.compute should return FollowerCommand, got NoneType")

    it = driven(follower=Breaks())
    handle = it.wait(it.controller.follow(here_to(START @ Pose2D(0.5, 0.0, 0.0))))
    assert (handle.status, handle.failure.code) == (MotionStatus.FAILED, "wrong_result")
    assert handle.failure.text.startswith("Breaks.compute should return")
    assert it.base.stops == 1  # at once: what it was told last would hold until it lapses


def test_a_turn_goes_to_a_heading_of_the_map_or_by_an_angle_of_the_odometry():
    it = driven()
    assert it.wait(it.controller.rotate_to(-2.0)).status is MotionStatus.SUCCEEDED
    assert it.base.true_pose.theta == pytest.approx(-2.0, abs=0.015)
    before = it.base.true_pose.theta
    assert it.wait(it.controller.turn(-2.5)).status is MotionStatus.SUCCEEDED
    assert wrap_angle(it.base.true_pose.theta - before) == pytest.approx(-2.5, abs=0.015)


@pytest.mark.parametrize("how", ["cancel", "stop"])
def test_an_action_that_is_cancelled_stops_the_base_once_and_tells_it_nothing_more(how):
    it = driven()
    handle = it.controller.drive(2.0)
    it.sleep(1.5)
    assert it.base.speed[0] > 0.3
    told = len(it.base.told)
    handle.cancel() if how == "cancel" else it.controller.stop()
    assert it.base.stops == 1
    assert handle.failure.code is (MotionErrorCode.CANCELED if how == "cancel" else MotionErrorCode.STOPPED)
    assert it.controller.path is None
    handle.cancel()
    it.sleep(1.0)
    assert it.base.stops == 1
    assert len(it.base.told) == told
    assert np.all(it.base.speed == 0.0)
    second = it.wait(it.controller.drive(-0.3))
    assert second.status is MotionStatus.SUCCEEDED
    assert len(it.base.told) > told


def test_the_handle_of_an_action_that_was_superseded_no_longer_stops_the_base():
    it = driven()
    first = it.controller.drive(1.0)
    it.sleep(0.5)
    second = it.controller.drive(1.2)
    assert (first.status, first.failure.code) == (MotionStatus.CANCELED, MotionErrorCode.SUPERSEDED)
    first.cancel()
    assert it.base.stops == 0
    assert it.wait(second).status is MotionStatus.SUCCEEDED


def test_parking_stops_the_base_and_is_done_when_scans_at_rest_have_told_where_it_is():
    it = driven()
    it.controller.drive(2.0)
    it.sleep(1.5)
    handle = it.controller.park()
    assert it.base.stops == 1
    it.sleep(0.55)  # it brakes for a while, and then takes five scans of a tenth of a second each
    assert not handle.done
    assert it.wait(handle, 2.0).result == it.world.base
    assert it.world.base.pose.distance_to(it.base.true_pose) < 1e-9


@pytest.mark.parametrize("gone", ["lidar", "base"])
def test_an_action_ends_and_the_base_is_stopped_at_once_when_a_reading_fails(gone):
    it = driven()
    handle = it.controller.drive(2.0)
    it.sleep(1.0)
    part = it.lidar if gone == "lidar" else it.base
    part.error = NoDataError("silent") if gone == "lidar" else NotConnectedError("silent")
    it.sleep(0.15)
    assert (handle.status, handle.failure.code) == (MotionStatus.FAILED, part.error.code)
    assert handle.failure.text == "silent"
    assert it.base.stops == 1
    it.sleep(0.5)
    assert it.base.stops == 1, "nothing is under way any more"
    part.error = None
    assert it.wait(it.controller.drive(-0.2)).status is MotionStatus.SUCCEEDED


def test_an_action_whose_commands_are_refused_counts_as_stopped_and_not_as_stuck():
    it = driven()
    handle = it.controller.drive(2.0)
    it.sleep(0.5)
    it.base.refuses = True
    it.sleep(0.1)
    assert (handle.status, handle.failure.code) == (MotionStatus.CANCELED, MotionErrorCode.STOPPED)
    assert handle.failure.text == "the robot is stopped"
    assert not it.controller.stuck


def test_a_stop_because_the_base_is_lost_is_reported_as_its_loss(monkeypatch):
    it = driven()
    handle = it.controller.drive(2.0)
    it.sleep(0.5)

    def lost(vx: float, vy: float, wz: float) -> None:
        it.base.error = NotConnectedError("closed the connection")  # between the tick's readings and its command
        raise RobotStoppedError("the robot is stopped")

    monkeypatch.setattr(it.base, "set_velocity", lost)
    it.sleep(0.1)
    assert (handle.status, handle.failure.code) == (MotionStatus.FAILED, MotionErrorCode.DISCONNECTED)
    assert handle.failure.text == "closed the connection"


def test_a_base_that_does_not_get_on_is_stuck_after_a_while_then_blocked_and_may_try_again():
    it = driven()
    it.base.held = True
    handle = it.controller.drive(1.0)
    it.sleep(1.4)
    assert not it.controller.stuck
    it.sleep(0.3)
    assert it.controller.stuck
    it.sleep(1.2)
    assert not handle.done
    it.sleep(0.3)
    assert handle.failure.code is MotionErrorCode.BLOCKED
    assert "(-0.50, 0.70)" in handle.failure.text
    assert "wheels do not turn" in handle.failure.text
    assert it.base.stops == 1
    assert it.controller.stuck
    again = it.controller.drive(0.3)
    assert not it.controller.stuck
    it.base.held = False
    assert it.wait(again).status is MotionStatus.SUCCEEDED
    assert not it.controller.stuck


def test_a_base_that_stands_for_a_limit_is_not_blocked_until_its_patience_has_an_end():
    it = driven()
    handle = it.controller.drive(3.0)
    for _ in range(2):  # each wait counts by itself
        it.controller.speed_limit = 0.0
        it.sleep(9.0)
        assert np.all(it.base.speed == 0.0)
        assert not handle.done
        it.controller.speed_limit = 0.15
        it.sleep(2.0)
        assert it.base.speed[0] == pytest.approx(0.15)
    it.controller.speed_limit = 0.0
    it.sleep(14.8)
    assert not handle.done
    it.sleep(0.4)
    assert handle.failure.code is MotionErrorCode.BLOCKED
    assert "people block the base" in handle.failure.text
    it.controller.speed_limit = None
    assert it.wait(it.controller.drive(-0.2)).status is MotionStatus.SUCCEEDED


@pytest.mark.parametrize(("off", "reached"), [(0.0194, True), (0.0206, False)])
def test_a_base_that_rests_off_its_goal_is_judged_by_the_tolerance(off, reached):
    it = driven(follower=Ends())
    handle = it.wait(it.controller.follow(here_to(START @ Pose2D(0.6 * off, 0.8 * off, 0.0))))
    assert (handle.status is MotionStatus.SUCCEEDED) == reached
    if not reached:
        assert handle.failure.code is MotionErrorCode.TOLERANCE
        assert handle.failure.text == (
            f"the base came to rest {1e3 * off:.0f} mm and 0.0° from its goal; up to 20 mm and 1.4° are accepted"
        )


@pytest.mark.parametrize(("degrees", "turns", "reached"), [(0.6, 0, True), (-1.3, 2, True), (1.5, 2, False)])
def test_a_heading_is_corrected_twice_and_then_judged_more_mildly(degrees, turns, reached):
    rotation = Turns()
    it = driven(follower=Ends(), rotation=rotation)
    for _ in range(2):  # the second action has corrections of its own
        rotation.wanted.clear()
        goal = START @ Pose2D(0.0, 0.0, math.radians(degrees))
        handle = it.wait(it.controller.follow(here_to(goal)))
        assert rotation.wanted == [goal.theta] * turns
        assert (handle.status is MotionStatus.SUCCEEDED) == reached


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_goal_on_the_other_side_of_half_a_turn_is_as_near_as_any(side):
    rotation = Turns()
    it = driven(follower=Ends(), rotation=rotation, start=Pose2D(START.x, START.y, side * (math.pi - 0.002)))
    handle = it.wait(it.controller.follow(here_to(Pose2D(START.x, START.y, -side * (math.pi - 0.002)))))
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    assert rotation.wanted == []


def test_a_turn_on_the_spot_is_not_judged_by_where_the_base_has_gone():
    it = driven(rotation=Turns())
    goal = it.controller.rotate_to(START.theta)
    it.base.true_pose = it.base.true_pose @ Pose2D(0.1, 0.0, 0.0)
    assert it.wait(goal).status is MotionStatus.SUCCEEDED


def test_a_base_that_gets_too_uncertain_reports_it_and_is_stopped():
    it = driven()
    handle = it.controller.drive(2.0)
    it.localizer.position_std = 0.099
    it.sleep(0.5)
    assert not handle.done
    it.localizer.position_std, it.localizer.fits = 0.101, False
    it.sleep(0.1)
    assert handle.failure.code is MotionErrorCode.LOST
    assert "0.10 m" in handle.failure.text
    assert it.base.stops == 1
    assert it.controller.localisation.lost


def test_a_base_is_lost_after_so_many_refused_scans_in_a_row_and_found_with_one_that_fits():
    it = driven()
    handle = it.controller.drive(3.0, speed=0.2)
    it.sleep(0.3)
    it.localizer.fits, it.localizer.reason = False, "nothing fits"
    it.sleep(1.6)
    it.localizer.fits = True
    it.sleep(0.11)  # one that fits, and the count begins anew
    it.localizer.fits = False
    it.sleep(1.6)
    assert not handle.done
    it.sleep(0.5)
    assert handle.failure.code is MotionErrorCode.LOST
    assert "nothing fits" in handle.failure.text
    told = len(it.base.told)
    again = it.controller.drive(-0.3)
    it.sleep(1.0)
    assert len(it.base.told) == told, "lost, it stands and looks"
    it.localizer.fits = True
    assert it.wait(again).status is MotionStatus.SUCCEEDED
    assert not it.controller.localisation.lost


def test_a_lost_base_that_waits_in_vain_is_reported_again_that_it_is_lost_and_turns_by_odometry_all_the_same():
    it = driven()
    it.localizer.fits = False
    it.controller.believe(START, 0.02, 0.02)
    assert it.controller.localisation.lost
    assert it.wait(it.controller.turn(1.0)).status is MotionStatus.SUCCEEDED
    assert it.base.true_pose.theta == pytest.approx(3.0, abs=0.01)
    told = len(it.base.told)
    handle = it.wait(it.controller.drive(0.5), 5.0)
    assert handle.failure.code is MotionErrorCode.LOST
    assert len(it.base.told) == told


def test_a_base_that_is_not_where_it_was_told_to_be_reports_what_may_have_moved_it_and_what_to_do():
    it = driven()
    it.localizer.fits, it.localizer.reason = False, "nothing fits"
    it.controller.believe(START, 0.02, 0.02)
    text = it.wait(it.controller.drive(0.5), 5.0).failure.text
    assert text.startswith("no scan fits at the given pose of the base (nothing fits). Has something moved it")
    assert "ReturnToStart" in text
    it.localizer.fits = True
    it.wait(it.controller.drive(0.1))
    it.localizer.fits = False
    assert "pose of the base is too uncertain" in it.wait(it.controller.drive(2.0, speed=0.2), 5.0).failure.text


def test_believing_in_another_place_stops_the_base_forgets_what_was_seen_and_asks_for_a_scan_that_fits():
    crate = np.array([(1.0, -1.0, 1.2, -1.0), (1.2, -1.0, 1.2, -0.8), (1.2, -0.8, 1.0, -0.8), (1.0, -0.8, 1.0, -1.0)])
    it = driven(np.vstack([ROOM, crate]))
    assert len(it.controller.layer.points)
    handle = it.controller.drive(2.0)
    it.sleep(0.5)
    elsewhere = Pose2D(1.0, 1.0, -0.5)
    it.controller.believe(elsewhere, 0.2, 0.1)
    assert handle.failure.code is MotionErrorCode.STOPPED
    assert it.base.stops == 1
    assert it.localizer.resets[-1] == elsewhere
    assert it.world.base == BasePose(elsewhere, 0.2, 0.1, it.base.clock.now())
    assert not len(it.controller.layer.points)
    assert it.controller.localisation.lost
    it.sleep(0.2)
    assert not it.controller.localisation.lost


def test_another_localizer_goes_on_from_where_the_base_is_believed_to_be_and_the_old_one_comes_back():
    it = driven()
    it.wait(it.controller.drive(0.5))
    other, pose = Told(), it.world.base.pose
    assert it.controller.localise_by(other) is it.localizer
    assert other.resets == [pose]
    it.sleep(0.2)
    assert it.controller.localisation.estimate is not None
    assert it.wait(it.controller.drive(-0.5)).status is MotionStatus.SUCCEEDED
    assert it.world.base.pose.distance_to(START) < 0.01
    assert it.controller.localise_by(it.localizer) is other


def test_a_base_that_begins_unsure_of_its_place_is_lost_from_the_start():
    it = driven()
    it.controller.close()
    it.localizer.fits = False
    it.world.base = BasePose(START, 0.11, 0.01, 0.0)
    it.controller.start()
    assert it.controller.localisation.lost
    it.controller.close()
    it.world.base = BasePose(START, 0.09, 0.01, 0.0)
    it.controller.start()
    assert not it.controller.localisation.lost


def test_a_controller_that_is_closed_cancels_what_is_under_way_and_drives_no_more():
    it = driven()
    handle = it.controller.drive(2.0)
    it.sleep(0.5)
    it.controller.close()
    assert handle.failure.code is MotionErrorCode.STOPPED
    told, scans = len(it.base.told), it.lidar.scans
    it.sleep(1.0)
    assert (len(it.base.told), it.lidar.scans) == (told, scans)
    with pytest.raises(RuntimeError, match="before start"):
        it.controller.drive(1.0)
    with pytest.raises(RuntimeError, match="before start"):
        it.controller.park()
    it.controller.start()
    assert it.wait(it.controller.drive(-0.2)).status is MotionStatus.SUCCEEDED


def test_a_base_at_rest_scans_seldom_and_often_again_when_it_is_pushed_drives_or_is_lost():
    it = driven()

    def scans(seconds: float) -> int:
        before = it.lidar.scans
        it.sleep(seconds)
        return it.lidar.scans - before

    it.wait(it.controller.park())
    assert 3 <= scans(4.0) <= 5
    for push in ((0.0, 0.0, 0.5), (0.0, 0.0, -0.5), (-0.2, 0.0, 0.0)):
        it.base.speed = np.array(push)  # once
        assert 6 <= scans(1.0) <= 11
        it.wait(it.controller.park())
    it.controller.drive(2.0, speed=0.2)
    assert 9 <= scans(1.0) <= 11
    it.controller.stop()
    it.sleep(2.0)
    it.localizer.fits = False
    it.controller.believe(it.base.true_pose, 0.02, 0.02)
    assert 19 <= scans(2.0) <= 21


def test_scans_are_reported_with_the_odometry_and_the_place_of_the_lidar_at_the_time():
    it = driven()
    it.wait(it.controller.rotate_to(-1.0))
    it.sleep(1.0)
    seen = it.controller.last_scan
    assert seen.fits
    assert seen.odometry.distance_to(it.base.odometry()) < 1e-9
    placed, true = seen.map_from_lidar, it.base.true_pose @ BASE_FROM_LIDAR
    assert placed.distance_to(true) < 1e-9
    assert wrap_angle(placed.theta - true.theta) == pytest.approx(0.0, abs=1e-9)
    scan = it.controller.scan()
    assert scan.odometry == it.base.odometry()


def test_what_stands_in_the_way_of_the_path_is_reported_with_the_metres_until_then():
    ahead = START @ Pose2D(1.5, 0.0, 0.0)
    post = np.array([(ahead.x - 0.05, ahead.y, ahead.x + 0.05, ahead.y), (ahead.x, ahead.y - 0.05, ahead.x, ahead.y)])
    it = driven(np.vstack([ROOM, post]))
    assert it.controller.blocked_at() is None
    goal = START @ Pose2D(2.5, 0.0, 0.0)
    costmap = Costmap.from_map(it.world.map, Footprint(np.array(CORNERS)))
    it.controller.follow(here_to(goal), costmap)
    assert it.controller.remaining == pytest.approx(2.5)
    assert it.controller.path.goal == goal
    metres, point = it.controller.blocked_at()
    assert metres == pytest.approx(1.5 - 0.05 - 0.28, abs=0.1)
    assert np.linalg.norm(point - ahead.xy) < 0.1
    it.sleep(1.5)
    driven_on = it.base.true_pose.distance_to(START)
    assert driven_on > 0.2
    assert it.controller.remaining == pytest.approx(2.5 - driven_on, abs=0.06)
    assert it.controller.blocked_at()[0] == pytest.approx(metres - driven_on, abs=0.1)
    it.controller.stop()
    assert it.controller.remaining == 0.0
    assert it.controller.blocked_at() is None


def test_a_follower_for_one_path_is_told_of_scans_meanwhile_and_the_controller_s_own_takes_over_again():
    it = driven()
    other = Ends()
    it.wait(it.controller.follow(here_to(START), follower=other))
    assert other.resets == 1
    assert other.scans > 2
    it.controller.follow(here_to(START @ Pose2D(0.5, 0.0, 0.0)))
    scans = other.scans
    it.sleep(1.0)
    assert (other.resets, other.scans) == (1, scans)
    assert it.base.speed[0] > 0.1


def test_scans_that_do_not_fit_mark_no_obstacles():
    crate = np.array([(1.0, -1.0, 1.2, -1.0), (1.2, -1.0, 1.2, -0.8), (1.2, -0.8, 1.0, -0.8), (1.0, -0.8, 1.0, -1.0)])
    it = driven(np.vstack([ROOM, crate]))
    it.controller.layer.clear()
    it.localizer.fits = False
    it.sleep(0.5)
    assert not len(it.controller.layer.points)


class PressedBumper(Bumper):
    """One strip at the front."""

    def __init__(self) -> None:
        super().__init__("bumper")
        self.pressed = False

    @property
    def zones(self) -> tuple[BumperZone, ...]:
        return (BumperZone((0.28, -0.2), (0.28, 0.2)),)

    def read(self) -> BumperReading:
        return BumperReading((0,) if self.pressed else (), 0.0)


def test_a_base_that_bumps_into_something_brakes_and_is_blocked_without_waiting():
    bumper = PressedBumper()
    it = driven(bumpers=[bumper])
    handle = it.controller.drive(1.0)
    it.sleep(0.3)
    bumper.pressed = True
    it.sleep(0.4)  # it brakes, and is told when it stands
    assert (handle.status, handle.failure.code) == (MotionStatus.FAILED, MotionErrorCode.BLOCKED)
    assert "bumper" in handle.failure.text
    assert it.controller.stuck
    bumper.pressed = False
    assert it.wait(it.controller.drive(-0.2)).status is MotionStatus.SUCCEEDED


class Crowded(ObstacleLayer):
    """Somebody comes towards the base; as tall as people are where ``tall``."""

    def __init__(self) -> None:
        super().__init__()
        (x, y), (vx, vy) = START.apply([1.4, 0.0]), START.apply([-0.6, 0.0]) - START.xy
        self.moving.obstacles = [MovingObstacle(float(x), float(y), float(vx), float(vy), 0.2)]

    def update(self, scan: LaserScan, map_from_lidar: Pose2D) -> None:
        """They are seen all the time."""


def test_people_are_given_way_on_paths_that_were_planned_on_a_map_alone():
    goal = START @ Pose2D(1.0, 0.0, 0.0)
    for mapped in (True, False):
        it = driven(layer=Crowded())
        costmap = Costmap.from_map(it.world.map, Footprint(np.array(CORNERS))) if mapped else None
        it.controller.follow(here_to(goal), costmap)
        it.sleep(1.0)
        assert (it.base.true_pose.distance_to(START) < 0.01) == mapped


def test_an_action_of_a_base_at_rest_waits_for_scans_of_its_own():
    it = driven()
    for _ in range(2):
        handle = it.controller.park()
        it.sleep(0.35)
        assert not handle.done
        it.sleep(0.3)
        assert handle.done


def test_scans_that_were_refused_before_it_began_anew_do_not_make_a_base_lost():
    it = driven()
    it.localizer.fits = False
    it.sleep(10.0)  # a base at rest scans once a second
    it.controller.park()
    it.sleep(0.9)
    it.controller.close()
    it.controller.start()
    handle = it.controller.drive(2.0, speed=0.2)
    it.sleep(1.0)
    assert not handle.done
    it.sleep(1.1)
    assert handle.failure.code is MotionErrorCode.LOST
