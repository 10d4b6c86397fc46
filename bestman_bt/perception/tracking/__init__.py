"""Identities of objects over views."""

from bestman_bt.perception.tracking.base import Tracked, Tracker
from bestman_bt.perception.tracking.global_nearest_neighbour import (
    THING,
    GlobalNearestNeighbour,
)
from bestman_bt.perception.tracking.presence import Presence, presence

__all__ = [
    "THING",
    "GlobalNearestNeighbour",
    "Presence",
    "Tracked",
    "Tracker",
    "presence",
]
