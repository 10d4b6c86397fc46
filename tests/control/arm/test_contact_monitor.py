"""When a free motion counts as one that has touched something."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.control.arm.arm_controller import ArmController, ContactLimits, ContactMonitor
from bestman_bt.messages import JointTrajectory, MotionErrorCode, Wrench
from tests.control.scripted_parts import ScriptedArm, stepped_clock

FROM, TO = np.array([0.2, -0.5, 1.0]), np.array([1.2, -0.5, 0.0])
SWING = JointTrajectory(
    ("joint_1", "joint_2", "joint_3"),
    np.array([0.0, 1.0]),
    np.array([FROM, TO]),
    np.array([TO - FROM, TO - FROM]),
)


class Wrist:
    def __init__(self, force=(0.0, 0.0, 0.0)) -> None:
        self.force = np.array(force)

    def contact(self) -> Wrench:
        return Wrench(self.force, np.zeros(3), 0.0)


def monitor(wrist: Wrist | None = None, **parameters):
    arm, clock = ScriptedArm(FROM), stepped_clock(time_step=0.01)
    limits = ContactLimits(**({"samples": 1} | parameters))
    return arm, clock, ContactMonitor(arm, clock, wrist, SWING, limits)


@pytest.mark.parametrize("now", [0.0, 0.4, 1.0, 3.0])
@pytest.mark.parametrize("joint", [0, 1, 2])
def test_a_joint_counts_as_held_up_beyond_the_lag_on_either_side_of_its_set_points(now, joint):
    arm, clock, watch = monitor()
    clock.sleep(now)
    between = [SWING.sample(min(1.0, t))[0] for t in (max(0.0, now - 0.02), now)]
    low, high = np.minimum(*between), np.maximum(*between)
    for off, touches in ((high + 0.039, False), (high + 0.041, True), (low - 0.039, False), (low - 0.041, True)):
        arm.at = SWING.sample(min(1.0, now))[0].copy()
        arm.at[joint] = off[joint]
        told = watch.objection()
        assert (told is not None) == touches, off
        assert not touches or f"joint_{joint + 1} is 0.041 rad" in told


def test_an_arm_that_runs_its_trajectory_more_slowly_is_held_against_where_it_is_on_it():
    arm, clock, watch = monitor()
    clock.sleep(0.8)
    arm.time, arm.at = 0.3, SWING.sample(0.3)[0]
    assert watch.objection() is None
    arm.time = None
    assert watch.objection() is not None


def test_an_arm_that_answers_later_than_others_lags_no_more_for_that():
    class Late(ScriptedArm):
        latency = 0.1

    arm, clock = Late(FROM), stepped_clock(time_step=0.01)
    watch = ContactMonitor(arm, clock, None, SWING, ContactLimits(samples=1))
    clock.sleep(0.5)
    arm.at = SWING.sample(0.4)[0]
    assert watch.objection() is None
    arm.at = SWING.sample(0.35)[0]
    assert watch.objection() is not None


def test_a_force_counts_beyond_what_was_held_from_the_start():
    wrist = Wrist((0.0, 12.0, -16.0))  # 20 N that it carries
    _, _, watch = monitor(wrist)
    for force, touches in ((0.0, False), (49.5, False), (50.3, True)):
        wrist.force = force * np.array([0.6, 0.0, 0.8])
        told = watch.objection()
        assert (told is not None) == touches
        assert not touches or "30 N at the wrist" in told


def test_so_many_looks_in_a_row_must_agree():
    wrist = Wrist()
    _, _, watch = monitor(wrist, samples=3)
    answers = []
    for force in (40.0, 40.0, 0.0, 40.0, 40.0, 40.0, 40.0):
        wrist.force = np.array([force, 0.0, 0.0])
        answers.append(watch.objection() is not None)
    assert answers == [False] * 5 + [True, True]


def test_only_a_free_motion_is_watched_for_contact():
    for free in (False, True):
        arm, clock, wrist = ScriptedArm(FROM), stepped_clock(time_step=1 / 60), Wrist()
        controller = ArmController(arm, clock, wrist=wrist)
        handle = controller.follow(SWING, free=free)
        wrist.force = np.array([0.0, 0.0, 60.0])
        clock.sleep(0.05)
        assert handle.done == free
        assert arm.stops == free
        if free:
            assert handle.failure.code is MotionErrorCode.COLLISION
