"""What a UR controller tells of its state, in our words; its numbers are kept."""

from __future__ import annotations

from hal.api import Failure, MotionErrorCode
from hal.ur.sdk_process import PLAYING, RUNNING, Report

SAFETY_MODES = {
    1: "normal",
    2: "reduced",
    3: "protective stop",
    4: "recovery mode",
    5: "safeguard stop",
    6: "system emergency stop",
    7: "robot emergency stop",
    8: "violation of a safety limit",
    9: "fault of the safety system",
    10: "joint identification",
    11: "undefined safety mode",
    12: "automatic mode safeguard stop",
    13: "three-position enabling stop",
}
ROBOT_MODES = {
    -1: "no controller",
    0: "disconnected",
    1: "safety to be confirmed",
    2: "booting",
    3: "power off",
    4: "powering on",
    5: "idle, with closed brakes",
    6: "backdrive",
    7: "running",
    8: "updating firmware",
}
WELL = frozenset({1, 2})
PROTECTIVE_STOP = 3
STOPPED_BY_PEOPLE = frozenset({5, 6, 7, 12, 13})


def fault_of(report: Report) -> Failure | None:
    """Why the controller cannot be commanded, None where it can."""
    safety, mode = report.safety_mode, report.robot_mode
    if safety not in WELL:
        if safety == PROTECTIVE_STOP:
            code = MotionErrorCode.COLLISION
        elif safety in STOPPED_BY_PEOPLE:
            code = MotionErrorCode.STOPPED
        else:
            code = MotionErrorCode.FAULT
        return Failure(code, SAFETY_MODES.get(safety, "unknown safety mode"), vendor_code=f"safety mode {safety}")
    if mode != RUNNING:
        return Failure(
            MotionErrorCode.FAULT, ROBOT_MODES.get(mode, "unknown robot mode"), vendor_code=f"robot mode {mode}"
        )
    if report.runtime_state != PLAYING and not report.busy:
        text = "the program on the controller has ended"
        return Failure(MotionErrorCode.FAULT, text, vendor_code=f"runtime state {report.runtime_state}")
    return None
