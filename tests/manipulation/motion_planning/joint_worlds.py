"""Collision worlds and constraints that are told by the joint positions alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.motion_planning.base import MotionPlanner
from bestman_bt.manipulation.motion_planning.portfolio import Portfolio
from tests.robot_models import joint_group_model

TWO = joint_group_model(("a", "b"), lower=(-2.0, -1.0), upper=(2.0, 1.5), velocity=(1.0, 2.0), acceleration=(2.0, 5.0))


@dataclass(frozen=True, kw_only=True)
class PortfolioOf(Portfolio):
    """Of planners that a test brings."""

    members: tuple[MotionPlanner, ...]


class JointWorld(CollisionWorld):
    """Free where ``free`` says so; ``asked``: every question. ``depth``: of the clearance, metres per radian of a."""

    def __init__(self, free: Callable[[np.ndarray], bool], names: tuple[str, ...] = TWO.joint_names) -> None:
        self._free, self._names = free, names
        self.asked: list[np.ndarray] = []

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self._names

    def is_free(self, positions):
        self.asked.append(np.array(positions))
        return bool(self._free(np.asarray(positions)))

    def colliding_pairs(self, positions):
        return () if self._free(np.asarray(positions)) else (("arm", "wall"),)

    def distance(self, positions):
        return 1.0

    def clearance(self, positions):
        return 1.0


class Kept:
    """A constraint that is planned with ``planned`` and that a timed motion may break no further than ``timed``."""

    description = "b kept low"

    def __init__(self, planned: float, timed: float) -> None:
        self.planned, self.timed = planned, timed

    def satisfied(self, positions):
        return bool(positions[1] <= self.planned)

    def tolerated(self, positions):
        return bool(positions[1] <= self.timed)
