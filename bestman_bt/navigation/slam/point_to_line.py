"""Point-to-line ICP (A. Censi, "An ICP variant using a point-to-line metric", 2008) against points with normals.

Correspondences are the nearest points of similar normal; residuals are weighted by a Cauchy kernel, and the odometry is
an additional measurement, which decides along a bare corridor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bestman_bt.messages import LaserScan, Pose2D, wrap_angle
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.shapes import Count, Fraction, NonNegative, Positive, Several
from bestman_bt.navigation.localization.pose_uncertainty import WEAK_PRIOR


@dataclass(frozen=True)
class PointToLine:
    """Parameters of scan matching. Lengths in metres.

    ``iterations``: largest number; hits farther than ``gate_first`` · ``gate_decay``ᵏ + ``gate_last`` from everything
    are ignored in iteration k. ``robust_scale``: residual at which a hit has half weight, ``range_std``: noise of a
    beam and of the surface that it is matched to. ``turning``: half the distance that an opposite normal is weighted
    as. ``neighbours``: number of points to which a reference line is fitted. ``inlier_distance``: largest distance of
    an explained hit from its reference line.
    """

    iterations: Count = 12
    gate_first: Annotated[Positive, "m"] = 0.30
    gate_decay: Fraction = 0.6
    gate_last: Annotated[Positive, "m"] = 0.06
    robust_scale: Annotated[Positive, "m"] = 0.03
    range_std: Annotated[Positive, "m"] = 0.015
    turning: NonNegative = 0.10
    neighbours: Several = 12
    inlier_distance: Annotated[Positive, "m"] = 0.05


@dataclass(frozen=True, eq=False)
class ScanAlignment:
    """The best ``pose`` and its ``information`` (3, 3) from the hits alone: x, y, theta in the reference's frame.

    ``inlier_ratio``: fraction of the hits on the reference. ``residual``: their root mean square, metres.
    """

    pose: Pose2D
    information: NDArray[np.float64]
    inlier_ratio: float
    residual: float


class LineReference:
    """The reference of a match: points whose normals and positions are those of lines through their neighbours."""

    def __init__(self, cloud: OrientedPoints, method: PointToLine = PointToLine()) -> None:
        """Prepare the search. ``cloud`` should hold at least as many points as ``neighbours``."""
        self._method = p = method
        features = cloud.features(p.turning)
        self._tree = cKDTree(features)
        distances, index = self._tree.query(features, k=min(p.neighbours, len(cloud)))
        near = distances < 0.15
        count = near.sum(axis=1)
        points = cloud.points[index]
        mean = (near[..., None] * points).sum(axis=1) / count[:, None]
        facing = (near[..., None] * cloud.normals[index]).sum(axis=1)
        centred = (points - mean[:, None]) * near[..., None]
        xx, yy = (centred[..., 0] ** 2).sum(axis=1), (centred[..., 1] ** 2).sum(axis=1)
        along = 0.5 * np.arctan2(2.0 * (centred[..., 0] * centred[..., 1]).sum(axis=1), xx - yy)
        normals = np.column_stack([-np.sin(along), np.cos(along)])
        agreement = (normals * facing).sum(axis=1) / np.maximum(np.linalg.norm(facing, axis=1), 1e-12)
        normals *= np.where(agreement < 0.0, -1.0, 1.0)[:, None]
        # Where few or a heap of points lie about, the scan's own normal says more than a line through them.
        lines = (np.abs(agreement) > 0.9) & (count >= 5)
        self._normals = np.where(lines[:, None], normals, cloud.normals)
        offsets = ((mean - cloud.points) * self._normals).sum(axis=1)
        self._points = cloud.points + np.where(lines, offsets, 0.0)[:, None] * self._normals

    def align(self, scan: OrientedPoints, guess: Pose2D, prior: NDArray[np.float64] | None = None) -> ScanAlignment:
        """Return the pose of ``scan``, starting from ``guess``; ``prior``: (3, 3) information of the guess, none by
        default.
        """
        p = self._method
        prior = WEAK_PRIOR if prior is None else prior
        x, y, theta = guess.x, guess.y, guess.theta
        information = np.zeros((3, 3))
        for k in range(p.iterations):
            placed = scan.placed(Pose2D(x, y, theta))
            gate = p.gate_first * p.gate_decay**k + p.gate_last
            distance, index = self._tree.query(placed.features(p.turning), distance_upper_bound=gate + p.turning)
            found = np.flatnonzero(np.isfinite(distance))
            points, normals = self._points[index[found]], self._normals[index[found]]
            between = placed.points[found] - points
            residuals = (between * normals).sum(axis=1)
            near = (np.abs(residuals) < gate) & ((between**2).sum(axis=1) < 4.0 * gate**2)
            weights = near / (1.0 + (residuals / p.robust_scale) ** 2) / p.range_std**2
            arm = placed.points[found] - (x, y)
            jacobian = np.column_stack([normals, normals[:, 1] * arm[:, 0] - normals[:, 0] * arm[:, 1]])
            information = (jacobian * weights[:, None]).T @ jacobian
            off = np.array([x - guess.x, y - guess.y, wrap_angle(theta - guess.theta)])
            gradient = (jacobian * weights[:, None]).T @ residuals + prior @ off
            step = -np.linalg.solve(information + prior, gradient)
            x, y, theta = x + float(step[0]), y + float(step[1]), theta + float(step[2])
            if k >= 4 and float(np.abs(step).max()) < 2e-4:
                break
        inliers = np.abs(residuals[near]) < p.inlier_distance
        count = int(inliers.sum())
        residual = math.sqrt(float(np.mean(residuals[near][inliers] ** 2))) if count else math.inf
        return ScanAlignment(Pose2D(x, y, wrap_angle(theta)), information, count / max(len(scan), 1), residual)


# Oriented points: the hits of a scan, each with the normal of its surface. The normal faces the lidar, so that the two
# faces of a thin wall are distinct.


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
        """Return features (N, 4) for nearest-neighbour search by position and normal; ``turning``: metres by which the
        unit normal is scaled, so that two points with opposite normals are twice as far apart.
        """
        return np.hstack([self.points, turning * self.normals])


def joined(parts: list[OrientedPoints]) -> OrientedPoints:
    """Return all points of several sets in one frame."""
    return OrientedPoints(np.concatenate([p.points for p in parts]), np.concatenate([p.normals for p in parts]))


def oriented_points(scan: LaserScan, base_from_lidar: Pose2D, window: int = 4, reach: float = 0.20) -> OrientedPoints:
    """Return the hits that lie on a line with their neighbours, in the base frame.

    A line is fitted to the hits of up to ``window`` beams on each side within ``reach`` metres, or four beam spacings;
    hits with fewer than four such neighbours, or off the line, are omitted.
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
