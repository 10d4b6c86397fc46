"""How an object stands on a surface, and how much room it has there."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import ObjectModel, Pose, Pose2D
from bestman_bt.scene.plane_geometry import distance_to_polygon, rectangle
from bestman_bt.scene.scene import PlacedFurniture, PlacedObject


def planar_radius(model: ObjectModel) -> float:
    """Radius of the circle about the object's frame that holds its collision shapes, seen from above, metres."""
    if model.symmetry_order == 0:
        return float(model.size[:2].max()) / 2
    return math.hypot(*model.size[:2]) / 2


def standing_on(map_from_surface: Pose, on_surface: Pose2D, model: ObjectModel) -> Pose:
    """The pose in the map frame of an object that stands on a surface, at ``on_surface`` in the surface's frame."""
    lower = float(model.bounds()[0, 2])
    return map_from_surface @ on_surface.to_pose(-lower)


def gap_to_objects(pose: Pose, model: ObjectModel, others: Iterable[PlacedObject]) -> float:
    """Smallest distance from one object's circle to those of others at its height; infinite without others."""
    here: NDArray[np.float64] = pose.position[:2]
    gaps = [
        float(np.linalg.norm(other.pose.position[:2] - here)) - planar_radius(model) - planar_radius(other.model)
        for other in others
        if abs(pose.position[2] - other.pose.position[2]) < (model.size[2] + other.model.size[2]) / 2
    ]
    return min(gaps, default=math.inf)


def gap_to_furniture(
    pose: Pose, model: ObjectModel, piece: PlacedFurniture, furniture: Iterable[PlacedFurniture]
) -> float:
    """Smallest distance from an object's circle to furniture that stands on ``piece``; infinite without such."""
    distances = [
        distance_to_polygon(rectangle(other.actual, other.model.footprint), pose.position[:2])
        for other in furniture
        if other.on == piece.name
    ]
    return min(distances, default=math.inf) - planar_radius(model)
