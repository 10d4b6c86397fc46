"""Which grasp to try first: quality, room around the hand, and whether the arm gets there."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bestman_bt.messages import Pose
from bestman_bt.perception.grasp_pose.base import GraspCandidate
from bestman_bt.perception.grasp_pose.clearance import hands_of
from bestman_bt.perception.grasp_pose.hand_poses import different_hands


@dataclass(frozen=True)
class GraspRanking:
    """Puts grasps in the order in which to try them.

    Metres and radians.

    ``clearance``: room around the hand from which on more is no better; ``clearance_weight``: share of the score that a
    hand without any room loses. ``enough``: reachable grasps after which those that cannot be better are not asked
    about. The first ``different`` are at least ``apart`` or ``apart_angle`` from each other: where one fails, the next
    one is another.
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
        """Best first; without those that cannot be reached. Equal input gives equal output.

        ``reachability``: of a grasp pose, 0 (unreachable) to 1, asked in the order of promise and no more often than
        needed; ``reachability_of_all``: the same for many poses at once. None of both: all are taken to be reachable.
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
    """``score``: 0 to 1, quality times the shares for clearance and reachability; ``reachability`` as was answered."""

    candidate: GraspCandidate
    score: float
    reachability: float
