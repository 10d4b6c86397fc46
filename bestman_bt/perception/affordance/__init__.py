"""Handles of doors and drawers."""

from bestman_bt.perception.affordance.base import HandleDetector, HandleScene

__all__ = ["HandleDetector", "HandleScene"]
