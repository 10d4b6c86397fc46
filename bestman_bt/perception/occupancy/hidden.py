"""Which part of a surface no view has shown: hidden by the robot's arm, by furniture, by things, or out of view."""

from __future__ import annotations

import cv2
import numpy as np

from bestman_bt.messages import VOXEL_UNKNOWN, Pose, VoxelGrid

BELOW = 0.03
"""Metres below a surface from where on a column counts as seen: the map is off by as much."""
ABOVE = 0.06
"""Metres above a surface up to which a column counts as seen where something was measured or seen through there."""
HIDDEN = 0.5
"""Share of an object's footprint that has to be seen for the object to be noticed."""


def hidden_share(grid: VoxelGrid, frame_from_surface: Pose, size: tuple[float, float], width: float) -> float:
    """Share of a surface on which an object may stand that no view has shown, 0 to 1.

    ``grid``: what the views have shown, in the frame. ``size``: of the surface along its x and y, with the middle at
    its origin, metres. ``width``: the smaller side of the object, metres: it is noticed where the views have shown
    half of the square that it covers. Where the grid does not reach, nothing was seen.
    """
    step = grid.resolution
    counts = [max(1, round(extent / step)) for extent in size]
    x, y = ((np.arange(count) + 0.5) * extent / count - extent / 2 for count, extent in zip(counts, size, strict=True))
    z = np.arange(-BELOW, ABOVE + step / 2, step / 2)
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    states = grid.state_at(frame_from_surface.apply(points.reshape(-1, 3))).reshape(points.shape[:-1])
    unseen = (states == VOXEL_UNKNOWN).all(axis=2)
    across = min(max(1, round(width / step)), *counts)
    share = cv2.boxFilter(unseen.astype(np.float64), -1, (across, across), borderType=cv2.BORDER_REPLICATE)
    margin = across // 2
    inner = share[margin : counts[0] - margin, margin : counts[1] - margin]
    return float((inner > HIDDEN).mean()) if inner.size else float((share > HIDDEN).mean())
