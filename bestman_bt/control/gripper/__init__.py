"""Gripper control."""

from bestman_bt.control.gripper.gripper_controller import GripperController, GripperOutcome, GripperParameters

__all__ = ["GripperController", "GripperOutcome", "GripperParameters"]
