"""Velocities of a planar base."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Twist2D:
    """Velocity in the base frame: ``vx`` forward and ``vy`` left in m/s, ``wz`` counter-clockwise in rad/s."""

    vx: float = 0.0
    vy: float = 0.0
    wz: float = 0.0
