"""Tracking by scan-to-map matching: point-to-line ICP (Censi 2008) inside a Kalman filter.

The match gives a pose and its covariance (from the Gauss-Newton normal matrix); the filter weighs it against the
odometry. Walls are exact; a piece of furniture is displaced as a whole, so all hits on it together count as one
measurement with that error. Beams that end before the mapped surface have hit an unknown obstacle, such as a closed
door or people: they do not contradict the pose (``z_short`` of the beam model, Thrun, Burgard and Fox 2005, section
6.3). Beams through a mapped wall do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import LaserScan, Pose2D, wrap_angle
from bestman_bt.messages.shapes import Count, Fraction, NonNegative, NotBelow, Positive
from bestman_bt.navigation.localization.base import LocalizationEstimate, Localizer, ScanMatch, checked_std
from bestman_bt.navigation.localization.map_lines import MapLines, PlanarMap, map_lines, open_furniture, within
from bestman_bt.navigation.localization.pose_uncertainty import WEAK_PRIOR, deviation, difference, driven_on, inverse


@dataclass(frozen=True, eq=False)
class TrackedEstimate(LocalizationEstimate):
    """``odometry``: the odometry pose (``odom`` frame) at ``pose``."""

    odometry: Pose2D = field(default_factory=Pose2D)


@dataclass(frozen=True, eq=False)
class ScanToMap(Localizer):
    """Tracks the pose by scan-to-map matching; needs an initial pose within about 10 cm and 5°.

    Lengths in metres, angles in radians.

    ``iterations`` of the match; hits farther than ``gate_first`` · ``gate_decay``ᵏ + ``gate_last`` from everything on
    the map are ignored in iteration k. Lines are assigned to hits again after a step of more than ``associate_again``
    (metres, radians). ``robust_scale``: residual at which a hit has half weight. ``range_std``: noise of a beam.
    ``wall_std``, ``furniture_std``: error of a wall and of a piece of furniture as a whole. ``slip``, ``turn_slip``,
    ``turn_shift``, ``drift``: variance added by odometry; ``dragged_turn_slip``, ``dragged_turn_shift``: of a base with
    slipping wheels in turns. A match is rejected if it explains less than ``min_inlier_ratio`` of the hits, unless most
    others end more than ``early_by`` metres before the map: then ``min_seen_ratio`` of the hits suffices if they are
    ``min_consistent_ratio`` of those that do not end early. It is also rejected more than ``max_deviation`` standard
    deviations from the prediction; if it still explains ``sure_inlier_ratio`` of the hits, the wheels have slipped, and
    the variances grow by ``surprise`` until it is accepted. Matching is skipped if the pose is less certain than
    ``unknown_std``, because a good match is then ambiguous.
    """

    planar_map: PlanarMap
    iterations: Count = 8
    gate_first: Annotated[Positive, "m"] = 0.25
    gate_decay: Fraction = 0.6
    gate_last: Annotated[Positive, "m"] = 0.04
    associate_again: Annotated[NonNegative, "m"] = 0.002
    robust_scale: Annotated[Positive, "m"] = 0.02
    range_std: Annotated[Positive, "m"] = 0.01
    wall_std: Annotated[NonNegative, "m"] = 0.001
    furniture_std: Annotated[NonNegative, "m"] = 0.025
    slip: Annotated[NonNegative, "m²/m"] = 4e-5
    turn_slip: Annotated[NonNegative, "rad²/rad"] = 9e-5
    turn_shift: Annotated[NonNegative, "m²/rad"] = 0.0
    drift: Annotated[NonNegative, "rad²/m"] = 4e-5
    dragged_turn_slip: Annotated[NonNegative, "rad²/rad"] = 0.02
    dragged_turn_shift: Annotated[NonNegative, "m²/rad"] = 0.005
    min_inlier_ratio: Fraction = 0.35
    min_seen_ratio: Fraction = 0.15
    min_consistent_ratio: Fraction = 0.8
    early_by: Annotated[NonNegative, "m"] = 0.15
    max_deviation: Positive = 4.5
    sure_inlier_ratio: Annotated[Fraction, NotBelow("min_inlier_ratio")] = 0.6
    surprise: Positive = 4.0
    unknown_std: Annotated[Positive, "m"] = 0.5
    _lines: MapLines = field(init=False, repr=False)
    _open_furniture: NDArray[np.float64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        lines = map_lines(self.planar_map, self.wall_std, self.furniture_std)
        object.__setattr__(self, "_lines", lines)
        object.__setattr__(self, "_open_furniture", open_furniture(self.planar_map))

    @override
    def for_dragged_wheels(self) -> ScanToMap:
        return replace(self, turn_slip=self.dragged_turn_slip, turn_shift=self.dragged_turn_shift)

    @override
    def start(self, pose: Pose2D, odometry: Pose2D, position_std: float, heading_std: float) -> TrackedEstimate:
        position = checked_std(position_std, "ScanToMap position_std") ** 2
        heading = checked_std(heading_std, "ScanToMap heading_std") ** 2
        odometry, pose = odometry.checked("ScanToMap odometry"), pose.checked("ScanToMap pose")
        return TrackedEstimate(pose, np.diag([position, position, heading]), None, odometry)

    @override
    def predict(self, before: TrackedEstimate, odometry: Pose2D) -> TrackedEstimate:
        moved = before.odometry.inverse() @ odometry.checked("ScanToMap odometry")
        if moved == Pose2D():
            return replace(before, odometry=odometry)
        pose, covariance = driven_on(before.pose, before.covariance, moved, self)
        return TrackedEstimate(pose, covariance, before.match, odometry)

    @override
    def correct(self, before: TrackedEstimate, scan: LaserScan, base_from_lidar: Pose2D) -> TrackedEstimate:
        hits = base_from_lidar.checked("ScanToMap base_from_lidar").apply(scan.points())
        if len(hits) < 10:
            return _refused(before, ScanMatch(False, 0.0, math.inf, f"only {len(hits)} beams hit anything"))
        if before.position_std > self.unknown_std:
            text = f"a pose as uncertain as ±{before.position_std:.1f} m cannot be tracked"
            return _refused(before, ScanMatch(False, 0.0, math.inf, text))
        visible = self._visible(before.pose @ base_from_lidar, scan)
        if len(visible) == 0:
            return _refused(before, ScanMatch(False, 0.0, math.inf, "nothing in the map is in view"))
        # A board of a shelf before a wall is not that wall.
        boards = within(self._open_furniture, before.pose.apply(hits))
        matched, information, on_map, residual = self._match(hits, boards, before.pose, visible)
        inliers = float(on_map.mean())
        if inliers < self.min_inlier_ratio and not self._is_hidden(scan, matched @ base_from_lidar, on_map):
            text = f"only {inliers:.0%} of the hits lie on something in the map"
            return _refused(before, ScanMatch(False, inliers, residual, text))
        innovation = difference(matched, before.pose)
        measured = inverse(information + WEAK_PRIOR)
        expected = before.covariance + measured
        away = deviation(innovation, expected)
        if away > self.max_deviation:
            text = f"the match lies {away:.1f} standard deviations from the prediction"
            growth = self.surprise if inliers >= self.sure_inlier_ratio else 1.0
            return _refused(before, ScanMatch(False, inliers, residual, text), growth)
        gain = before.covariance @ np.linalg.inv(expected)
        dx, dy, dtheta = (gain @ innovation).tolist()
        pose = Pose2D(before.pose.x + dx, before.pose.y + dy, wrap_angle(before.pose.theta + dtheta))
        keep = np.eye(3) - gain
        covariance = keep @ before.covariance @ keep.T + gain @ measured @ gain.T
        return TrackedEstimate(pose, covariance, ScanMatch(True, inliers, residual), before.odometry)

    def _visible(self, map_from_lidar: Pose2D, scan: LaserScan) -> NDArray[np.intp]:
        """Return the indices of visible segments: not the far side of a wall, nor segments behind it."""
        _, seen = cast_rays(self._lines.segments, map_from_lidar, scan.angles[::2])
        return np.unique(seen[seen >= 0])

    def _is_hidden(self, scan: LaserScan, map_from_lidar: Pose2D, on_map: NDArray[np.bool_]) -> bool:
        """Return whether an unknown obstacle hides the map from most beams, and the visible part of the map supports
        the pose.

        ``on_map``: the hits (N,) that lie on something in the map.
        """
        hit = np.isfinite(scan.ranges)
        expected, _ = cast_rays(self._lines.segments, map_from_lidar, scan.angles[hit])
        early = ~on_map & (scan.ranges[hit] < expected - self.early_by)
        seen = float(on_map.mean())
        return seen >= self.min_seen_ratio and seen >= self.min_consistent_ratio * float(np.mean(~early))

    def _match(
        self, hits: NDArray[np.float64], boards: NDArray[np.bool_], pose: Pose2D, visible: NDArray[np.intp]
    ) -> tuple[Pose2D, NDArray[np.float64], NDArray[np.bool_], float]:
        """Return the pose that fits best, its information matrix (3, 3), which hits (N,) lie on the map, and their
        residual.

        ``boards``: hits (N,) that lie on furniture of which the map has no lines.
        """
        segments, bodies = self._lines.segments[visible], self._lines.bodies[visible]
        starts, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
        length2 = np.sum(along**2, axis=1)
        normals = np.column_stack([-along[:, 1], along[:, 0]]) / np.sqrt(length2)[:, None]
        x, y, theta = pose.x, pose.y, pose.theta
        moved = math.inf
        jacobian = np.empty((3, len(hits)))
        for k in range(self.iterations):
            turned_x, turned_y = Pose2D(0.0, 0.0, theta).apply(hits).T
            if moved > self.associate_again:
                nearest = _nearest(turned_x + x, turned_y + y, starts, along, length2)
                start_x, start_y = starts[nearest].T
                share_x, share_y = (along[nearest] / length2[nearest, None]).T
                normal_x, normal_y = jacobian[:2] = normals[nearest].T
                squares, body, errors = length2[nearest], bodies[nearest], self._lines.body_std[bodies[nearest]] ** 2
            dx, dy = turned_x + (x - start_x), turned_y + (y - start_y)
            residuals = dx * normal_x + dy * normal_y
            u = dx * share_x + dy * share_y
            beyond = u - u.clip(0.0, 1.0)
            squared_residuals = residuals * residuals
            gate = self.gate_first * self.gate_decay**k + self.gate_last
            inlier = (squared_residuals + beyond * beyond * squares < gate**2) & ~boards
            weights = inlier / (1.0 + squared_residuals / self.robust_scale**2)
            hits_of_body = np.bincount(body, weights, minlength=len(self._lines.body_std))
            weights /= self.range_std**2 + hits_of_body[body] * errors
            jacobian[2] = normal_y * turned_x - normal_x * turned_y
            weighted = jacobian * weights
            information = weighted @ jacobian.T
            step = -np.linalg.solve(information + WEAK_PRIOR, weighted @ residuals)
            x, y, theta = x + float(step[0]), y + float(step[1]), theta + float(step[2])
            moved = float(np.abs(step).max())
            if k >= 3 and moved < 1e-5:
                break
        matched = Pose2D(x, y, wrap_angle(theta))
        residual = math.sqrt(float(np.mean(residuals[inlier] ** 2))) if inlier.any() else math.inf
        return matched, information, inlier, residual


def _refused(before: TrackedEstimate, match: ScanMatch, growth: float = 1.0) -> TrackedEstimate:
    return replace(before, covariance=growth * before.covariance, match=match)


def _nearest(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    starts: NDArray[np.float64],
    along: NDArray[np.float64],
    length2: NDArray[np.float64],
) -> NDArray[np.intp]:
    """Return for each of N points the nearest of M segments, (N,)."""
    dx, dy = x[:, None] - starts[:, 0], y[:, None] - starts[:, 1]
    u = ((dx * along[:, 0] + dy * along[:, 1]) / length2).clip(0.0, 1.0)
    dx -= u * along[:, 0]
    dy -= u * along[:, 1]
    nearest: NDArray[np.intp] = np.argmin(dx * dx + dy * dy, axis=1)
    return nearest


def cast_rays(
    segments: NDArray[np.float64], pose: Pose2D, angles: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the distance (N,) from ``pose`` along ``angles`` (N,), in its frame, to the first of ``segments`` (M, 4),
    and its index.

    Without a hit, the distance is infinite and the index -1.
    """
    if len(segments) == 0:
        return np.full(len(angles), np.inf), np.full(len(angles), -1)
    heading = angles + pose.theta
    rays = np.column_stack([np.cos(heading), np.sin(heading)])
    start = segments[:, :2] - (pose.x, pose.y)
    along = segments[:, 2:] - segments[:, :2]
    # Solve pose + t ray = start + u along for each pair by Cramer's rule.
    determinant = along[:, 0] * rays[:, 1, None] - along[:, 1] * rays[:, 0, None]
    safe = np.where(np.abs(determinant) < 1e-12, 1.0, determinant)
    t = (along[:, 0] * start[:, 1] - along[:, 1] * start[:, 0]) / safe
    u = (rays[:, 0, None] * start[:, 1] - rays[:, 1, None] * start[:, 0]) / safe
    hit = (np.abs(determinant) >= 1e-12) & (t > 0.0) & (u >= 0.0) & (u <= 1.0)
    distance = np.where(hit, t, np.inf)
    index = np.argmin(distance, axis=1)
    nearest = distance[np.arange(len(rays)), index]
    return nearest, np.where(np.isfinite(nearest), index, -1)
