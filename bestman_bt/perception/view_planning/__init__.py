"""Views that would tell more about an object."""

from bestman_bt.perception.view_planning.base import RankedView, ViewPlanner
from bestman_bt.perception.view_planning.expected_yaw import ExpectedYaw

__all__ = ["ExpectedYaw", "RankedView", "ViewPlanner"]
