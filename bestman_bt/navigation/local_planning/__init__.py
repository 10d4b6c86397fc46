"""Local planning: path followers."""

from bestman_bt.navigation.local_planning.base import FollowerCommand, PathFollower
from bestman_bt.navigation.local_planning.pure_pursuit import PurePursuit, PurePursuitParameters
from bestman_bt.navigation.local_planning.rotate_to_heading import RotateToHeading, RotateToHeadingParameters

__all__ = [
    "FollowerCommand",
    "PathFollower",
    "PurePursuit",
    "PurePursuitParameters",
    "RotateToHeading",
    "RotateToHeadingParameters",
]
