"""Collision worlds: collision checks of an arm by joint positions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.planning_scene import PlanningScene


class CollisionWorld(ABC):
    """Collision checks of one arm among fixed obstacles; all other joints are fixed.

    Names are those of links, obstacles and of the attached object.
    """

    @property
    @abstractmethod
    def joint_names(self) -> tuple[str, ...]:
        """The names of the n joints, in the order of every (n,) array."""

    @property
    def fingerprint(self) -> str:
        """A key that is equal for worlds with equal answers; empty if unknown."""
        return ""

    @abstractmethod
    def is_free(self, positions: ArrayLike) -> bool:
        """Return whether every checked pair keeps its padding at ``positions`` (n,), radians.

        Raises ManipulationError if ``positions`` has the wrong shape or is not finite.
        """

    @abstractmethod
    def colliding_pairs(self, positions: ArrayLike) -> tuple[tuple[str, str], ...]:
        """Return the sorted pairs of names that are closer than their padding at ``positions`` (n,), radians."""

    @abstractmethod
    def distance(self, positions: ArrayLike) -> float:
        """Return the smallest distance of any checked pair at ``positions`` (n,), metres; negative if bodies overlap.

        Padding is not subtracted. Infinite if nothing is checked.
        """

    def clearance(self, positions: ArrayLike) -> float:
        """Return the clearance at ``positions`` (n,), metres: the smallest distance minus the padding of the pair.

        Negative if ``is_free`` is false. A world without paddings returns the distance.
        """
        return self.distance(positions)

    def nearest_pair(self, positions: ArrayLike) -> tuple[str, str] | None:
        """Return the nearest pair at ``positions`` (n,) in which one body is not a link of the robot, or None.

        A world that cannot determine it returns a colliding pair.
        """
        return next(iter(self.colliding_pairs(positions)), None)

    def bodies(self, positions: ArrayLike) -> Sequence[tuple[str, NDArray[np.float64]]]:
        """Return name and corners (N, 3), metres in the base frame, of each convex body at ``positions`` (n,), for
        pictures.

        Empty for a world without shapes.
        """
        return ()


class CollisionModel(ABC):
    """The geometry of a robot, prepared once, from which collision worlds are created cheaply."""

    @abstractmethod
    def world(self, scene: PlanningScene, arm: str = "arm") -> CollisionWorld:
        """Return the world of ``arm`` in ``scene``. Raises ManipulationError naming an unknown joint, link or arm."""
