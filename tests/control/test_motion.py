"""A motion ends once; a controller's ends as the part's does, and knows why a command was refused."""

from __future__ import annotations

import pytest

from bestman_bt.control.motion import ControlledMotion, start_motion
from hal.api import (
    CommandRefusedError,
    Failure,
    Motion,
    MotionErrorCode,
    MotionStatus,
    NoDataError,
    NotConnectedError,
    RobotStoppedError,
)
from tests.control.scripted_parts import ScriptedMotion


def test_a_final_status_never_changes():
    motion: Motion[int] = Motion()
    motion.succeed(3)
    motion.fail(MotionErrorCode.FAULT, "too late")
    motion.cancel()
    assert (motion.status, motion.result, motion.failure) == (MotionStatus.SUCCEEDED, 3, None)


def test_cancelling_brings_the_part_to_rest_once():
    calls = []
    motion: Motion[None] = Motion("arm", lambda: calls.append("stop"))
    motion.cancel()
    motion.cancel()
    assert calls == ["stop"]
    assert motion.status is MotionStatus.CANCELED
    assert motion.failure.code is MotionErrorCode.CANCELED


def test_a_failure_carries_code_text_part_and_what_was_found_out():
    motion: Motion[int] = Motion("base")
    motion.fail(MotionErrorCode.BLOCKED, "a chair stands in the way", 3)
    assert (motion.status, motion.result) == (MotionStatus.FAILED, 3)
    assert motion.failure == Failure(MotionErrorCode.BLOCKED, "a chair stands in the way", "base")


def test_a_failure_of_another_part_stays_what_it_is():
    motion: Motion[None] = Motion("base")
    struck = Failure(MotionErrorCode.COLLISION, "the current is too high", "arm", "C31")
    motion.end(MotionStatus.FAILED, struck)
    assert motion.failure is struck


@pytest.mark.parametrize("status", [MotionStatus.FAILED, MotionStatus.CANCELED])
@pytest.mark.parametrize("code", MotionErrorCode)
def test_a_motion_that_does_not_succeed_reports_its_code_and_words(status, code):
    motion = ScriptedMotion()
    handle = ControlledMotion("arm", motion, lambda: 1)
    assert not handle.done
    motion.end(status, Failure(code, "because"))
    assert handle.failure.code.value == code.value
    assert (handle.status, handle.failure.text, handle.result) == (status, "because", None)


def test_the_result_is_read_once_when_the_motion_has_succeeded():
    motion, reads = ScriptedMotion(), []
    handle = ControlledMotion("arm", motion, lambda: reads.append("read") or len(reads))
    assert (handle.status, handle.result, reads) == (MotionStatus.RUNNING, None, [])
    motion.succeed()
    assert handle.result == 1
    assert (handle.status, handle.result, handle.failure) == (MotionStatus.SUCCEEDED, 1, None)
    assert reads == ["read"]


def test_a_cancel_reaches_the_motion_once_and_one_that_has_ended_not_at_all():
    motion = ScriptedMotion()
    handle = ControlledMotion("arm", motion)
    handle.cancel()
    handle.cancel()
    assert motion.cancels == 1
    assert (handle.status, handle.failure.code) == (MotionStatus.CANCELED, MotionErrorCode.CANCELED)
    ended = ScriptedMotion()
    handle = ControlledMotion("arm", ended)
    ended.succeed()
    handle.cancel()
    assert (ended.cancels, handle.status) == (0, MotionStatus.SUCCEEDED)


def test_a_motion_that_fails_without_a_word_is_a_fault():
    motion = ScriptedMotion()
    handle = ControlledMotion("arm", motion)
    motion.end(MotionStatus.FAILED, None)
    assert (handle.status, handle.failure.code) == (MotionStatus.FAILED, MotionErrorCode.FAULT)


def test_a_guard_s_verdict_stays_although_the_motion_is_then_stopped():
    motion = ScriptedMotion()
    handle = ControlledMotion("arm", motion)
    handle.fail(MotionErrorCode.GUARDED, "it slipped")
    motion.abort(MotionErrorCode.STOPPED, "stopped")
    assert (handle.status, handle.failure.code) == (MotionStatus.FAILED, MotionErrorCode.GUARDED)


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (CommandRefusedError("no", "hand", "G9"), MotionErrorCode.REFUSED),
        (NotConnectedError("no", "hand", "G9"), MotionErrorCode.DISCONNECTED),
        (NoDataError("no", "hand", "G9"), MotionErrorCode.NO_DATA),
        (RobotStoppedError("no", "hand", "G9"), MotionErrorCode.STOPPED),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_command_that_cannot_be_given_is_a_handle_that_has_failed(error, code):
    def command():
        raise error

    handle = start_motion("arm", command)
    assert (handle.status, handle.failure) == (MotionStatus.FAILED, Failure(code, "no", "hand", "G9"))
