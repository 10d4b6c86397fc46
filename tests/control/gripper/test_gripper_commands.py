"""What a gripper is told, and what counts as held, without physics."""

from __future__ import annotations

import pytest

from bestman_bt.control.gripper import GripperController
from hal.api import MotionErrorCode, MotionStatus, NotConnectedError
from tests.control.scripted_parts import ScriptedGripper


@pytest.fixture
def gripper() -> ScriptedGripper:
    return ScriptedGripper()


def test_widths_forces_and_speeds_reach_the_gripper(gripper):
    controller = GripperController(gripper)
    controller.open()
    controller.open(0.03, 0.05)
    controller.close()
    controller.close(20.0, 0.01)
    assert gripper.moves == [
        (0.08, None, None),
        (0.03, None, 0.05),
        (0.004, None, 0.1),
        (0.004, 20.0, 0.01),
    ]
    GripperController(gripper, closing_speed=0.5).close()
    assert gripper.moves[-1] == (0.004, None, 0.15)


@pytest.mark.parametrize(("width", "target"), [(0.03, 0.046), (0.07, 0.08)])
def test_a_release_opens_a_little_beyond_the_present_width_and_slowly(gripper, width, target):
    gripper.opening = width
    GripperController(gripper).release()
    ((to, force, speed),) = gripper.moves
    assert (to, force, speed) == (pytest.approx(target), None, 0.02)


def test_a_slip_watch_speaks_when_the_fingers_press_no_more_or_move_either_way(gripper):
    gripper.opening, gripper.held = 0.04, True
    controller = GripperController(gripper)
    watch, narrow = controller.watch_slip(), controller.watch_slip(0.0005)
    for width, slips in ((0.0429, False), (0.0371, False), (0.0431, True), (0.0369, True), (0.04, False)):
        gripper.opening = width
        assert (watch() is not None) == slips
        assert (narrow() is not None) == (width != 0.04)
    gripper.opening = 0.0345
    assert "slips: the width went by -5.5 mm" in watch()
    gripper.held = False
    assert "no longer holds anything" in watch()


def test_a_grasp_reports_where_the_fingers_came_to_rest_and_a_cancel_reaches_them(gripper):
    controller = GripperController(gripper)
    handle = controller.close()
    gripper.opening, gripper.held = 0.033, True
    gripper.motion.succeed()
    assert handle.status is MotionStatus.SUCCEEDED
    gripper.opening = 0.05
    assert (handle.result.width, handle.result.object_held) == (0.033, True)
    first = controller.open()
    moving = gripper.motion
    first.cancel()
    assert moving.cancels == 1
    second = controller.open()
    first.cancel()
    assert not second.done, "a second goal after a cancel is its own"
    third = controller.close()
    assert (second.status, second.failure.code) == (MotionStatus.CANCELED, MotionErrorCode.SUPERSEDED)
    controller.stop()
    assert (gripper.stops, third.failure.code) == (1, MotionErrorCode.STOPPED)


def test_a_gripper_that_fails_or_is_gone_reports_it(gripper):
    controller = GripperController(gripper)
    handle = controller.close()
    gripper.motion.fail(MotionErrorCode.TIMEOUT, "it does not move")
    assert (handle.status, handle.failure.code) == (MotionStatus.FAILED, MotionErrorCode.TIMEOUT)
    gripper.error = NotConnectedError("unplugged")
    assert controller.close().failure.code is MotionErrorCode.DISCONNECTED
