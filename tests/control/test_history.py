"""Values of the last seconds: between two, at the ends, and outside."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.control.history import BEFORE, History, NotRecordedError, pose_between, positions_between
from bestman_bt.messages import Pose2D


def recorded() -> History[Pose2D]:
    history = History(pose_between, duration=1.0, hold=0.1)
    for number in range(31):
        history.add(10.0 + 0.1 * number, Pose2D(number, -number, 3.0 + 0.1 * number))
    return history


def test_between_two_values_it_interpolates_and_turns_the_shorter_way() -> None:
    history = recorded()
    pose = history.at(12.53)
    assert pose.xy == pytest.approx((25.3, -25.3))
    assert math.remainder(pose.theta - 5.53, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert pose_between(Pose2D(0, 0, 3.0), Pose2D(0, 0, -3.0), 0.25).theta == pytest.approx(3.0708, abs=1e-4)


@pytest.mark.parametrize("stamp", [11.85, 13.11, math.nan])
def test_outside_of_what_is_kept_nothing_is_reported(stamp: float) -> None:
    with pytest.raises(NotRecordedError):
        recorded().at(stamp)


def test_the_newest_value_holds_for_a_moment_and_the_oldest_kept_is_a_duration_old() -> None:
    history = recorded()
    assert history.at(13.09).xy == pytest.approx((30, -30))
    assert history.at(12.0).xy == pytest.approx((20, -20))


def test_the_first_value_counts_for_the_moment_before_it() -> None:
    history: History[float] = History(lambda first, second, share: first + share * (second - first))
    with pytest.raises(NotRecordedError, match="nothing is recorded"):
        history.at(0.0)
    history.add(5.0, 1.0)
    assert history.at(5.0 - BEFORE) == 1.0
    with pytest.raises(NotRecordedError, match="before the oldest"):
        history.at(4.9 - BEFORE)


def test_a_clock_that_was_set_back_goes_on_from_there() -> None:
    history = recorded()
    history.add(12.45, Pose2D(-1, -1, 0))
    assert history.at(12.45).xy == pytest.approx((-1, -1))
    assert history.at(12.3).xy == pytest.approx((23, -23))
    with pytest.raises(NotRecordedError, match="after the newest"):
        history.at(12.8)


def test_positions_of_joints_by_name() -> None:
    between = positions_between({"pan": 0.0, "tilt": 1.0}, {"pan": 1.0, "wrist": 3.0}, 0.25)
    assert dict(between) == pytest.approx({"pan": 0.25, "tilt": 1.0, "wrist": 3.0})
    assert np.isfinite(list(between.values())).all()
