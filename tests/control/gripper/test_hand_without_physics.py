"""A hand of two joints that follow their torques, or are held by a script: commands, ends, stops, the second time."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from bestman_bt.control import MotionStatus
from bestman_bt.control.hand_synergy import HandSynergy, SynergyParameters
from bestman_bt.messages import MotionErrorCode
from bestman_bt.robot_model import JointGroupModel
from hal.api import CommandRefusedError, JointGroup, Motion
from tests.control.scripted_parts import stepped_clock
from tests.robot_models import joint_group_model

OPENED, CLOSED = np.array([0.2, -0.1]), np.array([1.2, 0.9])


class Fingers(JointGroup):
    """Joints that turn as fast as their torque says; ``stuck``: something holds them, ``shaking``: no rest."""

    def __init__(self) -> None:
        super().__init__("hand")
        self.clock = stepped_clock(self._step, 1 / 240)
        self.at, self.speed, self.torque = OPENED.copy(), np.zeros(2), np.zeros(2)
        self.stuck, self.shaking = np.array([False, False]), 0.0
        self.error: Exception | None = None
        self.stops = 0
        self.commands: list[NDArray[np.float64]] = []

    @property
    def model(self) -> JointGroupModel:
        return joint_group_model(("first", "second"), upper=2.0, velocity=5.0, acceleration=50.0, effort=(0.7, 0.3))

    def positions(self) -> NDArray[np.float64]:
        return self.at.copy()

    def velocities(self) -> NDArray[np.float64]:
        return self.speed + self.shaking

    def efforts(self) -> NDArray[np.float64]:
        return self.torque

    def command(
        self,
        positions: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        efforts: ArrayLike | None = None,
    ) -> None:
        if self.error is not None:
            raise self.error
        self.torque = np.asarray(efforts, float)
        self.commands.append(self.torque)

    def move_to(self, positions: ArrayLike, speed_scale: float = 1.0) -> Motion:
        raise NotImplementedError  # no test calls it

    def stop(self) -> None:
        self.stops += 1
        self.torque = np.zeros(2)

    def _step(self) -> None:
        self.speed = np.where(self.stuck, 0.0, 10.0 * self.torque)
        self.at = self.at + self.speed / 240.0


def wait(hand: Fingers, handle, limit: float = 6.0):
    end = hand.clock.now() + limit
    while not handle.done and hand.clock.now() < end:
        hand.clock.sleep(1 / 240)
    return handle


@pytest.fixture
def hand() -> Fingers:
    return Fingers()


def test_it_closes_part_of_the_way_and_opens_again_each_in_its_time(hand):
    synergy = HandSynergy(hand, hand.clock, OPENED, CLOSED)
    for closure, seconds in ((0.5, 0.5), (0.0, 0.5), (1.0, 1.0)):
        begin = hand.clock.now()
        handle = wait(hand, synergy.move(closure))
        assert handle.status is MotionStatus.SUCCEEDED, handle.failure
        assert seconds + 0.1 <= hand.clock.now() - begin + 1e-6 < seconds + 1.0
        assert handle.result.closure == pytest.approx(closure, abs=0.06)
        assert not handle.result.object_held
    assert synergy.closure() == pytest.approx(1.0, abs=0.06)
    assert hand.at == pytest.approx(CLOSED, abs=0.07)


def test_what_is_held_keeps_being_pressed_with_no_more_than_was_asked_for(hand):
    synergy = HandSynergy(hand, hand.clock, OPENED, CLOSED)
    hand.stuck[:] = True
    for force, most in ((2.0, [0.18, 0.18]), (None, [0.7, 0.3]), (100.0, [0.7, 0.3])):
        handle = wait(hand, synergy.close(force))
        assert handle.result.object_held
        assert hand.torque == pytest.approx(np.array(most), abs=1e-9)
        hand.clock.sleep(0.5)
        assert hand.torque == pytest.approx(np.array(most), abs=1e-9)


def test_one_finger_alone_may_be_blocked_and_a_newer_command_goes_on_from_the_present_set_point(hand):
    synergy = HandSynergy(hand, hand.clock, OPENED, CLOSED)
    hand.stuck[1] = True
    first = synergy.close()
    hand.clock.sleep(0.5)
    second = synergy.close()
    assert (first.status, first.failure.code) == (MotionStatus.CANCELED, MotionErrorCode.SUPERSEDED)
    begin = hand.clock.now()
    assert wait(hand, second).result.object_held
    assert hand.clock.now() - begin < 0.95, "half of the way had been made"
    first.cancel()
    assert hand.stops == 0


def test_fingers_that_do_not_come_to_rest_time_out_each_time_anew(hand):
    synergy = HandSynergy(hand, hand.clock, OPENED, CLOSED)
    hand.shaking = 0.2
    for _ in range(2):
        handle = synergy.close()
        hand.clock.sleep(3.9)
        assert not handle.done
        hand.clock.sleep(0.2)
        assert (handle.status, handle.failure.code) == (MotionStatus.FAILED, MotionErrorCode.TIMEOUT)
    hand.shaking = 0.1
    assert wait(hand, synergy.open()).status is MotionStatus.SUCCEEDED


def test_rest_must_last_and_begins_anew_with_each_movement(hand):
    synergy = HandSynergy(hand, hand.clock, OPENED, CLOSED, SynergyParameters(settle_time=0.3))
    handle = synergy.move(0.0)
    for _ in range(6):
        hand.clock.sleep(0.2)
        hand.shaking = 0.5
        hand.clock.sleep(2 / 240)
        hand.shaking = 0.0
        assert not handle.done
    hand.clock.sleep(0.35)
    assert handle.done


@pytest.mark.parametrize("how", ["cancel", "stop"])
def test_a_hand_that_is_cancelled_is_stopped_and_commanded_no_more_until_the_next_time(hand, how):
    synergy = HandSynergy(hand, hand.clock, OPENED, CLOSED)
    handle = synergy.close()
    hand.clock.sleep(0.3)
    handle.cancel() if how == "cancel" else synergy.stop()
    assert hand.stops == 1
    assert handle.failure.code is (MotionErrorCode.CANCELED if how == "cancel" else MotionErrorCode.STOPPED)
    commands = len(hand.commands)
    hand.at = np.array([0.9, 0.6])  # moved by somebody meanwhile
    hand.clock.sleep(0.5)
    assert len(hand.commands) == commands
    second = synergy.close()
    assert np.abs(hand.torque).max() < 0.1, "it goes on from where the fingers are"
    assert wait(hand, second).status is MotionStatus.SUCCEEDED
    assert hand.stops == 1


def test_a_command_that_is_refused_ends_it_as_stopped(hand):
    synergy = HandSynergy(hand, hand.clock, OPENED, CLOSED)
    handle = synergy.close()
    hand.clock.sleep(0.2)
    hand.error = CommandRefusedError("the robot is stopped")
    hand.clock.sleep(0.1)
    assert (handle.status, handle.failure.code) == (MotionStatus.CANCELED, MotionErrorCode.STOPPED)
    hand.error = None
    commands = len(hand.commands)
    hand.clock.sleep(0.2)
    assert len(hand.commands) == commands
