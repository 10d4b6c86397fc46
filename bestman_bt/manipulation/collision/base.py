"""Collision worlds: what an arm may touch, asked by joint positions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.planning_scene import PlanningScene


class CollisionWorld(ABC):
    """One arm among fixed obstacles; all other joints stand still.

    Names are those of links, obstacles and of the attached object.
    """

    @property
    @abstractmethod
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints, in the order of every (n,) array."""

    @property
    def fingerprint(self) -> str:
        """The same text for worlds that answer alike; empty where a world cannot tell."""
        return ""

    @abstractmethod
    def is_free(self, positions: ArrayLike) -> bool:
        """Return whether nothing is nearer than its padding at ``positions`` (n,), radians.

        A Python ``bool``. Raises ManipulationError if ``positions`` has the wrong shape or is not finite.
        """

    @abstractmethod
    def colliding_pairs(self, positions: ArrayLike) -> tuple[tuple[str, str], ...]:
        """The sorted pairs of names that are nearer than their padding at ``positions`` (n,)."""

    @abstractmethod
    def distance(self, positions: ArrayLike) -> float:
        """Smallest distance of any checked pair at ``positions`` (n,), metres; negative where bodies overlap.

        Padding is not subtracted. Infinite if nothing is checked.
        """

    def clearance(self, positions: ArrayLike) -> float:
        """Return how far from touching at ``positions`` (n,), metres: the smallest distance beyond a pair's padding.

        Negative where ``is_free`` is false. A world that cannot tell the padding of its pairs gives the distance.
        """
        return self.distance(positions)

    def nearest_pair(self, positions: ArrayLike) -> tuple[str, str] | None:
        """Return the two bodies, one of them none of the robot's links, that are nearest to touching at ``positions``
        (n,).

        None if there are none. A world that cannot tell gives a pair that collides.
        """
        return next(iter(self.colliding_pairs(positions)), None)

    def bodies(self, positions: ArrayLike) -> Sequence[tuple[str, NDArray[np.float64]]]:
        """Name and corners (N, 3), metres in the base frame, of each convex body at ``positions`` (n,), for pictures.

        None of a world that has no shapes to show.
        """
        return ()


class CollisionModel(ABC):
    """The geometry of a robot, prepared once, from which collision worlds are made cheaply."""

    @abstractmethod
    def world(self, scene: PlanningScene, arm: str = "arm") -> CollisionWorld:
        """Return the world of ``arm`` in ``scene``. Raises ManipulationError naming an unknown joint, link or arm."""
