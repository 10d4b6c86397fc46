"""Walking people: upright cylinders on closed routes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Walker:
    """``route``: closed polygon of points in the map frame, metres, walked without end from the first one.

    ``radius``, ``height`` in metres, ``mass`` in kilograms, ``speed`` in m/s. ``considerate``: it stops for the robot
    and other walkers; otherwise it walks on.
    """

    name: str
    radius: float
    height: float
    mass: float
    speed: float
    route: tuple[tuple[float, float], ...]
    considerate: bool = True
