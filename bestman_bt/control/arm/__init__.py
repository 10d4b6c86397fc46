"""Arm control."""

from bestman_bt.control.arm.arm_controller import ArmController

__all__ = ["ArmController"]
