"""What stands out of a front, and what lies behind it, pixel by pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.affordance.fronts import Front, FrontSearch
from bestman_bt.perception.view import View


@dataclass(frozen=True, eq=False)
class Relief:
    """The rectangle of pixels around a front, in the front's frame.

    ``rows``, ``columns``: of the rectangle in the image. ``height``: (h, w) metres in front of the front, NaN where the
    depth is unknown. ``noise``: (h, w) metres, its standard deviation. ``near``: (h, w), the front or close to it.
    ``rays``: (h, w, 3), the directions of the pixels' rays; ``eye``: (3,) where they start.
    """

    front: Front
    rows: slice
    columns: slice
    height: NDArray[np.float64]
    noise: NDArray[np.float64]
    near: NDArray[np.bool_]
    rays: NDArray[np.float64]
    eye: NDArray[np.float64]

    def on_level(self, pixels: tuple[NDArray[np.intp], NDArray[np.intp]], level: float) -> NDArray[np.float64]:
        """Where the rays of pixels (rows, columns of the rectangle) meet the plane ``level`` metres before the front.

        (N, 2) metres, x and y: free of the depth's noise, which sways along the ray.
        """
        rays = self.rays[pixels]
        met: NDArray[np.float64] = self.eye[:2] + rays[:, :2] * ((level - self.eye[2]) / rays[:, 2])[:, None]
        return met

    def window(self, low: NDArray[np.float64], high: NDArray[np.float64], level: float) -> tuple[slice, slice]:
        """The rectangle of pixels (rows, columns of this rectangle) that shows x, y from ``low`` to ``high`` there."""
        corners = np.array([[x, y, level] for x in (low[0], high[0]) for y in (low[1], high[1])]) - self.eye
        # rays[v, u] = rays[0, 0] + u right + v down, and a corner is a multiple of its pixel's ray.
        first = self.rays[0, 0]
        right, down = self.rays[0, 1] - first, self.rays[1, 0] - first
        u, v, scale = np.linalg.solve(np.stack([right, down, first], axis=1), corners.T)
        height, width = self.height.shape
        u, v = u / scale, v / scale
        rows = slice(int(np.clip(math.floor(v.min()), 0, height)), int(np.clip(math.ceil(v.max()) + 1, 0, height)))
        columns = slice(int(np.clip(math.floor(u.min()), 0, width)), int(np.clip(math.ceil(u.max()) + 1, 0, width)))
        return rows, columns

    def pixel_size(self) -> float:
        """Metres of the front that one pixel shows, about."""
        return float(np.linalg.norm(self.eye) * np.linalg.norm(self.rays[0, 1] - self.rays[0, 0]))


def relief(view: View, front: Front, search: FrontSearch, margin: float = 0.08) -> Relief:
    """The relief of ``front``, with ``margin`` metres around it."""
    k = view.image.intrinsics
    grow = max(
        2, round(margin * k.fx / max(0.3, float(np.linalg.norm(front.frame_from_front.position - view.viewpoint))))
    )
    v, u = np.nonzero(front.region)
    rows = slice(max(0, int(v.min()) - grow), min(k.height, int(v.max()) + grow + 1))
    columns = slice(max(0, int(u.min()) - grow), min(k.width, int(u.max()) + grow + 1))
    front_from_camera = front.frame_from_front.inverse() @ view.frame_from_camera
    rotation, eye = front_from_camera.rotation, front_from_camera.position
    x = (np.arange(columns.start, columns.stop) - k.cx) / k.fx
    y = (np.arange(rows.start, rows.stop) - k.cy) / k.fy
    rays = x[None, :, None] * rotation[:, 0] + y[:, None, None] * rotation[:, 1] + rotation[:, 2]
    depth = view.image.depth[rows, columns].astype(np.float64)
    known = np.isfinite(depth) & (depth > 0)
    height = np.where(known, rays[..., 2] * depth + eye[2], np.nan)
    noise = search.noise(np.where(known, depth, 0.4)) + 0.0005
    near = cv2.dilate(front.region[rows, columns].astype(np.uint8), np.ones((2 * grow + 1, 2 * grow + 1), np.uint8)) > 0
    return Relief(front, rows, columns, height, noise, near, rays, eye)
