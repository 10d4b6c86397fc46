"""Upright planes in a view: the fronts of doors and drawers, walls, sides.

Windows of the depth image vote for directions, then for distances: a Hough transform (Borrmann et al., "The 3D Hough
Transform for Plane Detection in Point Clouds", 2011) with only one angle, since fronts are upright.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.view import View

# A plane through the neighbourhood of every few pixels of a depth image.
# The inverse depth of a plane is linear in the pixel coordinates, so least squares over a window needs only sums over
# windows: Holzer et al., "Adaptive Neighborhood Selection for Real-Time Surface Normal Estimation from Organized Point
# Cloud Data Using Integral Images", IROS 2012; there for depth changes, here for the inverse depth.


@dataclass(frozen=True, eq=False)
class LocalPlanes:
    """Local plane fits, one per grid point, in the optical frame; grid points are ``stride`` pixels apart.

    ``points``: (R, C, 3) metres, intersection of the plane with the ray of the grid point. ``normals``: (R, C, 3) unit,
    towards the camera. ``residuals``: (R, C) metres, root mean square of the depths' distances from the plane along the
    optical axis. ``valid``: (R, C), False where too few depths are known.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    residuals: NDArray[np.float64]
    valid: NDArray[np.bool_]
    stride: int


def local_planes(
    depth: NDArray[np.float32], intrinsics: CameraIntrinsics, window: int, stride: int, min_known: float = 0.6
) -> LocalPlanes:
    """Fit a plane to each window of ``window`` pixels squared of ``depth`` (H, W), metres, 0 where unknown.

    A window is valid if at least the fraction ``min_known`` of its pixels has depth.
    """
    k = intrinsics
    known = depth > 0
    mask = known.astype(np.float64)
    inverse = np.zeros(depth.shape)
    inverse[known] = 1.0 / depth[known]
    # Coordinates relative to each grid point are formed after the sums, by the shift rule of moments.
    x = np.broadcast_to((np.arange(k.width) - k.cx) / k.fx, depth.shape)
    y = np.broadcast_to(((np.arange(k.height) - k.cy) / k.fy)[:, None], depth.shape)
    rows = np.arange(stride // 2, k.height, stride)
    columns = np.arange(stride // 2, k.width, stride)

    def total(values: NDArray[np.float64]) -> NDArray[np.float64]:
        sums = cv2.boxFilter(values, cv2.CV_64F, (window, window), normalize=False, borderType=cv2.BORDER_CONSTANT)
        return np.asarray(sums, dtype=np.float64)[np.ix_(rows, columns)]

    n = np.maximum(total(mask), 1.0)
    mean_x, mean_y = total(mask * x) / n, total(mask * y) / n
    mean_w = total(inverse) / n
    xx = total(mask * x * x) / n - mean_x**2
    yy = total(mask * y * y) / n - mean_y**2
    xy = total(mask * x * y) / n - mean_x * mean_y
    xw = total(inverse * x) / n - mean_x * mean_w
    yw = total(inverse * y) / n - mean_y * mean_w
    ww = total(inverse * inverse) / n - mean_w**2
    determinant = xx * yy - xy**2
    valid = (n >= min_known * window * window) & (determinant > 1e-6 * (xx + yy) ** 2)
    safe = np.where(valid, determinant, 1.0)
    a = (yy * xw - xy * yw) / safe
    b = (xx * yw - xy * xw) / safe
    c = mean_w - a * mean_x - b * mean_y
    gx, gy = x[np.ix_(rows, columns)], y[np.ix_(rows, columns)]
    w = a * gx + b * gy + c
    valid &= w > 0.05
    z = 1.0 / np.where(valid, w, 1.0)
    normals = -np.stack([a, b, c], axis=-1)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    residuals = np.sqrt(np.maximum(ww - a * xw - b * yw, 0.0)) * z**2
    return LocalPlanes(np.stack([gx * z, gy * z, z], axis=-1), normals, residuals, valid, stride)


@dataclass(frozen=True)
class FrontSearch:
    """Finds the vertical planes in a view.

    Lengths in metres, angles in radians.

    ``noise_base``, ``noise_quadratic``: depth noise is base + quadratic (z - 0.4 m)², see CameraPart. ``window``,
    ``stride``: of the local planes, pixels of an image 640 pixels wide. ``max_tilt``: of a front from the vertical.
    ``max_incidence``: between its normal and the viewing ray. ``max_range``: of fronts from the camera. ``yaw_bin``,
    ``offset_bin``: bin sizes of the votes. ``yaw_window``: windows within it vote for one direction. ``offset_window``:
    windows within it belong to a front. ``min_area``: area covered by the windows of a front, square metres.
    ``max_gap``: holes and gaps up to this size belong to the front. ``max_fronts``: maximum number per view.
    """

    noise_base: Annotated[float, "m"] = 0.0012
    noise_quadratic: Annotated[float, "1/m"] = 0.0019
    window: Annotated[int, "pixels"] = 15
    stride: Annotated[int, "pixels"] = 4
    max_tilt: Annotated[float, "rad"] = math.radians(12.0)
    max_incidence: Annotated[float, "rad"] = math.radians(65.0)
    max_range: Annotated[float, "m"] = 2.6
    yaw_bin: Annotated[float, "rad"] = math.radians(1.5)
    yaw_window: Annotated[float, "rad"] = math.radians(5.0)
    offset_bin: Annotated[float, "m"] = 0.003
    offset_window: Annotated[float, "m"] = 0.007
    min_area: Annotated[float, "m²"] = 0.012
    max_gap: Annotated[float, "m"] = 0.13
    max_fronts: int = 10

    def noise(self, depth: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Return the standard deviation of measured depths, metres."""
        beyond = np.maximum(np.asarray(depth, dtype=float) - 0.4, 0.0)
        noise: NDArray[np.float64] = self.noise_base + self.noise_quadratic * beyond**2
        return noise

    def find(self, view: View) -> list[FrontPlane]:
        """Return all upright planes, the largest visible area first."""
        intrinsics = view.image.intrinsics
        scale = intrinsics.width / 640.0
        window = max(5, 2 * round(self.window * scale / 2) + 1)
        depth = np.where(np.isfinite(view.image.depth), view.image.depth, 0.0).astype(np.float32)
        planes = local_planes(depth, intrinsics, window, max(1, round(self.stride * scale)))
        rotation, eye = view.frame_from_camera.rotation, view.frame_from_camera.position
        normals = planes.normals @ rotation.T
        points = planes.points @ rotation.T + eye
        area = _window_areas(planes, intrinsics.fx)
        usable = self._upright(planes, normals)
        fronts: list[FrontPlane] = []
        for _ in range(3 * self.max_fronts):
            if usable.sum() < 6 or len(fronts) >= self.max_fronts:
                break
            members = self._best_plane(points, normals, area, usable)
            if not members.any():
                break
            usable &= ~members
            fronts.extend(
                self._front(points, normals, part, planes, depth.shape, intrinsics.fx)
                for part in self._connected(members, planes, intrinsics.fx)
                if area[part].sum() >= self.min_area
            )
        fronts.sort(key=lambda front: -front.area)
        return fronts

    def _upright(self, planes: LocalPlanes, normals: NDArray[np.float64]) -> NDArray[np.bool_]:
        rays = planes.points / np.maximum(np.linalg.norm(planes.points, axis=-1, keepdims=True), 1e-9)
        facing = -(rays * planes.normals).sum(axis=-1) > math.cos(self.max_incidence)
        flat = planes.residuals < 1.6 * self.noise(planes.points[..., 2]) + 0.001
        near = planes.points[..., 2] < self.max_range
        upright: NDArray[np.bool_] = (
            planes.valid & facing & flat & near & (np.abs(normals[..., 2]) < math.sin(self.max_tilt))
        )
        return upright

    def _best_plane(
        self,
        points: NDArray[np.float64],
        normals: NDArray[np.float64],
        area: NDArray[np.float64],
        usable: NDArray[np.bool_],
    ) -> NDArray[np.bool_]:
        """Return the windows of the plane that has most votes, as a mask of the grid."""
        yaws = np.arctan2(normals[..., 1], normals[..., 0])[usable]
        weights = area[usable]
        bins = round(2 * math.pi / self.yaw_bin)
        votes = np.bincount(((yaws + math.pi) / self.yaw_bin).astype(int) % bins, weights, bins)
        smooth = votes + np.roll(votes, 1) + np.roll(votes, -1)
        yaw = (int(np.argmax(smooth)) + 0.5) * self.yaw_bin - math.pi
        for _ in range(2):
            turn = (yaws - yaw + math.pi) % (2 * math.pi) - math.pi
            alike = np.abs(turn) < self.yaw_window
            yaw += float(np.average(turn[alike], weights=weights[alike]))
        normal = np.array([math.cos(yaw), math.sin(yaw), 0.0])
        # Distances are counted from amid the voters: then a small error of the yaw shifts them least.
        centre = np.average(points[usable][alike], axis=0, weights=weights[alike])
        offsets = (points - centre) @ normal
        among = offsets[usable][alike]
        first = among.min() - 2 * self.offset_bin
        counted = np.bincount(((among - first) / self.offset_bin).astype(int), weights[alike])
        peak = int(np.argmax(np.convolve(counted, np.ones(3), mode="same")))
        offset = first + (peak + 0.5) * self.offset_bin
        turns = (np.arctan2(normals[..., 1], normals[..., 0]) - yaw + math.pi) % (2 * math.pi) - math.pi
        wide = usable & (np.abs(turns) < 2 * self.yaw_window)
        heights = offsets - offset
        for _ in range(3):
            inlier = wide & (np.abs(heights) < self.offset_window)
            if inlier.sum() < 6:
                break
            # The plane may lean: the camera's pose is not free of errors.
            local = points - centre
            across = local @ np.array([-normal[1], normal[0], 0.0])
            matrix = np.stack([across[inlier], local[..., 2][inlier], np.ones(int(inlier.sum()))], axis=1)
            weight = np.sqrt(area[inlier])
            solution = np.linalg.lstsq(matrix * weight[:, None], offsets[inlier] * weight, rcond=1e-9)[0]
            heights = offsets - (solution[0] * across + solution[1] * local[..., 2] + solution[2])
        members: NDArray[np.bool_] = wide & (np.abs(heights) < self.offset_window)
        return members

    def _connected(self, members: NDArray[np.bool_], planes: LocalPlanes, focal: float) -> list[NDArray[np.bool_]]:
        """Return the separate parts of a plane; holes and gaps up to ``max_gap`` do not separate."""
        depth = float(np.median(planes.points[..., 2][members]))
        reach = max(1, round(self.max_gap / 2 * focal / depth / planes.stride))
        kernel = cv2.getStructuringElement(cv2.MORPH_RECT, (2 * reach + 1, 2 * reach + 1))
        count, labels = cv2.connectedComponents(cv2.dilate(members.astype(np.uint8), kernel), connectivity=4)
        return [members & (labels == label) for label in range(1, count)]

    def _front(
        self,
        points: NDArray[np.float64],
        normals: NDArray[np.float64],
        part: NDArray[np.bool_],
        planes: LocalPlanes,
        shape: tuple[int, ...],
        focal: float,
    ) -> FrontPlane:
        inliers = points[part]
        centre = inliers.mean(axis=0)
        mean_normal = normals[part].mean(axis=0)
        _, _, axes = np.linalg.svd(inliers - centre, full_matrices=False)
        normal = axes[2] if axes[2] @ mean_normal > 0 else -axes[2]
        if normal @ mean_normal < 0.985 * np.linalg.norm(mean_normal):
            # A strip too thin to span a plane by its points alone.
            normal = mean_normal / np.linalg.norm(mean_normal)
        right = np.cross([0.0, 0.0, 1.0], normal)
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(normal, right), normal], axis=1)
        local = (inliers - centre) @ rotation
        half = 0.5 * self.window * float(planes.points[..., 2][part].mean()) / focal
        low, high = local[:, :2].min(axis=0) - half, local[:, :2].max(axis=0) + half
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation, centre
        rms = float(np.sqrt(np.mean(local[:, 2] ** 2)))
        return FrontPlane(Pose.from_matrix(matrix), low, high, self._region(part, planes, shape, focal), inliers, rms)

    def _region(
        self, part: NDArray[np.bool_], planes: LocalPlanes, shape: tuple[int, ...], focal: float
    ) -> NDArray[np.bool_]:
        """Return the grid points of a front as pixels: grown by half a window, holes closed."""
        depth = float(planes.points[..., 2][part].mean())
        reach = max(1, round(self.max_gap / 2 * focal / depth / planes.stride))
        grown = max(1, round(self.window / 2 / planes.stride))
        padded = np.pad(part.astype(np.uint8), reach + grown)
        dilated = cv2.dilate(padded, np.ones((2 * grown + 1, 2 * grown + 1), np.uint8))
        closed = cv2.morphologyEx(dilated, cv2.MORPH_CLOSE, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
        inner = closed[reach + grown : -(reach + grown), reach + grown : -(reach + grown)]
        rows, columns = (
            np.minimum(np.arange(extent) // planes.stride, count - 1)
            for extent, count in zip(shape, inner.shape, strict=True)
        )
        region: NDArray[np.bool_] = inner[np.ix_(rows, columns)] > 0
        return region


@dataclass(frozen=True, eq=False)
class FrontPlane:
    """A vertical plane and its extent in the image.

    ``frame_from_front``: x to the right as seen from the front, y up, z out of the front; origin in the middle of the
    visible part. ``low``, ``high``: (2,) metres, (x, y) limits of the visible part. ``region``: (H, W), pixels that
    show the plane or small objects in front of it. ``inliers``: (N, 3) metres, points of the plane in the frame.
    ``rms``: root mean square of their distances, metres.
    """

    frame_from_front: Pose
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    region: NDArray[np.bool_]
    inliers: NDArray[np.float64]
    rms: float

    @property
    def area(self) -> float:
        """Return the area of the observed rectangle, square metres."""
        return float(np.prod(self.high - self.low))


def _window_areas(planes: LocalPlanes, focal: float) -> NDArray[np.float64]:
    """Return the area of the plane that each grid point represents, m²."""
    rays = planes.points / np.maximum(np.linalg.norm(planes.points, axis=-1, keepdims=True), 1e-9)
    incidence = np.clip(-(rays * planes.normals).sum(axis=-1), 0.1, 1.0)
    area: NDArray[np.float64] = (planes.points[..., 2] * planes.stride / focal) ** 2 / incidence
    return area
