"""Footprints: what clusters cover seen from above, and how far two of them overlap."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray


def footprint(xy: NDArray[np.float64], grow: float = 0.0) -> NDArray[np.float32]:
    """Convex hull of points (N, 2), grown by ``grow``, all in metres: (K, 1, 2) millimetres.

    OpenCV takes areas below 1e-6 for nothing, hence the millimetres.
    """
    if grow > 0.0:
        angles = np.arange(8) * math.pi / 4
        ring = grow * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        # The hull of the grown points is that of the grown hull, and the hull has few points.
        hull = np.asarray(cv2.convexHull((1000.0 * xy).astype(np.float32)), dtype=np.float64)[:, 0]
        xy = ((hull / 1000.0)[:, None, :] + ring).reshape(-1, 2)
    return np.asarray(cv2.convexHull((1000.0 * xy).astype(np.float32)), dtype=np.float32)


def overlaps(footprints: Sequence[NDArray[np.float32]]) -> NDArray[np.float64]:
    """(n, n) area that two footprints share, as a share of the smaller one; 1 on the diagonal."""
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
