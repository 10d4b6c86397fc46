"""Tactile sensing."""

from bestman_bt.sensing.tactile.tactile_sensor import TactileSensor

__all__ = ["TactileSensor"]
