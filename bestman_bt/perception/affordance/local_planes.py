"""A plane through the neighbourhood of every few pixels of a depth image.

The inverse depth of a plane is linear in the pixel coordinates, so least squares over a window needs only sums over
windows: Holzer et al., "Adaptive Neighborhood Selection for Real-Time Surface Normal Estimation from Organized Point
Cloud Data Using Integral Images", IROS 2012; there for depth changes, here for the inverse depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics


@dataclass(frozen=True, eq=False)
class LocalPlanes:
    """One plane per grid point, in the optical frame; rows and columns of the grid lie ``stride`` pixels apart.

    ``points``: (R, C, 3) metres, where the plane meets the ray of the grid point. ``normals``: (R, C, 3) unit,
    towards the camera. ``residuals``: (R, C) metres, root mean square of the depths' distances from the plane along
    the optical axis. ``valid``: (R, C), False where too little depth was known.
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

    A window counts where at least the share ``min_known`` of its pixels has depth.
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
