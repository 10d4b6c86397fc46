"""How far the open hand stays from the support and from other things, for candidates that are to be kept or dropped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspTarget
from bestman_bt.perception.grasp_pose.hand_poses import HandPoses
from bestman_bt.perception.grasp_pose.hand_shape import HandShape

# Metres: edge of the cells to which surroundings are thinned, and between points put below what was seen of them.
_CELL, _COLUMN_STEP = 0.005, 0.010


def surroundings_of(target: GraspTarget, support_height: float, reach: float) -> NDArray[np.float64]:
    """Points (N, 3) of other things within ``reach`` metres of the target's box, thinned.

    What was seen of them is taken to reach down to the support: the sides that the camera does not see. Points that
    are not finite are left out; raises PerceptionError where the array is not (N, 3).
    """
    if target.surroundings is None:
        return np.zeros((0, 3))
    points: NDArray[np.float64] = np.asarray(target.surroundings, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise PerceptionError(f"GraspTarget surroundings should be (N, 3) but are {points.shape}")
    points = points[np.isfinite(points).all(axis=1)]
    points = points[np.linalg.norm(points - target.box.pose.position, axis=1) < reach]
    if not len(points):
        return points
    _, first = np.unique(np.round(points / _CELL).astype(np.int64), axis=0, return_index=True)
    points = points[np.sort(first)]
    return np.concatenate([points, columns_below(points, support_height, _CELL, _COLUMN_STEP)])


def columns_below(points: NDArray[np.float64], support_height: float, cell: float, step: float) -> NDArray[np.float64]:
    """Points (M, 3) below the highest of ``points`` (N, 3) in each square ``cell``, down to the support."""
    order = np.argsort(-points[:, 2], kind="stable")
    _, first = np.unique(np.round(points[order, :2] / cell).astype(np.int64), axis=0, return_index=True)
    tops = points[order[np.sort(first)]]
    levels = np.arange(support_height + step / 2, float(points[:, 2].max()), step)
    below = levels[None, :] < tops[:, 2:3] - step / 2
    column, level = np.nonzero(below)
    return np.column_stack([tops[column, :2], levels[level]])


def hands_of(candidates: Sequence[GraspCandidate]) -> HandPoses:
    """The grasp poses of candidates."""
    rotations = np.array([candidate.grasp.rotation for candidate in candidates]).reshape(-1, 3, 3)
    return HandPoses(rotations, np.array([candidate.grasp.position for candidate in candidates]).reshape(-1, 3))


def clear_candidates(
    candidates: Sequence[GraspCandidate],
    hand: HandShape,
    surroundings: NDArray[np.float64],
    support_height: float,
    least: float,
) -> list[GraspCandidate]:
    """Those whose open hand keeps ``least`` metres from ``surroundings`` (N, 3); ``clearance`` is filled in."""
    if not candidates:
        return []
    hands = hands_of(candidates)
    openings = np.array([candidate.opening for candidate in candidates])
    around = hand.clearances(hands, openings, surroundings)
    clearances = np.minimum(around, np.maximum(hand.lowest(hands, openings) - support_height, 0.0))
    return [
        replace(candidate, clearance=float(clearance))
        for candidate, clearance, nearest in zip(candidates, clearances, around, strict=True)
        if nearest >= least
    ]
