"""The support plane near an expected height: RANSAC, least squares, and the bounding rectangle of its points.

Fischler and Bolles, "Random Sample Consensus", 1981; applied to nearly horizontal planes z = a x + b y + c.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.perception.errors import NoSurfaceError
from bestman_bt.perception.segmentation.base import Region, SupportPlane


def footprint(xy: NDArray[np.float64], grow: float = 0.0) -> NDArray[np.float32]:
    """Return the convex hull of points (N, 2), enlarged by ``grow``, all in metres, as (K, 1, 2) millimetres.

    Millimetres, because OpenCV treats areas below 1e-6 as empty.
    """
    if grow > 0.0:
        angles = np.arange(8) * math.pi / 4
        ring = grow * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        # The hull of the grown points is that of the grown hull, and the hull has few points.
        hull = np.asarray(cv2.convexHull((1000.0 * xy).astype(np.float32)), dtype=np.float64)[:, 0]
        xy = ((hull / 1000.0)[:, None, :] + ring).reshape(-1, 2)
    return np.asarray(cv2.convexHull((1000.0 * xy).astype(np.float32)), dtype=np.float32)


def overlaps(footprints: Sequence[NDArray[np.float32]]) -> NDArray[np.float64]:
    """Return the shared area (n, n) of each two footprints as a fraction of the smaller one; 1 on the diagonal."""
    n = len(footprints)
    areas = [cv2.contourArea(outline) for outline in footprints]
    lower = np.array([outline.min(axis=(0, 1)) for outline in footprints]).reshape(n, 2)
    upper = np.array([outline.max(axis=(0, 1)) for outline in footprints]).reshape(n, 2)
    shares = np.eye(n)
    for i in range(n):
        for j in range(i + 1, n):
            smaller = min(areas[i], areas[j])
            if smaller <= 0.0 or (lower[i] > upper[j]).any() or (lower[j] > upper[i]).any():
                continue
            common, _ = cv2.intersectConvexConvex(footprints[i], footprints[j])
            shares[i, j] = shares[j, i] = common / smaller
    return shares


def inside_region(local: NDArray[np.float64], region: Region) -> NDArray[np.bool_]:
    """Return which points (..., 3) of the region's own frame lie in its box; NaN lies outside."""
    x, y, z = local[..., 0], local[..., 1], local[..., 2]
    half_x, half_y = region.size[0] / 2, region.size[1] / 2
    inside: NDArray[np.bool_] = (np.abs(x) <= half_x) & (np.abs(y) <= half_y)
    return inside & (z >= -region.tolerance) & (z <= region.height)


