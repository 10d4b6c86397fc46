"""A handle over a motion of the hardware layer ends as the motion does, and knows why a command was refused."""

from __future__ import annotations

import pytest

from bestman_bt.control import ControlStatus
from bestman_bt.control.handle import MotionHandle, start_motion
from bestman_bt.control.joint_state import JointStateError
from hal.api import CommandRefusedError, MotionErrorCode, MotionStatus, NoDataError, NotConnectedError
from tests.control.scripted_parts import ScriptedMotion


@pytest.mark.parametrize(
    ("status", "expected"),
    [(MotionStatus.FAILED, ControlStatus.FAILED), (MotionStatus.CANCELED, ControlStatus.CANCELED)],
)
@pytest.mark.parametrize("code", MotionErrorCode)
def test_a_motion_that_does_not_succeed_tells_its_code_and_words(status, expected, code):
    motion = ScriptedMotion()
    handle = MotionHandle("arm", motion, lambda: 1)
    assert not handle.done
    motion.end(status, code, "because")
    assert handle.error.code.value == code.value
    assert (handle.status, handle.error.text, handle.result) == (expected, "because", None)


def test_the_result_is_read_once_when_the_motion_has_succeeded():
    motion, reads = ScriptedMotion(), []
    handle = MotionHandle("arm", motion, lambda: reads.append("read") or len(reads))
    assert (handle.status, handle.result, reads) == (ControlStatus.RUNNING, None, [])
    motion.end(MotionStatus.SUCCEEDED)
    assert handle.result == 1
    assert (handle.status, handle.result, handle.error) == (ControlStatus.SUCCEEDED, 1, None)
    assert reads == ["read"]


def test_a_cancel_reaches_the_motion_once_and_one_that_has_ended_not_at_all():
    motion = ScriptedMotion()
    handle = MotionHandle("arm", motion)
    handle.cancel()
    handle.cancel()
    assert motion.cancels == 1
    assert (handle.status, handle.error.code) == (ControlStatus.CANCELED, MotionErrorCode.CANCELED)
    ended = ScriptedMotion()
    handle = MotionHandle("arm", ended)
    ended.end(MotionStatus.SUCCEEDED)
    handle.cancel()
    assert (ended.cancels, handle.status) == (0, ControlStatus.SUCCEEDED)


def test_a_motion_that_fails_without_a_word_is_a_fault():
    motion = ScriptedMotion()
    handle = MotionHandle("arm", motion)
    motion.end(MotionStatus.FAILED)
    assert (handle.status, handle.error.code) == (ControlStatus.FAILED, MotionErrorCode.FAULT)


def test_a_guard_s_verdict_stays_although_the_motion_is_then_stopped():
    motion = ScriptedMotion()
    handle = MotionHandle("arm", motion)
    handle.fail(MotionErrorCode.GUARDED, "it slipped")
    motion.end(MotionStatus.CANCELED, MotionErrorCode.STOPPED, "stopped")
    assert (handle.status, handle.error.code) == (ControlStatus.FAILED, MotionErrorCode.GUARDED)


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (CommandRefusedError("no"), MotionErrorCode.REFUSED),
        (NotConnectedError("no"), MotionErrorCode.DISCONNECTED),
        (NoDataError("no"), MotionErrorCode.DISCONNECTED),
        (JointStateError("no"), MotionErrorCode.DISCONNECTED),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_command_that_cannot_be_given_is_a_handle_that_has_failed(error, code):
    def command():
        raise error

    handle = start_motion("arm", command)
    assert (handle.status, handle.error.code, handle.error.text) == (ControlStatus.FAILED, code, "no")
