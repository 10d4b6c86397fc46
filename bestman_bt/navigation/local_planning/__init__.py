"""Local planning: path followers."""

from bestman_bt.navigation.local_planning.base import FollowerCommand, PathFollower

__all__ = ["FollowerCommand", "PathFollower"]
