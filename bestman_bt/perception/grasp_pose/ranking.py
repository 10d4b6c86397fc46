"""Ranking of grasps by quality, clearance of the hand and reachability."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspTarget
from bestman_bt.perception.grasp_pose.hand_poses import HandPoses, different_hands
from bestman_bt.perception.grasp_pose.hand_shape import HandShape

# Metres: edge of the cells to which surroundings are thinned, and between points put below what was seen of them.
_CELL, _COLUMN_STEP = 0.005, 0.010


def surroundings_of(target: GraspTarget, support_height: float, reach: float) -> NDArray[np.float64]:
    """Return points (N, 3) of other objects within ``reach`` metres of the target's box, downsampled.

    They are assumed to extend down to the support on the sides that the camera does not see. Points that are not finite
    are omitted. Raises PerceptionError if the array is not (N, 3).
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
    """Return points (M, 3) below the highest of ``points`` (N, 3) in each square ``cell``, down to the support."""
    order = np.argsort(-points[:, 2], kind="stable")
    _, first = np.unique(np.round(points[order, :2] / cell).astype(np.int64), axis=0, return_index=True)
    tops = points[order[np.sort(first)]]
    levels = np.arange(support_height + step / 2, float(points[:, 2].max()), step)
    below = levels[None, :] < tops[:, 2:3] - step / 2
    column, level = np.nonzero(below)
    return np.column_stack([tops[column, :2], levels[level]])


def hands_of(candidates: Sequence[GraspCandidate]) -> HandPoses:
    """Return the grasp poses of candidates."""
    rotations = np.array([candidate.grasp.rotation for candidate in candidates]).reshape(-1, 3, 3)
    return HandPoses(rotations, np.array([candidate.grasp.position for candidate in candidates]).reshape(-1, 3))


def clear_candidates(
    candidates: Sequence[GraspCandidate],
    hand: HandShape,
    surroundings: NDArray[np.float64],
    support_height: float,
    least: float,
) -> list[GraspCandidate]:
    """Return the candidates whose open hand keeps ``least`` metres from ``surroundings`` (N, 3), with ``clearance``."""
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


@dataclass(frozen=True)
class GraspRanking:
    """Sorts grasps into the order in which to try them.

    Metres and radians.

    ``clearance``: room around the hand above which more does not improve the score; ``clearance_weight``: fraction of
    the score that a hand without any clearance loses. ``enough``: number of reachable grasps after which worse ones are
    not evaluated. The first ``different`` grasps are at least ``apart`` or ``apart_angle`` from each other, so that the
    next try differs from a failed one.
    """

    clearance: float = 0.015
    clearance_weight: float = 0.3
    enough: int = 12
    different: int = 4
    apart: float = 0.025
    apart_angle: float = math.radians(30.0)

    def rank(
        self,
        candidates: Sequence[GraspCandidate],
        reachability: Callable[[Pose], float] | None = None,
        *,
        reachability_of_all: Callable[[Sequence[Pose]], Sequence[float]] | None = None,
    ) -> tuple[RankedGrasp, ...]:
        """Return the reachable grasps, best first. Equal input gives equal output.

        ``reachability``: function of a grasp pose, 0 (unreachable) to 1, called for the most promising first and only
        as often as needed; ``reachability_of_all``: the same for many poses at once. With neither, all grasps count as
        reachable.
        """
        room = [min(max(candidate.clearance, 0.0) / self.clearance, 1.0) for candidate in candidates]
        promise = np.array(
            [
                c.quality * (1.0 - self.clearance_weight * (1.0 - share))
                for c, share in zip(candidates, room, strict=True)
            ]
        )
        order = np.argsort(-promise, kind="stable")
        ask = reachability_of_all or (lambda poses: [reachability(pose) if reachability else 1.0 for pose in poses])
        step = self.enough if reachability_of_all else 1
        ranked: list[RankedGrasp] = []
        for start in range(0, len(order), step):
            batch = order[start : start + step]
            settled = sorted((grasp.score for grasp in ranked), reverse=True)[: self.enough]
            if len(settled) == self.enough and settled[-1] >= promise[batch[0]]:
                break
            answers = ask([candidates[index].grasp for index in batch])
            for index, answer in zip(batch, answers, strict=True):
                share = min(max(float(answer), 0.0), 1.0)
                if share > 0.0:
                    ranked.append(RankedGrasp(candidates[index], float(promise[index]) * share, share))
        ranked.sort(key=lambda grasp: -grasp.score)
        hands = hands_of([grasp.candidate for grasp in ranked])
        first = different_hands(hands, np.arange(len(ranked)), self.different, self.apart, self.apart_angle)
        return tuple(ranked[index] for index in [*first, *(i for i in range(len(ranked)) if i not in first)])


@dataclass(frozen=True, eq=False)
class RankedGrasp:
    """A grasp with its rank. ``score``: 0 to 1, quality times the factors for clearance and ``reachability``."""

    candidate: GraspCandidate
    score: float
    reachability: float
