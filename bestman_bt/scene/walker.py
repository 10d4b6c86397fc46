"""People who walk about: upright cylinders, each on a round of its own."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Walker:
    """``route``: points in the map frame, metres, a closed round that begins at the first one and goes on without end.

    ``radius``, ``height`` in metres, ``mass`` in kilograms, ``speed`` in m/s. ``considerate``: it stops before the
    robot and before other walkers; another one walks on as if nobody was there.
    """

    name: str
    radius: float
    height: float
    mass: float
    speed: float
    route: tuple[tuple[float, float], ...]
    considerate: bool = True
