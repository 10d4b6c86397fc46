from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.braking import GiveWay
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle

BASE = Footprint(np.array([[-0.3, -0.25], [0.3, -0.25], [0.3, 0.25], [-0.3, 0.25]]))
AHEAD, ORIGIN = Twist2D(vx=0.5), Pose2D()


def share(*walkers: tuple[float, float, float, float], pose: Pose2D = ORIGIN, twist: Twist2D = AHEAD) -> float:
    return GiveWay(BASE).share(pose, twist, [MovingObstacle(*walker, 0.22) for walker in walkers])


def test_nobody_around_and_it_drives_as_it_is_reported():
    assert share() == 1.0


def test_it_slows_down_for_somebody_who_will_cross_its_way():
    assert share((1.0, -0.9, 0.0, 0.6)) < 1.0


def test_it_drives_on_where_somebody_will_have_crossed_before_it_comes():
    assert share((1.5, 0.3, 0.0, 0.8)) == 1.0


def test_it_stands_for_somebody_who_comes_towards_it():
    assert share((1.5, 0.0, -0.6, 0.0)) < 0.5


def test_it_does_not_turn_towards_somebody_who_would_walk_into_it_anyway():
    turning = Twist2D(vx=0.22, wz=-0.7)
    assert share((0.72, -0.25, -0.6, 0.2), twist=turning) == 0.0


@pytest.mark.parametrize("walker", [(-1.2, 0.0, 0.7, 0.0), (-0.2, 1.2, 0.0, -0.6)])
def test_it_drives_on_out_of_the_way_of_somebody_who_comes_from_behind_or_aside(walker):
    assert share(walker) == 1.0


def test_it_follows_somebody_who_walks_ahead_as_fast():
    assert share((1.0, 0.0, 0.5, 0.0)) == 1.0


def test_the_frame_of_people_is_that_of_the_pose():
    pose = Pose2D(3.0, -2.0, 2.0)
    (x, y), velocity = pose.apply([1.0, -0.9]), pose.apply([0.0, 0.6]) - pose.xy
    assert share((x, y, *velocity), pose=pose) == share((1.0, -0.9, 0.0, 0.6))


def test_a_base_that_rests_has_nothing_to_slow_down():
    assert share((0.6, 0.0, -0.5, 0.0), twist=Twist2D()) == 1.0


@pytest.mark.parametrize("aside", [1.0, -1.0])
@pytest.mark.parametrize(("gap", "passes"), [(0.19, False), (0.23, True)])
def test_it_passes_who_walks_beside_its_way_with_the_margin_between_them(aside, gap, passes):
    y = aside * (0.25 + 0.22 + gap)
    assert (share((2.0, y, -0.3, 0.0)) == 1.0) == passes


def test_a_person_arriving_beyond_the_prediction_horizon_does_not_slow_the_base():
    assert share((0.3 + 0.22 + 0.2 + 2.2 * 0.5 + 0.1, 0.0, 0.0, 0.0)) == 1.0
    assert share((0.3 + 0.22 + 0.2 + 1.8 * 0.5, 0.0, 0.0, 0.0)) < 1.0


def test_of_several_who_walk_the_worst_one_counts():
    alone = share((1.0, -0.9, 0.0, 0.6))
    assert share((3.0, 3.0, 0.0, 0.5), (1.0, -0.9, 0.0, 0.6), (-3.0, 0.0, 0.5, 0.0)) == alone < 1.0


def test_a_turn_sweeps_its_corners_towards_who_walks_beside():
    turning = Twist2D(wz=0.8)
    corner = (0.0, 0.25 + 0.22 + 0.2 + 0.02, 0.0, 0.0)
    assert share(corner, twist=turning) < 1.0
    assert share(corner, twist=Twist2D(vx=0.01)) == 1.0
