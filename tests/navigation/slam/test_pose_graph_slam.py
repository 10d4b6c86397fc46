from __future__ import annotations

import threading

import numpy as np
import pytest

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.messages.grids import FREE, OCCUPIED
from bestman_bt.navigation.slam.loop_closure import LoopCloser
from bestman_bt.navigation.slam.pose_graph_slam import PoseGraphSlam, SlamLocalizer
from tests.navigation.localization.tracking import Tracking

BASE_FROM_LIDAR = Pose2D(0.1, 0.0, 0.05)


def run(drive, scans=None, **parameters):
    slam = PoseGraphSlam(**parameters)
    slam.reset(drive.true[0], drive.odometry[0])
    errors = []
    for true, odometry, scan in list(zip(drive.true, drive.odometry, drive.scans, strict=True))[:scans]:
        errors.append(slam.add(odometry, scan, BASE_FROM_LIDAR).pose.distance_to(true))
    return slam, np.array(errors)


@pytest.fixture(scope="module")
def mapped(round_drive):
    return run(round_drive)


def test_it_keeps_within_centimetres_where_odometry_is_metres_off(round_drive, mapped):
    _, errors = mapped
    start, end = round_drive.true[0], round_drive.true[-1]
    counted = start @ (round_drive.odometry[0].inverse() @ round_drive.odometry[-1])
    assert counted.distance_to(end) > 1.0
    assert np.sqrt(np.mean(errors**2)) < 0.02
    assert errors.max() < 0.04


def test_the_round_is_closed(mapped):
    slam, _ = mapped
    loops = slam.trajectory.loops
    assert len(loops) >= 3
    assert (loops[:, 1] - loops[:, 0] > 20).all()
    assert slam.estimate.loop_closures == len(loops)


def test_occupied_cells_lie_on_walls_and_the_floor_is_free(round_drive, mapped):
    grid = mapped[0].grid
    cells = grid.to_points(np.argwhere(grid.data == OCCUPIED))
    start, along = round_drive.walls[:, :2], round_drive.walls[:, 2:] - round_drive.walls[:, :2]
    share = np.clip(((cells[:, None] - start) * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    off = np.linalg.norm(cells[:, None] - start - share[..., None] * along, axis=2).min(axis=1)
    assert (off < 0.05).mean() > 0.97
    assert grid.data[tuple(grid.to_cells([pose.xy for pose in round_drive.true]).T)].tolist() == [FREE] * len(
        round_drive.true
    )


@pytest.mark.slow
def test_without_loop_closures_the_end_of_the_round_is_farther_off(short_sighted_drive):
    _, closed = run(short_sighted_drive)
    slam, errors = run(short_sighted_drive, loop_closure=False)
    assert len(slam.trajectory.loops) == 0
    assert closed[-40:].mean() < 0.04
    assert errors[-40:].mean() > 1.5 * closed[-40:].mean()


@pytest.mark.slow
def test_equal_readings_give_equal_maps(round_drive):
    first, second = (run(round_drive, 80)[0] for _ in range(2))
    assert np.array_equal(first.grid.data, second.grid.data)
    assert np.array_equal(first.trajectory.poses, second.trajectory.poses)


def test_a_jump_of_the_odometry_is_found_by_searching(round_drive):
    slam, _ = run(round_drive, 30)
    jumped = round_drive.odometry[30] @ Pose2D(0.45, -0.3, 0.35)
    estimate = slam.add(jumped, round_drive.scans[30], BASE_FROM_LIDAR)
    assert estimate.match.accepted
    assert estimate.pose.distance_to(round_drive.true[30]) < 0.05


def test_scans_that_show_nothing_are_refused_and_odometry_goes_on(round_drive):
    slam, _ = run(round_drive, 30)
    blind = LaserScan(np.full(360, np.inf), -np.pi, 2 * np.pi / 360, 0.1, 8.0, 3.1)
    before = slam.estimate
    estimate = slam.add(round_drive.odometry[29] @ Pose2D(0.5, 0.0, 0.0), blind, BASE_FROM_LIDAR)
    assert not estimate.match.accepted
    assert "0 hits" in estimate.match.reason
    assert estimate.pose.distance_to(before.pose @ Pose2D(0.5, 0.0, 0.0)) < 1e-9
    assert estimate.position_std > 3.0 * before.position_std


def test_as_a_localizer_it_begins_a_new_map_at_each_start(round_drive):
    slam = SlamLocalizer(PoseGraphSlam())
    for _ in range(2):
        localizer = Tracking(slam, Pose2D(1.0, 2.0, 0.5), round_drive.odometry[0], 0.05, 0.02)
        for odometry, scan in list(zip(round_drive.odometry, round_drive.scans, strict=True))[:10]:
            localizer.predict(odometry)
            estimate = localizer.correct(scan, BASE_FROM_LIDAR)
    expected = Pose2D(1.0, 2.0, 0.5) @ (round_drive.true[0].inverse() @ round_drive.true[9])
    assert estimate.pose.distance_to(expected) < 0.02


def test_it_reports_what_is_missing_before_a_reset():
    with pytest.raises(RuntimeError, match="before reset"):
        _ = PoseGraphSlam().estimate


class SlowCloser(LoopCloser):
    """Finds loops once it is let."""

    may_end = threading.Event()
    asked = 0

    def find(self, keyframe, finished, graph):
        type(self).asked += 1
        assert self.may_end.wait(20.0)
        return super().find(keyframe, finished, graph)


def test_no_scan_waits_for_loops_that_are_looked_for_until_it_is_time_to_take_them_over(round_drive):
    slam = PoseGraphSlam(closure=SlowCloser(), closing_scans=5)
    slam.reset(round_drive.true[0], round_drive.odometry[0])
    begun = next(
        number
        for number, readings in enumerate(zip(round_drive.odometry, round_drive.scans, strict=True))
        if slam.add(*readings, BASE_FROM_LIDAR) and SlowCloser.asked
    )
    slam.add(round_drive.odometry[begun + 1], round_drive.scans[begun + 1], BASE_FROM_LIDAR)
    assert not SlowCloser.may_end.is_set()
    SlowCloser.may_end.set()
    assert len(slam.trajectory.stamps) >= 2
