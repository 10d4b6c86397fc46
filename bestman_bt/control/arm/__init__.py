"""Arm control."""

from bestman_bt.control.arm.arm_controller import ArmController
from bestman_bt.control.arm.constraint_following import (
    ConstraintFollowingParameters,
    FollowedMotion,
    FollowEnd,
    FollowGuide,
)
from bestman_bt.control.arm.contact_monitor import ContactMonitor, ContactMonitorParameters
from bestman_bt.control.arm.guarded_move import GuardedMoveParameters, GuardedOutcome
from bestman_bt.control.arm.impedance import ImpedanceController, ImpedanceParameters
from bestman_bt.control.arm.joint_axis import JointAxis, JointAxisEstimator, JointAxisParameters
from bestman_bt.control.arm.tool_stream import ToolStreamParameters

__all__ = [
    "ArmController",
    "ConstraintFollowingParameters",
    "ContactMonitor",
    "ContactMonitorParameters",
    "FollowEnd",
    "FollowGuide",
    "FollowedMotion",
    "GuardedMoveParameters",
    "GuardedOutcome",
    "ImpedanceController",
    "ImpedanceParameters",
    "JointAxis",
    "JointAxisEstimator",
    "JointAxisParameters",
    "ToolStreamParameters",
]
