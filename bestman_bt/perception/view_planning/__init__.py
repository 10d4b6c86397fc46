"""Views that would tell more about an object."""

from bestman_bt.perception.view_planning.base import RankedView, ViewPlanner

__all__ = ["RankedView", "ViewPlanner"]
