"""Arm control."""

from bestman_bt.control.arm.arm_controller import ArmController, ArmMoving, ContactLimits, ContactMonitor
from bestman_bt.control.arm.arm_ways import ArmWays, Passing
from bestman_bt.control.arm.constraint_following import (
    FollowedMotion,
    FollowEnd,
    FollowGoal,
    FollowGuide,
    Following,
)
from bestman_bt.control.arm.guarded_move import GuardedOutcome, Guarding, Streaming
from bestman_bt.control.arm.joint_axis import AxisFitting, JointAxis, JointAxisEstimator

__all__ = [
    "ArmController",
    "ArmMoving",
    "ArmWays",
    "AxisFitting",
    "ContactLimits",
    "ContactMonitor",
    "FollowEnd",
    "FollowGoal",
    "FollowGuide",
    "FollowedMotion",
    "Following",
    "GuardedOutcome",
    "Guarding",
    "JointAxis",
    "JointAxisEstimator",
    "Passing",
    "Streaming",
]
