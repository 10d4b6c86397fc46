"""Handles of doors and drawers."""

from bestman_bt.perception.affordance.base import HandleDetector, HandleScene
from bestman_bt.perception.affordance.front_handles import FrontHandles

__all__ = ["FrontHandles", "HandleDetector", "HandleScene"]
