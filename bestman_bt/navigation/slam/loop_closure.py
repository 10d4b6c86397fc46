"""Loop closures: a keyframe is recognised in an old submap.

The pose graph's covariance defines the search region; a match is accepted if it explains the scan, is constrained in
all directions, and is consistent with the covariance.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D
from bestman_bt.messages.shapes import Count, Fraction, NonNegative, NonNegativeInt, NotBelow, Positive, check_bounds
from bestman_bt.navigation.localization.pose_uncertainty import (
    WEAK_PRIOR,
    deviation,
    difference,
    inverse,
    turned,
    worst_position_std,
)
from bestman_bt.navigation.slam.correlative import SearchWindow
from bestman_bt.navigation.slam.pose_graph import Constraint, PoseGraph
from bestman_bt.navigation.slam.submap import Keyframe, Submap


@dataclass(frozen=True)
class LoopCloser:
    """Searches closures of one keyframe at a time.

    ``separation``: smallest number of keyframes in between. ``reach``: metres from a submap's path within which it is
    tried. ``candidates``: submaps to try per keyframe, the nearest first. ``sigmas``: of the covariance to search, at
    least ``min_distance`` (metres) and ``min_angle`` (radians), at most ``max_distance`` and ``max_angle``; beyond
    ``jump`` metres the search is correlative. A closure explains ``min_inlier_ratio`` of the hits to ``max_residual``
    metres, has a standard deviation of at most ``max_std`` metres in each direction, and lies within ``max_deviation``
    standard deviations of the graph's prediction. ``position_std``, ``heading_std``: its additional error, metres and
    radians.
    """

    separation: NonNegativeInt = 12
    reach: Annotated[Positive, "m"] = 1.5
    candidates: Count = 2
    sigmas: Positive = 3.0
    min_distance: Annotated[NonNegative, "m"] = 0.10
    min_angle: Annotated[NonNegative, "rad"] = math.radians(2.0)
    max_distance: Annotated[Positive, NotBelow("min_distance"), "m"] = 2.0
    max_angle: Annotated[Positive, NotBelow("min_angle"), "rad"] = math.radians(20.0)
    jump: Annotated[NonNegative, "m"] = 0.20
    min_inlier_ratio: Fraction = 0.60
    max_residual: Annotated[Positive, "m"] = 0.025
    max_std: Annotated[Positive, "m"] = 0.03
    max_deviation: Positive = 4.0
    position_std: Annotated[NonNegative, "m"] = 0.008
    heading_std: Annotated[NonNegative, "rad"] = math.radians(0.15)

    def __post_init__(self) -> None:
        check_bounds(self)

    def find(self, keyframe: Keyframe, finished: Iterable[Submap], graph: PoseGraph) -> list[Constraint]:
        """Return accepted constraints from submaps to ``keyframe``; often none."""
        near = []
        for submap in finished:
            if keyframe.node - submap.last_node < self.separation:
                continue
            distance = submap.distance_to(graph.pose(submap.anchor.node).inverse() @ graph.pose(keyframe.node))
            if distance < self.reach + self.max_distance:
                near.append((distance, submap.anchor.node, submap))
        closures = []
        for distance, _, submap in sorted(near, key=lambda entry: entry[:2])[: self.candidates]:
            covariance = graph.relative_covariance(submap.anchor.node, keyframe.node)
            spread = self.sigmas * worst_position_std(covariance)
            if distance < self.reach + spread:
                constraint = self._close(keyframe, submap, graph, covariance, spread)
                if constraint is not None:
                    closures.append(constraint)
        return closures

    def _close(
        self,
        keyframe: Keyframe,
        submap: Submap,
        graph: PoseGraph,
        covariance: NDArray[np.float64],
        spread: float,
    ) -> Constraint | None:
        expected = graph.pose(submap.anchor.node).inverse() @ graph.pose(keyframe.node)
        guess = expected
        if spread > self.jump:
            angle = self.sigmas * math.sqrt(float(covariance[2, 2]))
            window = SearchWindow(
                min(max(spread, self.min_distance), self.max_distance), min(max(angle, self.min_angle), self.max_angle)
            )
            coarse = submap.matcher.search(keyframe.hits.points, expected, window)
            if coarse is None:
                return None
            guess = coarse.pose
        found = submap.reference.align(keyframe.hits, guess)
        if found.inlier_ratio < self.min_inlier_ratio or found.residual > self.max_residual:
            return None
        measured = inverse(found.information + WEAK_PRIOR)
        if worst_position_std(measured) > self.max_std:
            return None
        measured = (
            turned(measured, -found.pose.theta) + np.diag([self.position_std, self.position_std, self.heading_std]) ** 2
        )
        off = difference(expected.inverse() @ found.pose, Pose2D())
        if deviation(off, covariance + measured) > self.max_deviation:
            return None
        return Constraint(submap.anchor.node, keyframe.node, found.pose, inverse(measured), doubtful=True)
