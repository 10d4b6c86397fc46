"""The gripper's fault numbers in our words; the numbers are kept."""

from __future__ import annotations

from hal.api import Failure, MotionErrorCode

WORDS = {
    5: "an action waits for the activation",
    7: "it is not activated",
    8: "it is too hot",
    9: "it had no communication for a second",
    10: "its supply voltage is too low",
    11: "it releases automatically",
    12: "internal fault",
    13: "its activation failed",
    14: "overcurrent",
    15: "it has released automatically",
}
HARMLESS = frozenset({0, 5, 9})
"""None; an order that came during the activation; and a pause of ours, which the next round trip ends."""


def fault_of(number: int) -> Failure | None:
    """The fault for number ``gFLT``, None where the gripper is well."""
    if number in HARMLESS:
        return None
    return Failure(
        MotionErrorCode.FAULT, f"gripper: {WORDS.get(number, 'unknown fault')}", vendor_code=f"gFLT {number}"
    )
