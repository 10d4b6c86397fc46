"""Control of grippers and hands."""

from bestman_bt.control.gripper.gripper_controller import GripperController, GripperOutcome, GripperParameters
from bestman_bt.control.gripper.hand_synergy import HandOutcome, HandSynergy, SynergyParameters

__all__ = [
    "GripperController",
    "GripperOutcome",
    "GripperParameters",
    "HandOutcome",
    "HandSynergy",
    "SynergyParameters",
]
