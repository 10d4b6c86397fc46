"""The likelihood of each yaw given a view, and the set of plausible yaws.

At every yaw of a grid the object is translated to its best fit. Two kinds of evidence count against a yaw: measured
points far from the model (a handle was seen where the model has none), and model surface that would float in front of
measured depth (a handle should be visible but is not). Parts hidden by the object itself, another object or the image's
border are ignored. Both are robust Gaussian costs, as in the beam model of Thrun, Burgard and Fox, "Probabilistic
Robotics", 2005.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, YawSet
from bestman_bt.messages.pose import wrap_angle
from bestman_bt.perception.pose_estimation.model_surface import color_distances
from bestman_bt.perception.pose_estimation.point_to_plane import YawObservability, evenly, slide, surface_distances
from bestman_bt.perception.view import View

# Does a part of a placed model float where the image shows that nothing is?
# A sample floats where everything measured around its pixel is farther away. Cameras do not measure the edges of
# things: where some of it is unknown, the colours decide: nothing of the model is where nothing has its colours.


@dataclass(frozen=True, eq=False)
class SeenSpace:
    """A rectangle of the image with the smallest depth measured around each pixel, metres.

    ``nearest``: (h, w), infinite without a measurement. ``doubtful``: (h, w), a neighbour has no measurement and a
    colour of the model. ``corner``: (u, v) of the first pixel.
    """

    nearest: NDArray[np.float64]
    doubtful: NDArray[np.bool_]
    corner: NDArray[np.intp]

    def excess(self, pixels: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distances (N,), metres, by which samples at ``pixels`` (N, 2) and ``depth`` (N,) are in front of
        the measurements.

        0 if they are not, or if unknown.
        """
        finite = np.isfinite(pixels).all(axis=1)
        u, v = (np.rint(np.where(finite, pixels[:, axis], -1e6)).astype(np.intp) - self.corner[axis] for axis in (0, 1))
        inside = (u >= 0) & (u < self.nearest.shape[1]) & (v >= 0) & (v < self.nearest.shape[0])
        excess = np.zeros(len(pixels))
        nearest = self.nearest[v[inside], u[inside]]
        known = np.isfinite(nearest) & ~self.doubtful[v[inside], u[inside]]
        excess[inside] = np.where(known, np.maximum(0.0, np.where(known, nearest, 0.0) - depth[inside]), 0.0)
        return excess


def seen_space(
    view: View, pixels: NDArray[np.float64], radius: int, palette: NDArray[np.float64], color: float
) -> SeenSpace:
    """Return the space measured around ``pixels`` (N, 2), within ``radius`` pixels of each.

    ``palette``: (K, 3) rgb of the model, 0 to 1; ``color``: maximum chromaticity distance of the model's colours.
    """
    k = view.image.intrinsics
    rows, columns = _window(pixels, radius, k)
    depth = view.image.depth[rows, columns].astype(np.float64)
    known = np.isfinite(depth) & (depth > 0)
    around = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
    if depth.size == 0:
        return SeenSpace(np.zeros((0, 0)), np.zeros((0, 0), dtype=bool), np.zeros(2, dtype=np.intp))
    nearest = np.asarray(cv2.erode(np.where(known, depth, np.inf), around, borderValue=np.inf), dtype=np.float64)
    colors = view.image.rgb[rows, columns]
    alike = (color_distances(colors.reshape(-1, 3), palette) < color).reshape(depth.shape)
    unknown_near = cv2.dilate((~known).astype(np.uint8), around) > 0
    alike_near = cv2.dilate(alike.astype(np.uint8), around) > 0
    return SeenSpace(nearest, unknown_near & alike_near, np.array([columns.start, rows.start]))


def _window(pixels: NDArray[np.float64], radius: int, k: CameraIntrinsics) -> tuple[slice, slice]:
    finite = pixels[np.isfinite(pixels).all(axis=1)]
    if len(finite) == 0:
        return slice(0, 0), slice(0, 0)
    size = np.array([k.width, k.height])
    first = np.clip(np.floor(finite.min(axis=0)).astype(int) - radius - 1, 0, size)
    last = np.clip(np.ceil(finite.max(axis=0)).astype(int) + radius + 2, 0, size)
    return slice(int(first[1]), int(last[1])), slice(int(first[0]), int(last[0]))


