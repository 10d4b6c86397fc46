"""Approaches on two slides: which world each part is asked in, and what is left out."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.motion_planning.approach import ApproachPoses, approaches
from tests.manipulation.kinematics.slides import Slides, at
from tests.manipulation.motion_planning.joint_worlds import JointWorld

FREE = JointWorld(lambda q: True)


def found(free=FREE, contact=FREE, count=2, reference=(0.0, 0.0)):
    rng = np.random.default_rng(0)
    return list(
        approaches(Slides(), ApproachPoses(at(0.4), at(0.6), at(0.5, yaw=0.0)), reference, free, contact, rng, count)
    )


def test_an_approach_goes_straight_into_contact_and_straight_out_of_it():
    first, second = found()
    assert first.pre == pytest.approx([0.2, 0.2])
    assert first.into.sum(axis=1) == pytest.approx(np.linspace(0.4, 0.6, 21))
    assert first.out.sum(axis=1) == pytest.approx(np.linspace(0.6, 0.5, 11))
    assert np.array_equal(first.into[0], first.pre)
    assert np.array_equal(first.out[0], first.into[-1])
    assert first.cost == pytest.approx(0.2 + 0.3 * np.hypot(0.2, 0.2))
    assert second.pre == pytest.approx([0.5, -0.1])
    assert second.cost > first.cost


def test_the_place_beside_the_goal_is_asked_in_the_world_in_which_nothing_may_be_touched():
    assert [one.pre[0] for one in found(free=JointWorld(lambda q: q[0] > 0.4))] == pytest.approx([0.5])
    assert found(free=JointWorld(lambda q: False)) == []
    assert len(found(free=JointWorld(lambda q: q.sum() < 0.45))) == 2


@pytest.mark.parametrize("blocked", [0.55, 0.6])
def test_both_straight_motions_are_asked_in_the_world_of_contact(blocked):
    assert found(contact=JointWorld(lambda q: abs(q.sum() - blocked) > 1e-6)) == []


def test_an_approach_that_cannot_be_left_is_none():
    """In, the hand is free; on its way out it is not, since it has grasped by then."""
    passed = []

    def is_free(q):
        passed.append(q.sum())
        return len([x for x in passed if x > 0.5999]) == 0 or q.sum() > 0.5999

    assert found(contact=JointWorld(is_free), count=1) == []
