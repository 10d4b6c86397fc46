"""What a lidar saw close to the base, and what it saw before that came too close to be seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import LaserScan, Pose2D

EDGE = 0.03
"""Metres beyond the shortest range within which noise may hide a hit already."""
MEMORY = 30.0
"""Seconds after which what is too close to be seen is forgotten: who walked past would block the base for ever."""


class NearPoints:
    """Hits in the odometry frame: those of the last scan, and of the blind zone the latest for each degree of bearing.

    ``same_surface``: metres; neighbouring beams that differ by less are averaged.
    """

    def __init__(self, same_surface: float) -> None:
        self._same_surface = same_surface
        self._seen: NDArray[np.float64] = np.zeros((0, 2))
        self._blind: NDArray[np.float64] = np.zeros((0, 3))  # x, y, stamp
        self._stamp = 0.0

    def update(self, scan: LaserScan, base_from_lidar: Pose2D, odometry: Pose2D) -> None:
        """Take in a scan that was taken at ``odometry``."""
        lidar = odometry @ base_from_lidar
        before = np.vstack([self._blind, np.column_stack([self._seen, np.full(len(self._seen), self._stamp)])])
        self._blind = self._still_hidden(before, scan, lidar)
        hit = np.isfinite(scan.ranges)
        ranges, angles = _smoothed(scan.ranges, self._same_surface)[hit], scan.angles[hit]
        self._seen = lidar.apply(np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles)]))
        self._stamp = scan.stamp

    def note(self, points: NDArray[np.float64], odometry: Pose2D, stamp: float) -> None:
        """Remember points (N, 2) of the base frame that were felt."""
        felt = np.column_stack([odometry.apply(points), np.full(len(points), stamp)])
        self._blind = np.vstack([self._blind, felt])

    def around(self, odometry: Pose2D) -> NDArray[np.float64]:
        """All points (N, 2), metres, in the frame of a base at ``odometry``."""
        return odometry.inverse().apply(np.vstack([self._seen, self._blind[:, :2]]))

    def _still_hidden(self, points: NDArray[np.float64], scan: LaserScan, lidar: Pose2D) -> NDArray[np.float64]:
        """Of points (N, 3) those that the scan could not see, one for each beam: the latest."""
        own = lidar.inverse().apply(points[:, :2])
        distance = np.hypot(own[:, 0], own[:, 1])
        hidden = (distance < scan.range_min + EDGE) & (scan.stamp - points[:, 2] < MEMORY)
        points, distance, own = points[hidden], distance[hidden], own[hidden]
        turn = (np.arctan2(own[:, 1], own[:, 0]) - scan.angle_min) % (2.0 * np.pi)
        beam = np.round(turn / scan.angle_increment).astype(int)
        covered = beam < len(scan.ranges)
        behind = scan.ranges[np.where(covered, beam, 0)] > distance + EDGE
        gone = covered & behind & (distance > scan.range_min)
        points, beam = points[~gone], beam[~gone]
        newest_first = np.argsort(-points[:, 2], kind="stable")
        _, first = np.unique(beam[newest_first], return_index=True)
        return points[newest_first[np.sort(first)]]


def _smoothed(ranges: NDArray[np.float64], same_surface: float) -> NDArray[np.float64]:
    """Each range (N,) as the mean of those up to two beams beside it that hit the same surface: edges stay."""
    beside = np.stack([np.roll(ranges, shift) for shift in range(-2, 3)])
    same = np.abs(np.where(np.isfinite(beside), beside, np.inf) - np.where(np.isfinite(ranges), ranges, 0.0))
    weights = (same < same_surface).astype(float)
    total = np.maximum(weights.sum(axis=0), 1.0)
    mean: NDArray[np.float64] = (weights * np.where(weights > 0.0, beside, 0.0)).sum(axis=0) / total
    return mean