@dataclass(frozen=True)
class HorizontalPlane:
    """Fits nearly horizontal planes to points. Lengths in metres, angles in radians.

    ``min_plane_points``: minimum pixels of a surface; at most about ``max_plane_points`` are used. ``max_tilt``: of the
    plane. ``ransac_samples``, ``ransac_points``: number of triples tried, and of points that rate them;
    ``ransac_distance``: of an inlier. ``lower_share``: fraction of the points, and of the area of the largest plane,
    that a lower plane needs to be the surface: the largest one is then an object on it, such as a tray.
    """

    min_plane_points: Annotated[int, "pixels"] = 1500
    max_plane_points: Annotated[int, "pixels"] = 30000
    max_tilt: Annotated[float, "rad"] = math.radians(6.0)
    ransac_samples: int = 100
    ransac_points: int = 1500
    ransac_distance: Annotated[float, "m"] = 0.008
    lower_share: float = 0.15

    def find_plane(
        self, local: NDArray[np.float64], region: Region, rng: np.random.Generator, pixels_per_point: int = 1
    ) -> SupportPlane:
        """Return the lowest plane through enough points (N, 3) of the region's own frame near the expected height.

        The result is in the frame of the region's pose. Raises NoSurfaceError, with the reason, if no plane is found.
        """
        band = local[np.abs(local[:, 2]) <= region.tolerance]
        if len(band) * pixels_per_point < self.min_plane_points:
            raise NoSurfaceError(_no_surface(region, len(band) * pixels_per_point, self.min_plane_points))
        step = max(1, len(band) // self.max_plane_points)
        band, pixels_per_point = band[::step], pixels_per_point * step
        plane, found = self.fit_plane(band, rng, self.min_plane_points // pixels_per_point)
        if plane is None:
            raise NoSurfaceError(_no_surface(region, found * pixels_per_point, self.min_plane_points))
        lying = band[:0]
        while (lower := self._lower_plane(band, plane, rng)) is not None:
            lying = np.concatenate([lying, band[np.abs(above_plane(band, plane)) < self.ransac_distance]])
            plane = lower
        residuals = above_plane(band, plane)
        inlier = np.abs(residuals) < self.ransac_distance
        tall = local[above_plane(local, plane) > 2 * self.ransac_distance]
        surface_from_plane, size = rectangle(np.concatenate([_beside(band[inlier], tall, 0.012), lying]), plane)
        inliers = region.frame_from_surface.apply(band[inlier])
        rms = float(np.sqrt(np.mean(residuals[inlier] ** 2)))
        return SupportPlane(region.frame_from_surface @ surface_from_plane, size, inliers, rms)

    def _lower_plane(
        self, band: NDArray[np.float64], plane: NDArray[np.float64], rng: np.random.Generator
    ) -> NDArray[np.float64] | None:
        """Return a plane (a, b, c) clearly below ``plane`` with its fraction of the points (N, 3) and of the extent.

        First of the points a whole step below it, then of those less below: a plane that slants across a low step has
        points of both levels, and the lower plane fits its own points better.
        """
        heights = above_plane(band, plane)
        near = np.abs(heights) < self.ransac_distance
        needed = math.ceil(self.lower_share * len(band))
        for step in (2.0, 1.0, 0.5, 0.0):
            below = band[heights < -step * self.ransac_distance]
            lower, _ = self.fit_plane(below, rng, needed) if len(below) >= needed else (None, 0)
            if lower is not None:
                lower, _ = self.refined_plane(lower, band, needed)
            if lower is None:
                continue
            above = above_plane(band, lower)
            near_lower = np.abs(above) < self.ransac_distance
            slants = np.std(above[near_lower]) < np.std(heights[near])
            if np.mean(above - heights) < self.ransac_distance / 2 or (step < 2.0 and not slants):
                continue
            covered, of_plane = (cv2.contourArea(footprint(band[inlier, :2])) for inlier in (near_lower, near))
            if covered >= self.lower_share * of_plane:
                return lower
        return None

    def fit_plane(
        self, points: NDArray[np.float64], rng: np.random.Generator, needed: int
    ) -> tuple[NDArray[np.float64] | None, int]:
        """Return (a, b, c) of the nearly horizontal plane z = a x + b y + c with most of the points (N, 3), and their
        number.

        None if fewer than ``needed`` points lie on it.
        """
        judges = points[:: max(1, len(points) // self.ransac_points)]
        triples = judges[rng.integers(len(judges), size=(self.ransac_samples, 3))]
        matrices = np.concatenate([triples[:, :, :2], np.ones((self.ransac_samples, 3, 1))], axis=2)
        usable = np.abs(np.linalg.det(matrices)) > 1e-4
        planes = np.linalg.solve(matrices[usable], triples[usable][:, :, 2:])[:, :, 0]
        planes = planes[np.hypot(planes[:, 0], planes[:, 1]) <= math.tan(self.max_tilt)]
        if len(planes) == 0:
            return None, 0
        distances = np.abs(planes[:, :2] @ judges[:, :2].T + planes[:, 2:] - judges[:, 2])
        # By how near the points lie (Torr and Zisserman, "MLESAC", 2000): a slanted plane across a step has as many.
        fits = np.maximum(1.0 - np.square(distances / self.ransac_distance), 0.0).sum(axis=1)
        return self.refined_plane(planes[int(np.argmax(fits))], points, needed)

    def refined_plane(
        self, plane: NDArray[np.float64], points: NDArray[np.float64], needed: int
    ) -> tuple[NDArray[np.float64] | None, int]:
        """Return the least-squares plane through the points (N, 3) near ``plane`` (a, b, c), like ``fit_plane``."""
        for limit in (1.5 * self.ransac_distance, self.ransac_distance, self.ransac_distance):
            inlier = np.abs(above_plane(points, plane)) < limit
            found = int(inlier.sum())
            if found < max(3, needed):
                return None, found
            plane = least_squares_plane(points[inlier])
        return plane, found


def least_squares_plane(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (a, b, c) of z = a x + b y + c through points (N, 3), by least squares."""
    centre = points.mean(axis=0)
    x, y, z = (points - centre).T
    # Sums, not dot products: BLAS adds in another order with another number of threads.
    xx, xy, yy, xz, yz = ((a * b).sum() for a, b in ((x, x), (x, y), (y, y), (x, z), (y, z)))
    slopes = np.linalg.solve([[xx, xy], [xy, yy]], [xz, yz])
    return np.array([slopes[0], slopes[1], centre[2] - slopes @ centre[:2]])


def rectangle(
    inliers: NDArray[np.float64], plane: NDArray[np.float64], max_turn: float = math.radians(6.0)
) -> tuple[Pose, tuple[float, float]]:
    """Return the smallest rectangle around the inliers whose sides lie within ``max_turn`` of the axes, and its size.

    The pose's x is the turned x axis, its z the normal of ``plane`` (a, b, c).
    """
    hull = cv2.convexHull(inliers[:, :2].astype(np.float32))[:, 0].astype(np.float64)
    sides = np.diff(np.vstack([hull, hull[:1]]), axis=0)
    angles = np.arctan2(sides[:, 1], sides[:, 0])
    turns = np.mod(angles + math.pi / 4, math.pi / 2) - math.pi / 4
    long_sides = np.linalg.norm(sides, axis=1) > 0.02
    best: tuple[float, float, NDArray[np.float64], NDArray[np.float64]] | None = None
    for turn in [0.0, *np.unique(turns[long_sides & (np.abs(turns) < max_turn)])]:
        c, s = math.cos(turn), math.sin(turn)
        rotated = hull @ np.array([[c, -s], [s, c]])
        lower, upper = rotated.min(axis=0), rotated.max(axis=0)
        area = float(np.prod(upper - lower))
        if best is None or area < best[0]:
            best = (area, float(turn), lower, upper)
    assert best is not None
    _, turn, lower, upper = best
    c, s = math.cos(turn), math.sin(turn)
    x, y = np.array([[c, -s], [s, c]]) @ ((lower + upper) / 2)
    normal = np.array([-plane[0], -plane[1], 1.0]) / math.sqrt(1.0 + plane[0] ** 2 + plane[1] ** 2)
    x_axis = np.array([c, s, plane[0] * c + plane[1] * s])
    x_axis /= np.linalg.norm(x_axis)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([x_axis, np.cross(normal, x_axis), normal], axis=1)
    matrix[:3, 3] = x, y, plane[0] * x + plane[1] * y + plane[2]
    return Pose.from_matrix(matrix), (float(upper[0] - lower[0]), float(upper[1] - lower[1]))


def above_plane(points: NDArray[np.float64], plane: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vertical distances (...,) of points (..., 3) above the plane (a, b, c), metres."""
    above: NDArray[np.float64] = points[..., 2] - plane[0] * points[..., 0] - plane[1] * points[..., 1] - plane[2]
    return above


def _beside(points: NDArray[np.float64], tall: NDArray[np.float64], distance: float) -> NDArray[np.float64]:
    """Return the points that have no tall point above or beside them: the foot of a wall does not belong to a
    surface.
    """
    lower = points[:, :2].min(axis=0) - distance
    column, row = (np.floor((points[:, axis] - lower[axis]) / distance).astype(np.intp) for axis in (0, 1))
    taken = np.zeros((column.max() + 2, row.max() + 2), dtype=np.uint8)
    tall_column, tall_row = (np.floor((tall[:, axis] - lower[axis]) / distance).astype(np.intp) for axis in (0, 1))
    near = (tall_column >= 0) & (tall_column < taken.shape[0]) & (tall_row >= 0) & (tall_row < taken.shape[1])
    taken[tall_column[near], tall_row[near]] = 1
    taken = cv2.dilate(taken, np.ones((3, 3), dtype=np.uint8))
    beside = points[taken[column, row] == 0]
    return beside if len(beside) > 100 else points


def _no_surface(region: Region, found: int, needed: int) -> str:
    x, y, z = region.frame_from_surface.position
    return (
        f"no surface in view near x {x:.2f} y {y:.2f} z {z:.2f} m (±{region.tolerance:.2f} m): "
        f"{found} measured points, at least {needed} are needed; "
        "stand at the surface and look at it first (NavigateTo, LookAt)"
    )
