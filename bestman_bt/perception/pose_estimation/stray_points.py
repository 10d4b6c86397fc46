"""Thin parts of an object that its segmentation left out: the handle of a mug, of which a camera sees shreds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from bestman_bt.perception.pose_estimation.model_colors import color_distances
from bestman_bt.perception.segmentation.voxels import voxel_means
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class StrayPoints:
    """Finds points near a cluster that belong to the object.

    Lengths in metres.

    ``reach``: how far from the cluster's box strays are sought; ``link``: how far one is from the next, or from the
    cluster, at most. ``color``: distance of chromaticities to the nearest colour of the model, at most. ``voxel``: one
    point each. ``min_height``: above the plane.
    """

    reach: Annotated[float, "m"] = 0.07
    link: Annotated[float, "m"] = 0.015
    color: float = 0.10
    voxel: Annotated[float, "m"] = 0.004
    min_height: Annotated[float, "m"] = 0.010

    def added_to(
        self, points: NDArray[np.float64], plane_view: View, palette: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """``points`` (N, 3) of a cluster, and points near it that have the model's colours and are linked to it.

        All in the plane's frame. ``palette``: (K, 3), the model's colours.
        """
        grow = np.array([self.reach, self.reach, self.link])
        lower, upper = points.min(axis=0) - grow, points.max(axis=0) + grow
        lower[2] = self.min_height
        corners = np.array(
            [[x, y, z] for x in (lower[0], upper[0]) for y in (lower[1], upper[1]) for z in (0.0, upper[2])]
        )
        cloud = plane_view.cloud(corners)
        cloud = cloud.selected(((cloud.points > lower) & (cloud.points < upper)).all(axis=1))
        assert cloud.colors is not None
        cloud = cloud.selected(color_distances(cloud.colors, palette) < self.color)
        known = cKDTree(points)
        if len(cloud):
            cloud = voxel_means(cloud.selected(known.query(cloud.points)[0] > self.voxel), self.voxel)
        if len(cloud) == 0:
            return points
        pairs = cKDTree(cloud.points).query_pairs(self.link, output_type="ndarray")
        count = len(cloud)
        _, group = connected_components(
            coo_matrix((np.ones(len(pairs)), pairs.T), shape=(count, count)), directed=False
        )
        linked = np.isin(group, group[known.query(cloud.points)[0] <= self.link])
        return np.concatenate([points, cloud.points[linked]])
