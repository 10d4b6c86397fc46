"""Free space: collisions on straight pieces, places to turn, and costs of driving."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.navigation.global_planning.costmap import Costmap

_MANY = 1500  # samples from which on it is worth while to look at a few of them first:
_SPARSE = 8  # one of so many


@dataclass(frozen=True)
class FreeSpace:
    """The free part of a costmap for a base that drives straight and turns in place.

    ``turning_distance``: metres from obstacles at which it can turn, minus ``slack`` if necessary, at the highest cost.
    ``turns_everywhere``: it keeps that distance all along; else only where it turns, and between two such places its
    footprint, aligned with the path, has to pass.
    """

    costmap: Costmap
    turning_distance: float
    slack: float
    turns_everywhere: bool

    @property
    def field(self) -> Costmap:
        """The costmap with one field: the base's centre must keep ``lethal_distance``."""
        return self.costmap.for_turning if self.turns_everywhere else self.costmap.for_passing

    @property
    def lethal_distance(self) -> float:
        """Least distance of the base's middle from obstacles, metres."""
        return self.turning_distance if self.turns_everywhere else self.costmap.footprint.inscribed_radius

    @property
    def lethal_slack(self) -> float:
        """Reduction of ``lethal_distance`` in narrow places, metres."""
        return self.slack if self.turns_everywhere else 0.0

    def can_turn(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Return at which of the points (..., 2) the base can turn to any heading."""
        turns: NDArray[np.bool_] = self.costmap.for_turning.distance_at(points) >= self.turning_distance - self.slack
        return turns

    def segment_costs(self, starts: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the cost (N,) of driving straight from ``starts`` (2,) or (N, 2) to ``ends`` (N, 2); infinite if
        blocked.
        """
        starts = np.broadcast_to(starts, ends.shape)
        field, spacing = self.field, self.costmap.resolution / 2
        costs = np.full(len(ends), np.inf)
        candidates = np.arange(len(ends))
        if np.abs(ends - starts).sum() / spacing > _MANY:
            # Most segments are blocked, and a few of their samples tell.
            points, segments, _ = _samples(starts, ends, _SPARSE * spacing)
            passable = np.ones(len(ends), dtype=bool)
            passable[segments[field.distance_at(points) < self.lethal_distance - self.lethal_slack]] = False
            candidates = np.flatnonzero(passable)
        if len(candidates):
            starts, ends = starts[candidates], ends[candidates]
            points, segments, counts = _samples(starts, ends, spacing)
            distance = field.distance_at(points)
            cost = self.costmap.cost(distance, self.lethal_distance, self.lethal_slack)
            if not self.turns_everywhere:
                headings = np.arctan2(ends[:, 1] - starts[:, 1], ends[:, 0] - starts[:, 0])
                cost[self._touches(points, headings[segments], distance)] = np.inf
            lengths = np.hypot(*(ends - starts).T)
            costs[candidates] = np.add.reduceat(cost, np.cumsum(counts) - counts) / counts * lengths
        return costs

    def _touches(
        self, points: NDArray[np.float64], headings: NDArray[np.float64], distance: NDArray[np.float64]
    ) -> NDArray[np.intp]:
        """Indices of the points (N, 2) at which the footprint touches something, looked at only where it may."""
        footprint, turning = self.costmap.footprint, self.costmap.for_turning
        outer = distance if turning is self.field else turning.distance_at(points)
        near = np.flatnonzero((distance >= footprint.inscribed_radius) & (outer < footprint.circumscribed_radius))
        clearance = self.costmap.footprint_clearance(np.column_stack([points[near], headings[near]]))
        return near[clearance <= 0.0]


def _samples(
    starts: NDArray[np.float64], ends: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.intp]]:
    """Points (M, 2) along segments, at most ``spacing`` apart, both ends included; of which segment; how many of it."""
    lengths = np.hypot(*(ends - starts).T)
    counts = np.maximum(2, np.ceil(lengths / spacing)).astype(np.intp) + 1
    segments = np.repeat(np.arange(len(ends)), counts)
    number = np.arange(len(segments)) - (np.cumsum(counts) - counts)[segments]
    share = (number / (counts - 1)[segments])[:, None]
    return starts[segments] + share * (ends - starts)[segments], segments, counts
