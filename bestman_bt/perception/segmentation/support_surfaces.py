"""Support surfaces anywhere in a view: tables, counters and shelf boards as horizontal planes with their extents.

Pixels whose normals point up are grown into connected pieces, as in Trevor et al., "Efficient Organized Point Cloud
Segmentation with Connected Components", 2013. A plane is fitted to each; pieces of one plane that are separated only by
a nearer obstacle are joined. Only the vertical direction is known in advance.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from typing_extensions import override

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.errors import NoSurfaceError
from bestman_bt.perception.segmentation.base import Region, Side, SupportPlane
from bestman_bt.perception.segmentation.horizontal_plane import (
    HorizontalPlane,
    above_plane,
    least_squares_plane,
    rectangle,
)
from bestman_bt.perception.view import View, known_depth

_STEP, _REACH, _LEVEL = 0.03, 0.07, 0.012
_PIXELS = 2


def surface_sides(view: View, frame_from_plane: Pose, size: tuple[float, float]) -> tuple[Side, ...]:
    """Return the majority label of the points just beyond -x, +x, -y and +y of the rectangle."""
    half_x, half_y = size[0] / 2, size[1] / 2
    along = np.linspace(-0.9, 0.9, 19)
    sides: list[Side] = []
    for outward, start in (
        ((-1, 0), (-half_x, 0)),
        ((1, 0), (half_x, 0)),
        ((0, -1), (0, -half_y)),
        ((0, 1), (0, half_y)),
    ):
        reach = half_y if outward[0] else half_x
        tangent = np.array([outward[1], outward[0]]) * reach
        points = np.array(start) + along[:, None] * tangent
        sides.append(edge_kind(view, frame_from_plane, points, np.array(outward, dtype=float)))
    return tuple(sides)


def edge_kind(view: View, frame_from_plane: Pose, edge: NDArray[np.float64], outward: NDArray[np.float64]) -> Side:
    """Return how the surface ends along ``edge``, (N, 2) metres in the plane's frame. ``outward``: (2,), a unit
    vector.
    """
    votes: Counter[Side] = Counter()
    plane_from_frame = frame_from_plane.inverse()
    beyond = np.zeros((len(edge), 3))
    beyond[:, :2] = edge + _STEP * outward
    k = view.image.intrinsics
    pixels, expected = view.project(frame_from_plane.apply(beyond))
    shown = np.isfinite(pixels).all(axis=1)
    inside = np.zeros(len(edge), dtype=bool)
    inside[shown] = ((pixels[shown] >= _PIXELS) & (pixels[shown] < np.array([k.width, k.height]) - _PIXELS)).all(axis=1)
    votes["cut"] = int((~inside).sum())
    depth = np.full(len(edge), np.nan)
    # The camera often knows nothing right at an edge: the nearest pixel around that it does know is asked.
    for du, dv in _AROUND:
        unknown = inside & np.isnan(depth)
        if not unknown.any():
            break
        depth[unknown] = view.measured_depth(pixels[unknown] + (du, dv))
    known = inside & np.isfinite(depth)
    rays = np.column_stack([(pixels[known] - (k.cx, k.cy)) / (k.fx, k.fy), np.ones(int(known.sum()))])
    measured = plane_from_frame.apply(view.frame_from_camera.apply(rays * depth[known][:, None]))
    behind = depth[known] - expected[known]
    beside = np.linalg.norm(measured[:, :2] - edge[known], axis=1) < _REACH
    votes["rim"] = int((behind > _LEVEL).sum())
    votes["wall"] = int(((behind < -_LEVEL) & beside).sum())
    votes["hidden"] = len(edge) - sum(votes.values())
    return max(votes, key=lambda side: votes[side])


_AROUND = sorted(
    ((du, dv) for du in range(-_PIXELS, _PIXELS + 1) for dv in range(-_PIXELS, _PIXELS + 1)),
    key=lambda step: step[0] ** 2 + step[1] ** 2,
)


# Surface normals of a depth image: a plane through each pixel's window, all windows at once.
# Sums over windows by box filters, as in Holzer et al., "Adaptive Neighborhood Selection for Real-Time Surface Normal
# Estimation from Organized Point Cloud Data Using Integral Images", 2012; fitted to the inverse depth, in which a plane
# seen at any slant is affine: 1 / z = n · (x, y, 1) / d.


def plane_normals(
    depth: NDArray[np.float32], intrinsics: CameraIntrinsics, window: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return unit normals (H, W, 3) towards the camera, in the optical frame, and residuals (H, W): rms in metres of
    depth.

    ``depth``: (H, W) metres of the whole image. ``window``: (rows, columns), odd. Where the depth is unknown, or known
    in fewer than half of the window's pixels, the normal is NaN and the residual infinite.
    """
    depth = known_depth(depth)
    known = depth > 0
    inverse = np.where(known, 1.0 / np.maximum(depth, 1e-3), 0.0)
    rows, columns = window
    v = np.arange(rows) - rows // 2
    u = np.arange(columns) - columns // 2
    weight = known.astype(np.float64)

    def moment(values: NDArray[np.float64], power_u: int, power_v: int) -> NDArray[np.float64]:
        across, down = (u**power_u).astype(np.float64), (v**power_v).astype(np.float64)
        return np.asarray(cv2.sepFilter2D(values, cv2.CV_64F, across, down, borderType=cv2.BORDER_CONSTANT), float)

    n, su, sv = moment(weight, 0, 0), moment(weight, 1, 0), moment(weight, 0, 1)
    n = np.maximum(np.rint(n), 1.0)
    suu = moment(weight, 2, 0) - su * su / n
    suv = moment(weight, 1, 1) - su * sv / n
    svv = moment(weight, 0, 2) - sv * sv / n
    sw = moment(inverse, 0, 0)
    suw = moment(inverse, 1, 0) - su * sw / n
    svw = moment(inverse, 0, 1) - sv * sw / n
    sww = moment(inverse * inverse, 0, 0) - sw * sw / n
    determinant = suu * svv - suv * suv
    usable = known & (n >= rows * columns / 2) & (determinant > 1e-6)
    determinant = np.where(usable, determinant, 1.0)
    slope_u = (suw * svv - svw * suv) / determinant
    slope_v = (svw * suu - suw * suv) / determinant
    middle = (sw - slope_u * su - slope_v * sv) / n
    rms = np.sqrt(np.maximum(sww - slope_u * suw - slope_v * svw, 0.0) / n)
    residual = np.where(usable, rms * depth.astype(np.float64) ** 2, np.inf).astype(np.float32)
    k = intrinsics
    x = (np.arange(depth.shape[1]) - k.cx)[None, :]
    y = (np.arange(depth.shape[0]) - k.cy)[:, None]
    normal = np.stack([slope_u * k.fx, slope_v * k.fy, middle - slope_u * x - slope_v * y], axis=-1)
    length = np.sqrt((normal * normal).sum(axis=-1))
    normal = -normal / np.where(usable & (length > 0), length, np.nan)[..., None]
    return normal.astype(np.float32), residual


