"""Approaches: a configuration beside the goal, a straight motion into contact, a straight motion out of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.kinematics.cartesian_path import cartesian_path
from bestman_bt.messages import Pose


@dataclass(frozen=True, eq=False)
class Approach:
    """Joint positions of an approach. ``pre``: (n,) radians, end of the free motion. ``into``, ``out``: (N, n),
    straight tool motions.

    ``into`` goes from ``pre`` to the contact pose, ``out`` starts there. ``cost``: radians, distance of ``pre`` from
    the reference.
    """

    pre: NDArray[np.float64]
    into: NDArray[np.float64]
    out: NDArray[np.float64]
    cost: float


@dataclass(frozen=True, eq=False)
class ApproachPoses:
    """Tool poses in the base frame: before the approach, at contact, and after the retreat."""

    pre: Pose
    contact: Pose
    out: Pose


def approaches(
    kinematics: InverseKinematics,
    poses: ApproachPoses,
    reference: ArrayLike,
    free: CollisionWorld,
    contact: CollisionWorld,
    rng: np.random.Generator,
    count: int = 2,
    attempts: int | None = None,
) -> Iterator[Approach]:
    """Yield approaches through up to ``count`` different arm configurations, nearest to ``reference`` (n,) first.

    ``free``: the world for ``pre``, in which the target is an obstacle. ``contact``: the world for both straight
    motions, in which the hand may touch the target.
    """
    reference = np.asarray(reference, dtype=float)
    result = kinematics.solve(poses.pre, reference, rng, count, is_valid=free.is_free, attempts=attempts)
    for pre in result.solutions:
        into = cartesian_path(kinematics, pre, poses.contact, contact.is_free)
        if not into.complete:
            continue
        out = cartesian_path(kinematics, into.path[-1], poses.out, contact.is_free)
        if not out.complete:
            continue
        distance = np.abs(pre - reference)
        yield Approach(pre, into.path, out.path, float(distance.max() + 0.3 * np.linalg.norm(distance)))
