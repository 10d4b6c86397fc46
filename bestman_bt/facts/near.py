"""``near``, ``tucked``: the place of the base, and whether it may drive."""

from __future__ import annotations

import math

from bestman_bt.facts.predicate import Beliefs, Predicate

NEAR = 1.2
"""Metres between the middle of the base and the footprint of furniture at which the base stands at it."""


def _near(beliefs: Beliefs, place: str) -> bool:
    furniture, _ = beliefs.world.map.surface(place)
    inside = furniture.pose.inverse().apply(beliefs.world.base.pose.xy[None])[0]
    beyond = [max(0.0, abs(float(at)) - size / 2) for at, size in zip(inside, furniture.footprint, strict=True)]
    return math.hypot(*beyond) <= NEAR


NEAR_TO = Predicate("near", {"place": "place"}, "the base stands at the {place}", _near)
TUCKED = Predicate("tucked", {}, "the arm is in its posture for driving", lambda beliefs: beliefs.tucked)
