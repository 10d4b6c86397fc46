from __future__ import annotations

from bestman_bt.control import ControlHandle, ControlStatus
from bestman_bt.messages import MotionErrorCode


def test_a_final_status_never_changes():
    handle: ControlHandle[int] = ControlHandle()
    handle.succeed(3)
    handle.fail(MotionErrorCode.FAULT, "too late")
    handle.cancel()
    assert (handle.status, handle.result, handle.error) == (ControlStatus.SUCCEEDED, 3, None)


def test_cancelling_brings_the_part_to_rest_once():
    calls = []
    handle: ControlHandle[None] = ControlHandle("arm", lambda: calls.append("stop"))
    handle.cancel()
    handle.cancel()
    assert calls == ["stop"]
    assert handle.status is ControlStatus.CANCELED
    assert handle.error.code is MotionErrorCode.CANCELED


def test_a_failure_carries_code_and_text():
    handle: ControlHandle[None] = ControlHandle()
    handle.fail(MotionErrorCode.BLOCKED, "a chair stands in the way")
    assert handle.done
    assert (handle.error.code.value, handle.error.text) == ("blocked", "a chair stands in the way")
