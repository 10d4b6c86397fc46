"""Surface normals of a depth image: a plane through each pixel's window, all windows at once.

Sums over windows by box filters, as in Holzer et al., "Adaptive Neighborhood Selection for Real-Time Surface Normal
Estimation from Organized Point Cloud Data Using Integral Images", 2012; fitted to the inverse depth, in which a plane
seen at any slant is affine: 1 / z = n · (x, y, 1) / d.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics
from bestman_bt.perception.view import known_depth


def plane_normals(
    depth: NDArray[np.float32], intrinsics: CameraIntrinsics, window: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Unit normals (H, W, 3) towards the camera, in the optical frame, and residuals (H, W): rms in metres of depth.

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
