"""What following a door or drawer has found out."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from bestman_bt.control.arm.joint_axis import JointAxis
from bestman_bt.messages import Pose


class FollowEnd(Enum):
    """Why a following ended."""

    REACHED = "reached"
    LOCKED = "locked"  # the force limit was met before it moved
    JAMMED = "jammed"  # it moved, and then the force limit was met: jammed, or at its end
    GRIP_LOST = "grip lost"
    OBSTACLE = "obstacle"  # something pushes the hand aside
    ARM_LIMIT = "arm limit"  # a joint limit or a singularity is ahead
    TIMEOUT = "timeout"


@dataclass(frozen=True, eq=False)
class FollowedMotion:
    """How far the hand went, and about or along what.

    ``axis``: in the base frame. ``distance``: metres along the line or arc. ``angle``: radians about the hinge, 0 for a
    line. ``peak_pull``, ``peak_side``: largest forces along and across the motion, N. ``tool``: base_from_tool at the
    end. ``turned``: radians by which the hand turned about the axis.
    """

    end: FollowEnd
    axis: JointAxis
    distance: float
    angle: float
    peak_pull: float
    peak_side: float
    tool: Pose
    turned: float
