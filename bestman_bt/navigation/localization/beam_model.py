"""How well a scan agrees with the map at a pose: the beam model of Thrun, Burgard, Fox, Probabilistic Robotics, 6.3.

Unlike a likelihood field it knows that nothing is seen through a wall.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.messages.bounds import Count, Positive, Share
from bestman_bt.navigation.localization.ray_casting import cast_rays


@dataclass(frozen=True)
class Agreement:
    """``log_likelihood``: mean over the beams. ``explained``: share of the hits that are where they should be."""

    log_likelihood: float
    explained: float


@dataclass(frozen=True)
class BeamModel:
    """``beams``: that are looked at, evenly spread. ``hit_std``: metres, of lidar, map and pose together.

    ``hit``, ``short``, ``random``: shares of beams that meet what the map has, something before it that the map does
    not know (the nearer the likelier, with the decay ``short_decay``, metres), or anything. ``lost``: likelihood of a
    beam that meets nothing where the map has something. ``explained_within``: metres.
    """

    beams: Count = 120
    hit_std: Annotated[Positive, "m"] = 0.06
    hit: Share = 0.7
    short: Share = 0.2
    random: Share = 0.1
    short_decay: Annotated[Positive, "m"] = 2.0
    lost: Share = 0.1
    explained_within: Annotated[Positive, "m"] = 0.12

    def agreement(self, segments: NDArray[np.float64], map_from_lidar: Pose2D, scan: LaserScan) -> Agreement:
        """Compare a scan with what would be seen of ``segments`` (N, 4) from ``map_from_lidar``."""
        step = max(1, len(scan.ranges) // self.beams)
        measured = scan.ranges[::step]
        expected, _ = cast_rays(segments, map_from_lidar, scan.angles[::step])
        expected = np.where(expected > scan.range_max, np.inf, expected)
        visible = expected > scan.range_min  # what is nearer cannot be measured
        hit, seen = np.isfinite(measured), np.isfinite(expected)
        with np.errstate(invalid="ignore"):
            error = measured - expected
            near = self.hit * np.exp(-0.5 * (error / self.hit_std) ** 2) / (self.hit_std * np.sqrt(2.0 * np.pi))
            before = np.where(error < 0.0, self.short * np.exp(-measured / self.short_decay) / self.short_decay, 0.0)
        by_chance = self.random / scan.range_max
        likelihood = np.where(hit & seen, near + before, 0.0) + by_chance
        likelihood[hit & ~seen] = (
            by_chance + self.short * np.exp(-measured[hit & ~seen] / self.short_decay) / self.short_decay
        )
        likelihood[~hit & seen] = self.lost
        likelihood[~hit & ~seen] = 1.0
        told = visible & (hit | seen)
        if not told.any():
            return Agreement(float(np.log(by_chance)), 0.0)
        fits = hit & seen & (np.abs(np.where(hit & seen, error, np.inf)) < self.explained_within)
        return Agreement(float(np.log(likelihood[told]).mean()), float(fits.sum() / max(hit.sum(), 1)))