@dataclass(frozen=True)
class YawSearch:
    """Computes how well each yaw explains a view.

    Lengths in metres.

    ``points``: maximum points of the cluster; ``slide_points``, ``iterations``, ``scale``: for the translation at each
    yaw. ``telling``: samples that move by more than this when the object rotates are tested for floating, at most
    ``samples`` of them. ``model_error``: added to the depth noise. ``cap``: maximum cost of one point or sample;
    ``floating_weight``: of 9 mm² of floating surface, relative to a point. ``position_error``: a sample floats only if
    no measured depth within this distance is as near. ``color``: maximum chromaticity distance of pixels that may show
    the model. ``margin``: a yaw is ambiguous if its log-likelihood is at most this much below the best.
    """

    points: int = 500
    slide_points: int = 150
    iterations: int = 6
    scale: Annotated[float, "m"] = 0.004
    telling: Annotated[float, "m"] = 0.005
    samples: int = 700
    model_error: Annotated[float, "m"] = 0.001
    cap: float = 4.0
    floating_weight: float = 0.5
    position_error: Annotated[float, "m"] = 0.002
    color: float = 0.10
    margin: float = 16.0

    def profile(
        self,
        turned: YawObservability,
        points: NDArray[np.float64],
        plane_view: View,
        start: NDArray[np.float64],
        palette: NDArray[np.float64],
        noise: float,
    ) -> YawProfile:
        """Return the likelihood of each rotation of ``turned``.

        ``points``: (N, 3) of the cluster, ``plane_view``: their view, both in the plane's frame. ``start``: (3,), x, y,
        yaw of a good fit. ``palette``: (K, 3), colours of the model. ``noise``: of depth, metres.
        """
        yaws = start[2] + turned.angles
        c, s = math.cos(start[2]), math.sin(start[2])
        shifts = turned.shifts @ np.array([[c, s], [-s, c]])
        poses = np.column_stack([start[:2] + shifts, yaws])
        some = points[evenly(len(points), self.points)]
        poses = slide(
            turned.surface,
            some[evenly(len(some), self.slide_points)],
            poses,
            self.iterations,
            self.scale,
            plane_view.viewpoint,
        )
        log_likelihood = self.likelihood(turned, some, plane_view, poses, palette, noise)
        return YawProfile(yaws, poses[:, :2], log_likelihood)

    def likelihood(
        self,
        turned: YawObservability,
        points: NDArray[np.float64],
        plane_view: View,
        poses: NDArray[np.float64],
        palette: NDArray[np.float64],
        noise: float,
    ) -> NDArray[np.float64]:
        """Return the log-likelihood (S,) of the poses (S, 3): x, y, yaw in the plane's frame."""
        variance = noise**2 + self.model_error**2
        unexplained = surface_distances(turned.surface, points, poses, plane_view.viewpoint)
        cost = np.minimum(unexplained**2 / (2 * variance), self.cap).sum(axis=1)
        floating = self._floating_cost(turned, plane_view, poses, palette, variance)
        log_likelihood: NDArray[np.float64] = -cost - self.floating_weight * floating
        return log_likelihood

    def _floating_cost(
        self,
        turned: YawObservability,
        plane_view: View,
        poses: NDArray[np.float64],
        palette: NDArray[np.float64],
        variance: float,
    ) -> NDArray[np.float64]:
        telling = np.flatnonzero((turned.largest_distances > self.telling) & (turned.surface.points[:, 2] > 0.01))
        cost = np.zeros(len(poses))
        if len(telling) == 0:
            return cost
        asked = telling[evenly(len(telling), self.samples)]
        samples, normals = turned.surface.points[asked], turned.surface.normals[asked]
        c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]

        def turn(v: NDArray[np.float64]) -> NDArray[np.float64]:
            x, y = c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1]
            return np.stack([x, y, np.broadcast_to(v[:, 2], x.shape)], axis=2)

        placed = turn(samples)
        placed[..., :2] += poses[:, None, :2]
        towards = plane_view.viewpoint - placed
        facing = (towards * turn(normals)).sum(axis=2) > 0.15 * np.linalg.norm(towards, axis=2)
        pose_of, _ = np.nonzero(facing)
        pixels, depth = plane_view.project(placed[facing])
        near = float(np.nanmedian(depth)) if len(depth) else 1.0
        radius = max(1, round(self.position_error * plane_view.image.intrinsics.fx / max(near, 1e-3)))
        excess = seen_space(plane_view, pixels, radius, palette, self.color).excess(pixels, depth)
        np.add.at(cost, pose_of, np.minimum(excess**2 / (2 * variance), self.cap))
        return cost * (len(telling) / len(asked))


@dataclass(frozen=True, eq=False)
class YawProfile:
    """Likelihood over the yaw. ``yaws``: (K,) evenly spaced over the circle, radians in the plane's frame.
    ``positions``: (K, 2), metres, the best position at each; ``log_likelihood``: (K,), up to a constant.
    """

    yaws: NDArray[np.float64]
    positions: NDArray[np.float64]
    log_likelihood: NDArray[np.float64]

    @property
    def step(self) -> float:
        """Spacing of the yaws, radians."""
        return 2 * math.pi / len(self.yaws)

    def starts(self, margin: float, limit: int) -> list[NDArray[np.float64]]:
        """Return poses (3,) at the local maxima within ``margin`` of the best, best first, at most ``limit``."""
        value = self.log_likelihood
        local = (value >= np.roll(value, 1)) & (value > np.roll(value, -1)) & (value >= value.max() - margin)
        local[int(value.argmax())] = True
        best_first = sorted(np.flatnonzero(local).tolist(), key=lambda k: -value[k])
        return [np.array([*self.positions[k], self.yaws[k]]) for k in best_first[:limit]]

    def plausible_yaws(self, margin: float, best: float, best_std: float) -> YawSet:
        """Return the arcs of the yaws within ``margin`` of the best; the first contains the refined yaw ``best`` with
        its error.
        """
        count = len(self.yaws)
        taken = self.log_likelihood >= self.log_likelihood.max() - margin
        # A gap of one yaw is noise.
        taken |= np.roll(taken, 1) & np.roll(taken, -1)
        if taken.all():
            return YawSet(((best, math.pi),))
        # A run begins where a taken yaw follows one that is not.
        arcs = []
        for start in np.flatnonzero(taken & ~np.roll(taken, 1)):
            length = 1
            while taken[(start + length) % count]:
                length += 1
            half = length * self.step / 2
            arcs.append((wrap_angle(float(self.yaws[start]) + half - self.step / 2), half))
        arcs.sort(key=lambda arc: max(0.0, abs(wrap_angle(best - arc[0])) - arc[1]))
        return YawSet((_widened(arcs[0], best, self.step / 2 + best_std), *arcs[1:]))


def _widened(arc: tuple[float, float], angle: float, half: float) -> tuple[float, float]:
    """Return the arc, made to hold ``angle`` ± ``half``."""
    offset = wrap_angle(angle - arc[0])
    lower, upper = min(-arc[1], offset - half), max(arc[1], offset + half)
    return wrap_angle(arc[0] + (lower + upper) / 2), min(math.pi, (upper - lower) / 2)
