"""Tactile sensing."""

from bestman_bt.sensing.tactile.tactile_sensor import TactileParameters, TactileSensor

__all__ = ["TactileParameters", "TactileSensor"]
