"""Thinning of clouds: one point per occupied voxel."""

from __future__ import annotations

import numpy as np

from bestman_bt.messages import PointCloud


def voxel_means(cloud: PointCloud, edge: float) -> PointCloud:
    """The mean of position and colour in each cube of ``edge`` metres; ``cloud`` has colours."""
    if len(cloud) == 0:
        return cloud
    cells = np.floor((cloud.points - cloud.points.min(axis=0)) / edge).astype(np.int64)
    extent = cells.max(axis=0) + 1
    _, voxel_of, counts = np.unique(
        (cells[:, 0] * extent[1] + cells[:, 1]) * extent[2] + cells[:, 2], return_inverse=True, return_counts=True
    )
    assert cloud.colors is not None
    values = [*cloud.points.T, *cloud.colors.T.astype(np.float64)]
    means = np.stack([np.bincount(voxel_of, value) / counts for value in values], axis=1)
    return PointCloud(means[:, :3], np.rint(means[:, 3:]).astype(np.uint8))
