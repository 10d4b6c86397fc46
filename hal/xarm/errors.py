"""The controller's error numbers in our words; the numbers are kept."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

from hal.api import Failure, MotionErrorCode

COLLISION = frozenset({22, 31})
"""Self-collision, and the current that a collision caused: the controller's protective stop."""
TRACKING = frozenset({30, 38})
"""Feedback speed beyond its limit, abnormal joint angle."""
STOP_BUTTONS = frozenset({1, 2, 3})


def controller_fault(number: int, load: Callable[[str], ModuleType]) -> Failure:
    """The fault for error ``C<number>`` of the controller; its words are the vendor's."""
    if number in COLLISION:
        code = MotionErrorCode.COLLISION
    elif number in TRACKING:
        code = MotionErrorCode.TRACKING
    elif number in STOP_BUTTONS:
        code = MotionErrorCode.STOPPED
    else:
        code = MotionErrorCode.FAULT
    words = load("xarm.core.config.x_code").ControllerErrorCodeMap
    return Failure(code, _title(words, number), vendor_code=f"C{number}")


def gripper_fault(number: int, load: Callable[[str], ModuleType]) -> Failure:
    """The fault for error ``G<number>`` of the gripper."""
    words = load("xarm.core.config.x_code").GripperErrorCodeMap
    return Failure(MotionErrorCode.FAULT, _title(words, number), vendor_code=f"G{number}")


def _title(words: dict[object, dict[str, dict[str, str]]], number: int) -> str:
    return words.get(number, words["other"])["en"]["title"]
