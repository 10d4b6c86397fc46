"""Oriented points: the hits of a scan, each with the normal of its surface.

The normal faces the lidar, so that the two faces of a thin wall are distinct.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.messages.frozen_array import frozen_array


@dataclass(frozen=True, eq=False)
class OrientedPoints:
    """``points``, ``normals``: (N, 2) each, metres and unit vectors."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen_array(self.points, (None, 2), "OrientedPoints points"))
        object.__setattr__(self, "normals", frozen_array(self.normals, (len(self.points), 2), "OrientedPoints normals"))

    def __len__(self) -> int:
        return len(self.points)

    def placed(self, pose: Pose2D) -> OrientedPoints:
        """Return the points transformed by ``pose``."""
        return OrientedPoints(pose.apply(self.points), Pose2D(0.0, 0.0, pose.theta).apply(self.normals))

    def features(self, turning: float) -> NDArray[np.float64]:
        """Return features (N, 4) for nearest-neighbour search by position and normal; ``turning``: half the distance of
        opposite faces, metres.
        """
        return np.hstack([self.points, turning * self.normals])


def joined(parts: list[OrientedPoints]) -> OrientedPoints:
    """Return all points of several sets in one frame."""
    return OrientedPoints(np.concatenate([p.points for p in parts]), np.concatenate([p.normals for p in parts]))


def oriented_points(scan: LaserScan, base_from_lidar: Pose2D, window: int = 4, reach: float = 0.20) -> OrientedPoints:
    """Return the hits that lie on a line with their neighbours, in the base frame.

    A line is fitted to the hits of up to ``window`` beams on each side within ``reach`` metres, or four beam spacings;
    hits with fewer than four such neighbours, or off the line, are left out.
    """
    ranges, angles = scan.ranges, scan.angles
    hit = np.isfinite(ranges)
    finite = np.where(hit, ranges, 0.0)
    xy = np.column_stack([finite * np.cos(angles), finite * np.sin(angles)])
    offsets = np.arange(-window, window + 1)
    around = (np.arange(len(ranges))[:, None] + offsets) % len(ranges)
    if abs(scan.angle_increment * len(ranges) - 2.0 * np.pi) > 1e-3:  # not all round: the ends are no neighbours
        inside = (np.arange(len(ranges))[:, None] + offsets >= 0) & (
            np.arange(len(ranges))[:, None] + offsets < len(ranges)
        )
    else:
        inside = np.ones(around.shape, dtype=bool)
    apart = np.linalg.norm(xy[around] - xy[:, None], axis=2)
    near = np.maximum(reach, 4.0 * scan.angle_increment * finite)
    weight = (inside & hit[around] & (apart < near[:, None])).astype(float)
    count = weight.sum(axis=1)
    safe = np.maximum(count, 1.0)
    mean = (weight[..., None] * xy[around]).sum(axis=1) / safe[:, None]
    centred = (xy[around] - mean[:, None]) * weight[..., None]
    xx, yy = (centred[..., 0] ** 2).sum(axis=1) / safe, (centred[..., 1] ** 2).sum(axis=1) / safe
    xyc = (centred[..., 0] * centred[..., 1]).sum(axis=1) / safe
    half, spread = (xx + yy) / 2.0, np.hypot((xx - yy) / 2.0, xyc)
    flat = (half - spread) < 0.1 * (half + spread)
    along = 0.5 * np.arctan2(2.0 * xyc, xx - yy)
    normals = np.column_stack([-np.sin(along), np.cos(along)])
    normals *= np.where((normals * xy).sum(axis=1) > 0.0, -1.0, 1.0)[:, None]
    good = hit & (count >= 5) & flat
    return OrientedPoints(xy[good], normals[good]).placed(base_from_lidar)


def thinned(cloud: OrientedPoints, cell: float) -> OrientedPoints:
    """Return the means of the points that share a square of ``cell`` metres and face the same quadrant."""
    quarter = np.floor(np.arctan2(cloud.normals[:, 1], cloud.normals[:, 0]) / (np.pi / 2) + 0.5).astype(np.int64) % 4
    keys = np.column_stack([np.floor(cloud.points / cell).astype(np.int64), quarter])
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.ravel()
    count = np.bincount(group).astype(float)
    columns = [np.bincount(group, column) / count for column in np.hstack([cloud.points, cloud.normals]).T]
    normals = np.column_stack(columns[2:])
    return OrientedPoints(np.column_stack(columns[:2]), normals / np.linalg.norm(normals, axis=1, keepdims=True))
