"""Handles of doors and drawers."""

from bestman_bt.perception.affordance.front_handles import FrontHandles, HandleDetector, HandleScene

__all__ = ["FrontHandles", "HandleDetector", "HandleScene"]
