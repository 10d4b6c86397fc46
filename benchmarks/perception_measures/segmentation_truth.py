"""Clusters held against the pixels that truly show each thing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bestman_bt.perception.segmentation.base import Cluster
from bestman_bt.perception.view import View

NEAR = 0.006
"""Metres: a measured point counts as in a cluster if the cluster has a point (they are 4 mm apart) this near."""
MIN_SHARE, MAX_FOREIGN = 0.80, 0.10
MIN_PIXELS = 150
"""A thing of which fewer measured pixels are in view is not asked for."""


def judged(clusters: Sequence[Cluster], masks: Mapping[str, NDArray[np.bool_]], view: View) -> dict[str, str]:
    """For each thing in view what is wrong with its cluster, empty where nothing is.

    Right: one cluster holds 80 % of the thing's measured points, less than 10 % of its own points lie elsewhere, and
    no second cluster is mostly of the thing.
    """
    labels = np.full(view.image.depth.shape, -1)
    for index, mask in enumerate(masks.values()):
        labels[mask] = index
    owners = [_owners(cluster, labels, view, len(masks)) for cluster in clusters]
    verdicts = {}
    for index, (name, mask) in enumerate(masks.items()):
        points = _measured(view, mask)
        if len(points) < MIN_PIXELS:
            continue
        mine = [row for row, shares in enumerate(owners) if shares[index] > 0.5]
        if not mine:
            verdicts[name] = "missed or merged"
            continue
        held = [float((cKDTree(clusters[row].points).query(points)[0] < NEAR).mean()) for row in mine]
        best = int(np.argmax(held))
        if held[best] < MIN_SHARE:
            verdicts[name] = "split" if len(mine) > 1 else f"only {held[best]:.0%} of its points"
        elif len(mine) > 1:
            verdicts[name] = "split"
        elif owners[mine[best]][index] <= 1.0 - MAX_FOREIGN:
            verdicts[name] = "foreign points"
        else:
            verdicts[name] = ""
    return verdicts


def _measured(view: View, mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    points, depth, _ = view.organised()
    return points[mask & np.greater(depth, 0.0)]


def _owners(cluster: Cluster, labels: NDArray[np.intp], view: View, count: int) -> NDArray[np.float64]:
    """Shares (count,) of the cluster's points that lie on each thing, to a pixel."""
    pixels, _ = view.project(cluster.points)
    near = np.rint(pixels).astype(np.intp)
    height, width = labels.shape
    hit = np.zeros((len(near), count), dtype=bool)
    for du in (-1, 0, 1):
        for dv in (-1, 0, 1):
            found = labels[np.clip(near[:, 1] + dv, 0, height - 1), np.clip(near[:, 0] + du, 0, width - 1)]
            hit[np.arange(len(near))[found >= 0], found[found >= 0]] = True
    shares: NDArray[np.float64] = hit.mean(axis=0)
    return shares
