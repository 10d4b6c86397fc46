"""Things of which no model exists, seen from the head and, on the far side, from the wrist."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bestman_bt.messages import PointCloud, Pose
from bestman_bt.perception.grasp_pose.base import GraspTarget
from bestman_bt.perception.segmentation.base import Cluster, SegmentedScene
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class SecondViewParameters:
    """Metres, radians.

    ``distance``: of the camera from the thing, ``elevation``: of the line to it. ``near``: points of two views closer
    than this show one thing; ``share``: a cluster of the second view belongs to it if so many of its points do.
    """

    distance: float = 0.36
    elevation: float = math.radians(55.0)
    near: float = 0.008
    share: float = 0.3


def pointed_at(
    clusters: tuple[Cluster, ...], view: View, pixel: NDArray[np.float64], reach: float = 6.0
) -> Cluster | None:
    """The cluster that shows at ``pixel`` (u, v), or within ``reach`` pixels of it; None where there is none."""
    distances = [float(np.linalg.norm(view.project(cluster.points)[0] - pixel, axis=1).min()) for cluster in clusters]
    if not distances or min(distances) > reach:
        return None
    return clusters[int(np.argmin(distances))]


def opposite_view(cluster: Cluster, first: View, parameters: SecondViewParameters) -> Pose:
    """Where a second camera sees the side that the first one does not: frame_from_camera."""
    middle = cluster.bounding_box.pose.position
    away = middle[:2] - first.viewpoint[:2]
    away /= np.linalg.norm(away)
    level, rise = math.cos(parameters.elevation), math.sin(parameters.elevation)
    eye = middle + parameters.distance * np.array([level * away[0], level * away[1], rise])
    forward = (middle - eye) / parameters.distance
    # Image up is towards the first camera's side, so that the hand stays behind the camera as seen from there.
    right = np.cross(forward, np.array([0.0, 0.0, 1.0]))
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    matrix[:3, 3] = eye
    return Pose.from_matrix(matrix)


def fused_target(
    cluster: Cluster,
    first: tuple[View, SegmentedScene],
    second: tuple[View, SegmentedScene] | None,
    parameters: SecondViewParameters,
) -> GraspTarget:
    """``cluster`` of the first view with what the second one shows of it; all other clusters are its surroundings."""
    others = [other.points for other in first[1].clusters if other is not cluster]
    parts, colors, eyes = [cluster.points], [cluster.colors], [first[0].viewpoint]
    if second is not None:
        eyes.append(second[0].viewpoint)
        tree, around = cKDTree(cluster.points), cKDTree(np.concatenate([np.full((1, 3), 1e3), *others]))
        for other in second[1].clusters:
            mine = tree.query(other.points)[0]
            if (mine < parameters.near).mean() >= parameters.share and mine.mean() < around.query(other.points)[
                0
            ].mean():
                parts.append(other.points)
                colors.append(other.colors)
            else:
                others.append(other.points)
    whole = replace(cluster, points=np.concatenate(parts), colors=np.concatenate(colors))
    cloud = PointCloud(whole.points, whole.colors)
    surroundings = np.concatenate([np.zeros((0, 3)), *others])
    return replace(GraspTarget.of_cluster(whole), cloud=cloud, viewpoints=np.array(eyes), surroundings=surroundings)