@dataclass(frozen=True, eq=False)
class _Piece:
    """``plane``: z = a x + b y + c through ``core``, (M, 3) points whose windows are flat; ``points``: (N, 3), all.

    A wall behind a surface and the front below it come within the tolerance of the plane, on one side each: they would
    tilt it.
    """

    plane: NDArray[np.float64]
    core: NDArray[np.float64]
    points: NDArray[np.float64]


class SurfaceDetector(ABC):
    """Finds all horizontal surfaces of a view."""

    @abstractmethod
    def find(self, view: View, rng: np.random.Generator) -> tuple[SupportPlane, ...]:
        """Return the surfaces, lowest first; x of each rectangle points away from the camera.

        Equal input and generator state give equal output. Raises NoSurfaceError, with the reason, if no surface is
        found.
        """


@dataclass(frozen=True)
class SupportSurfaces(HorizontalPlane, SurfaceDetector):
    """Finds all horizontal surfaces of a view at any height.

    Lengths in metres, angles in radians; those of the planes as in HorizontalPlane.

    ``min_height``: above the frame's origin: the floor does not count. ``min_size``: shorter and longer side of a
    surface's rectangle; ``min_fill``: minimum fraction of its rectangle that was seen or hidden by objects on it.
    ``window``: (rows, columns) of the pixels for a normal, odd; ``max_normal_tilt``: of a pixel's noisy normal.
    ``min_piece_points``: minimum pixels of a fragment. ``noise_base``, ``noise_quadratic``: depth noise, as in
    CameraPart; a window is flat up to ``max_residual`` times the noise. ``grow``: pixels by which a fragment grows over
    its plane, since windows extend over its edge. ``trim``: fraction of points cut off at each end against noise.
    ``join_height``, ``join_gap``: maximum distances of two fragments of one surface.
    """

    min_plane_points: int = 400
    min_height: Annotated[float, "m"] = 0.10
    min_size: Annotated[tuple[float, float], "m"] = (0.15, 0.25)
    min_fill: float = 0.4
    window: Annotated[tuple[int, int], "pixels"] = (5, 7)
    max_normal_tilt: Annotated[float, "rad"] = math.radians(25.0)
    min_piece_points: Annotated[int, "pixels"] = 100
    noise_base: Annotated[float, "m"] = 0.0012
    noise_quadratic: Annotated[float, "1/m"] = 0.0019
    max_residual: float = 3.5
    grow: Annotated[int, "pixels"] = 4
    trim: float = 0.004
    join_height: Annotated[float, "m"] = 0.015
    join_gap: Annotated[float, "m"] = 0.40

    @override
    def find(self, view: View, rng: np.random.Generator) -> tuple[SupportPlane, ...]:
        points, depth, _ = view.organised()
        if not (depth > 0).any():
            raise NoSurfaceError("no surface in view: the image has no depth")
        pieces = self._joined(self._pieces(points, depth, view, rng), view)
        found = [surface for piece in pieces if (surface := self._surface(piece, view)) is not None]
        if not found:
            p = self
            raise NoSurfaceError(
                f"no surface in view: nothing horizontal above {p.min_height:.2f} m measures "
                f"{p.min_size[0]:.2f} m by {p.min_size[1]:.2f} m"
            )
        found.sort(key=lambda surface: float(surface.frame_from_plane.position[2]))
        return tuple(found)

    def _pieces(
        self, points: NDArray[np.float64], depth: NDArray[np.float32], view: View, rng: np.random.Generator
    ) -> list[_Piece]:
        normals, residual = plane_normals(depth, view.image.intrinsics, self.window)
        up = normals @ view.frame_from_camera.rotation[2].astype(np.float32)
        noise = self.noise_base + self.noise_quadratic * np.maximum(depth - 0.4, 0.0) ** 2
        high = points[..., 2] > self.min_height
        flat = (up > math.cos(self.max_normal_tilt)) & (residual < self.max_residual * noise) & high
        count, labels, stats, _ = cv2.connectedComponentsWithStats(flat.astype(np.uint8), connectivity=4)
        kernel = np.ones((2 * self.grow + 1, 2 * self.grow + 1), dtype=np.uint8)
        pieces = []
        for label in range(1, count):
            column, row, width, height, area = (int(value) for value in stats[label])
            if area < self.min_piece_points:
                continue
            window = (
                slice(max(0, row - self.grow), row + height + self.grow),
                slice(max(0, column - self.grow), column + width + self.grow),
            )
            mask, around = labels[window] == label, points[window]
            plane, _ = self.fit_plane(around[mask], rng, self.min_piece_points)
            if plane is None:
                continue
            near = cv2.dilate(mask.astype(np.uint8), kernel) > 0
            on = np.abs(above_plane(around, plane)) < self.ransac_distance
            pieces.append(_Piece(plane, around[mask & on], around[near & on]))
        return pieces

    def _joined(self, pieces: list[_Piece], view: View) -> list[_Piece]:
        n = len(pieces)
        hulls = [cv2.convexHull(piece.points[:, :2].astype(np.float32))[:, 0].astype(np.float64) for piece in pieces]
        middles = [piece.points.mean(axis=0) for piece in pieces]
        links = np.eye(n, dtype=bool)
        for i in range(n):
            for j in range(i + 1, n):
                # Seen from the larger piece, since the plane of a small one is uncertain far away.
                large, small = (i, j) if len(pieces[i].points) >= len(pieces[j].points) else (j, i)
                apart = abs(float(above_plane(middles[small], pieces[large].plane)))
                links[i, j] = apart < self.join_height and self._one_surface(
                    hulls[i], hulls[j], pieces[large].plane, view
                )
        _, group = connected_components(coo_matrix(links), directed=False) if n else (0, np.zeros(0, dtype=int))
        joined = []
        for label in range(int(group.max()) + 1 if n else 0):
            members = [pieces[i] for i in np.flatnonzero(group == label)]
            core = np.concatenate([member.core for member in members])
            plane = least_squares_plane(core)
            core = core[np.abs(above_plane(core, plane)) < self.ransac_distance]
            points = np.concatenate([member.points for member in members])
            points = points[np.abs(above_plane(points, plane)) < self.ransac_distance]
            if len(core) >= self.min_piece_points and len(points) >= self.min_plane_points:
                joined.append(_Piece(least_squares_plane(core), core, points))
        return joined

    def _one_surface(
        self, first: NDArray[np.float64], second: NDArray[np.float64], plane: NDArray[np.float64], view: View
    ) -> bool:
        """Return whether nothing lower is seen through the gap between two pieces of a plane, whose hulls are given."""
        a, b = _nearest(first, second)
        if float(np.linalg.norm(a - b)) > self.join_gap:
            return False
        between = a + np.linspace(0.0, 1.0, 15)[1:-1, None] * (b - a)
        gap = np.column_stack([between, between @ plane[:2] + plane[2]])
        pixels, expected = view.project(gap)
        beyond = view.measured_depth(pixels) - expected
        seen_through = beyond > 0.05
        return bool(seen_through.sum() <= 1)

    def _surface(self, piece: _Piece, view: View) -> SupportPlane | None:
        """Return the piece with its extents, x away from the camera, or None if it is too small."""
        away = piece.points[:, :2].mean(axis=0) - view.viewpoint[:2]
        turned = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, math.atan2(away[1], away[0])))
        local = turned.inverse().apply(piece.points)
        pose, size = rectangle(local, least_squares_plane(turned.inverse().apply(piece.core)), math.pi / 4)
        frame_from_plane, size = _trimmed(turned @ pose, piece.points, self.trim)
        if min(size) < self.min_size[0] or max(size) < self.min_size[1]:
            return None
        on_plane = frame_from_plane.inverse().apply(piece.points)
        half = np.array(size) / 2
        kept = np.clip(on_plane[:, :2], -half, half)
        outline = cv2.convexHull(kept.astype(np.float32))[:, 0].astype(np.float64)
        area = cv2.contourArea((1000.0 * outline).astype(np.float32)) * 1e-6
        if area < self.min_fill * size[0] * size[1]:
            return None
        rms = float(np.sqrt(np.mean(on_plane[:, 2] ** 2)))
        inliers = piece.points[:: max(1, len(piece.points) // self.max_plane_points)]
        sides = surface_sides(view, frame_from_plane, size)
        return SupportPlane(frame_from_plane, size, inliers, rms, outline, sides)


def surface_regions(
    planes: Sequence[SupportPlane], height: float = 0.40, margin: float = 0.02, clearance: float = 0.05
) -> tuple[Region, ...]:
    """Return one region per surface, for a Segmentation or a Detector, for example for each board of a shelf.

    ``height``: of the searched space above it, metres; limited to ``clearance`` metres below the next surface above.
    ``margin``: metres around the visible rectangle.
    """
    regions = []
    for plane in planes:
        size = (plane.size[0] + 2 * margin, plane.size[1] + 2 * margin)
        region = Region(plane.frame_from_plane, size, height, tolerance=0.03)
        for other in planes:
            rise = float(plane.heights(other.frame_from_plane.position[None])[0])
            if clearance < rise and _covers(other, plane):
                region = replace(region, height=min(region.height, rise - clearance))
        regions.append(region)
    return tuple(regions)


def _trimmed(frame_from_plane: Pose, points: NDArray[np.float64], share: float) -> tuple[Pose, tuple[float, float]]:
    xy = frame_from_plane.inverse().apply(points)[:, :2]
    lower, upper = np.quantile(xy, [share, 1.0 - share], axis=0)
    x, y = (lower + upper) / 2
    return frame_from_plane @ Pose(np.array([x, y, 0.0])), (float(upper[0] - lower[0]), float(upper[1] - lower[1]))


def _covers(upper: SupportPlane, lower: SupportPlane) -> bool:
    x, y = lower.size[0] / 2, lower.size[1] / 2
    mine = np.array([(-x, -y), (x, -y), (x, y), (-x, y)], dtype=np.float32)
    assert upper.outline is not None
    outline = np.column_stack([upper.outline, np.zeros(len(upper.outline))])
    over = (lower.frame_from_plane.inverse() @ upper.frame_from_plane).apply(outline)[:, :2]
    common, _ = cv2.intersectConvexConvex(1000.0 * mine, cv2.convexHull((1000.0 * over).astype(np.float32)))
    return common > 0.0


def _nearest(
    first: NDArray[np.float64], second: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the nearest points of two outlines (K, 2), sampled every centimetre or so."""
    a, b = (_sampled(outline) for outline in (first, second))
    distance = np.linalg.norm(a[:, None] - b[None], axis=2)
    i, j = np.unravel_index(int(np.argmin(distance)), distance.shape)
    return a[i], b[j]


def _sampled(outline: NDArray[np.float64]) -> NDArray[np.float64]:
    ahead = np.roll(outline, -1, axis=0)
    steps = np.maximum(1, np.ceil(np.linalg.norm(ahead - outline, axis=1) / 0.02)).astype(int)
    return np.concatenate(
        [start + np.arange(n)[:, None] / n * (end - start) for start, end, n in zip(outline, ahead, steps, strict=True)]
    )
