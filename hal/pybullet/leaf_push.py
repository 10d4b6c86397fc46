"""Somebody's hand at a door or drawer: a motor of its joint, as strong as an arm, for as long as it pushes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bestman_bt.messages import JointKind
from bestman_bt.scene import LATCH_TRAVEL, Articulation
from hal.pybullet.client import PhysicsClient
from hal.pybullet.package import pybullet

ARRIVED: dict[JointKind, float] = {"revolute": math.radians(1.0), "prismatic": 0.004}
"""Radians or metres from its goal at which it lets go; less than a latch holds on."""


@dataclass(frozen=True)
class Push:
    """``place``: body and joint. It moves ``to`` (radians or metres open) at ``speed`` (per second).

    ``effort``: N m or N at most, beyond the friction of the joint.
    """

    place: tuple[int, int]
    leaf: Articulation
    to: float
    speed: float
    effort: float


class Hand:
    """Pushes doors and drawers; made before ``close_truth``, its commands are free, later they are counted."""

    def __init__(self, client: PhysicsClient) -> None:
        self._read: Callable[..., Any] = client.function("getJointState")
        self._drive: Callable[..., Any] = client.function("setJointMotorControl2")

    def push(self, push: Push) -> bool:
        """Push on for one control period; True, and lets go, once it has arrived."""
        left = push.to - self._read(*push.place)[0]
        if abs(left) < ARRIVED[push.leaf.kind]:
            self.rest(push)
            return True
        self._turn(push, math.copysign(push.speed, left), push.leaf.friction + push.effort)
        return False

    def rest(self, push: Push) -> None:
        """Let go of it: its friction, and near the closed position its latch, are what holds it again."""
        leaf = push.leaf
        caught = abs(self._read(*push.place)[0]) < LATCH_TRAVEL[leaf.kind]
        self._turn(push, 0.0, leaf.friction + leaf.latch if caught else leaf.friction)

    def _turn(self, push: Push, speed: float, effort: float) -> None:
        self._drive(*push.place, pybullet.VELOCITY_CONTROL, targetVelocity=speed, force=effort)
