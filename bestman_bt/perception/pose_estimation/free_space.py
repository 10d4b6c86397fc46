"""Does a part of a placed model float where the image shows that nothing is?

A sample floats where everything measured around its pixel is farther away. Cameras do not measure the edges of things:
where some of it is unknown, the colours decide: nothing of the model is where nothing has its colours.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics
from bestman_bt.perception.pose_estimation.model_colors import color_distances
from bestman_bt.perception.view import View


@dataclass(frozen=True, eq=False)
class SeenSpace:
    """A rectangle of the image: at each pixel the smallest depth measured around it, metres.

    ``nearest``: (h, w), infinite where nothing was measured. ``doubtful``: (h, w), something around it was not measured
    and it has a colour of the model. ``corner``: (u, v) of the first pixel.
    """

    nearest: NDArray[np.float64]
    doubtful: NDArray[np.bool_]
    corner: NDArray[np.intp]

    def excess(self, pixels: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far (N,), metres, samples at ``pixels`` (N, 2) and ``depth`` (N,) hover in front of what was measured.

        0 where they do not, and where that is not known.
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
    """What was measured around ``pixels`` (N, 2), within ``radius`` pixels of each.

    ``palette``: (K, 3) rgb of the model, 0 to 1; ``color``: distance of chromaticities up to which one is the model's.
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
