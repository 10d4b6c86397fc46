"""What holds for each estimator of where the base is: nonsense is refused at the door and leaves no trace."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bestman_bt.messages import LaserScan, Path2D, Pose2D, wrap_angle
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.global_planning.hybrid_astar import HybridAStar
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.navigation.global_planning.theta_star import ThetaStar
from bestman_bt.navigation.localization.ekf import OdometryEkf
from bestman_bt.navigation.localization.scan_to_map import ScanToMap, cast_rays
from bestman_bt.navigation.slam.pose_graph_slam import PoseGraphSlam, SlamLocalizer
from bestman_bt.world_model.semantic_map import SemanticMap
from tests.navigation.localization.tracking import Tracking
from tests.properties.profile import examples

WALLS = np.array([(-3, -2, 4, -2), (4, -2, 4, 2.5), (4, 2.5, -3, 2.5), (-3, 2.5, -3, -2), (1, -2, 1, 0)], dtype=float)
NONSENSE = st.sampled_from([math.nan, math.inf, -math.inf])
LOCALIZERS = {"scan_to_map": lambda: ScanToMap(SemanticMap(WALLS, {})), "slam": lambda: SlamLocalizer(PoseGraphSlam())}
poses = st.builds(Pose2D, st.floats(-2, 0.5), st.floats(-1.2, 1.8), st.floats(-3, 3))


def scan_at(pose, walls=WALLS, beams=180):
    ranges, _ = cast_rays(walls, pose, np.linspace(-math.pi, math.pi, beams, endpoint=False))
    return LaserScan(np.where(ranges < 8.0, ranges, np.inf), -math.pi, 2 * math.pi / beams, 0.05, 8.0, 0.0)


@st.composite
def broken(draw):
    """A pose of which one number is nonsense."""
    numbers = [0.0, 0.0, 0.0]
    numbers[draw(st.integers(0, 2))] = draw(NONSENSE)
    return Pose2D(*numbers)


@pytest.mark.parametrize("name", LOCALIZERS)
@examples(10)
@given(at=poses, wrong=broken(), std=st.sampled_from([math.nan, math.inf, -0.1]))
def test_a_localizer_refuses_nonsense_and_goes_on_as_if_it_had_not_come(name, at, wrong, std):
    localizer, other = (Tracking(LOCALIZERS[name](), at, Pose2D(), 0.02, 0.02) for _ in range(2))
    for one in (localizer, other):
        one.correct(scan_at(at), Pose2D())
    for nonsense in (
        lambda: localizer.predict(wrong),
        lambda: localizer.localizer.start(wrong, Pose2D(), 0.02, 0.02),
        lambda: localizer.localizer.start(at, wrong, 0.02, 0.02),
        lambda: localizer.correct(scan_at(at), wrong),
    ):
        with pytest.raises(ValueError, match="should be finite"):
            nonsense()
    for stds in ((std, 0.02), (0.02, std)):
        with pytest.raises(ValueError, match="_std is"):
            localizer.localizer.start(at, Pose2D(), *stds)
    moved = Pose2D(0.05, 0.0, 0.1)
    for one in (localizer, other):
        one.predict(moved)
        one.correct(scan_at(at @ moved), Pose2D())
    assert localizer.estimate.pose == other.estimate.pose
    assert np.array_equal(localizer.estimate.covariance, other.estimate.covariance)


@examples(50)
@given(st.integers(0, 9), st.sampled_from([-0.01, math.nan, -math.inf]))
def test_a_scan_of_nonsense_is_refused_with_its_beam(beam, value):
    ranges = np.full(10, 2.0)
    ranges[beam] = value
    with pytest.raises(ValueError, match=rf"LaserScan ranges\[{beam}\] is {value:g} m"):
        LaserScan(ranges, 0.0, 0.1, 0.1, 8.0, 0.0)


@examples(50)
@given(broken(), NONSENSE, st.booleans())
def test_the_filter_of_wheels_and_gyroscope_refuses_nonsense_and_goes_on_as_before(wrong, value, of_gyro):
    ekf = OdometryEkf()
    start, other = ekf.start(Pose2D()), ekf.start(Pose2D())
    for nonsense in (
        lambda: ekf.update(start, wrong, 0.0, 0.1),
        lambda: ekf.update(start, Pose2D(), *((value, 0.1) if of_gyro else (0.0, value))),
        lambda: ekf.start(wrong),
    ):
        with pytest.raises(ValueError, match="should be finite"):
            nonsense()
    assert ekf.update(start, Pose2D(0.1), 0.01, 0.1).pose == ekf.update(other, Pose2D(0.1), 0.01, 0.1).pose


@pytest.mark.parametrize("planner", [GridAStar, ThetaStar, HybridAStar])
@examples(5)
@given(poses, broken(), st.booleans())
def test_a_planner_refuses_poses_that_are_nowhere(planner, at, wrong, of_start):
    hall = Costmap.from_map(
        SemanticMap(WALLS, {}), Footprint(np.array([(0.2, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.2, -0.2)]))
    )
    with pytest.raises(ValueError, match=f"the {'start' if of_start else 'goal'} is .* should be finite"):
        planner().plan(*((wrong, at) if of_start else (at, wrong)), hall)
    with pytest.raises(ValueError, match=r"Path2D points\[1\]"):
        Path2D([(0.0, 0.0), (math.nan, 1.0)], at)


@examples(10)
@given(poses, poses, st.floats(-3, 3), st.floats(-50, 50), st.floats(-50, 50))
def test_a_localizer_finds_the_same_wherever_the_map_lies(at, off, turn, x, y):
    """The world turned and moved as a whole: the estimate turns and moves with it."""
    moved = Pose2D(x, y, turn)
    walls = np.hstack([moved.apply(WALLS[:, :2]), moved.apply(WALLS[:, 2:])])
    believed = at @ Pose2D(0.01 * off.x, 0.01 * off.y, 0.01 * off.theta)
    found = []
    for segments, pose, frame in ((WALLS, believed, Pose2D()), (walls, moved @ believed, moved)):
        localizer = Tracking(ScanToMap(SemanticMap(segments, {})), pose, Pose2D(), 0.03, 0.03)
        found.append(frame.inverse() @ localizer.correct(scan_at(at), Pose2D()).pose)
    assert found[0].distance_to(found[1]) < 1e-3
    assert abs(wrap_angle(found[0].theta - found[1].theta)) < 1e-3
