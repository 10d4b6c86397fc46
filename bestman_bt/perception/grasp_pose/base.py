"""Grasp planning for parallel grippers."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, Handle, ObjectModel, PlacedShape, PointCloud, Pose
from bestman_bt.perception.segmentation.base import Cluster
from bestman_bt.robot_model.model import GripperModel


@dataclass(frozen=True, eq=False)
class GraspTarget:
    """The object to grasp: a box around it and optional further knowledge, all in one frame with z up.

    ``model`` and ``frame_from_object``: both or neither. ``cloud``: measured points of the object. ``viewpoints``: (V,
    3) positions of the cameras that measured them. ``surroundings``: (N, 3) points of everything else nearby except the
    support surface, which is given by its height: the hand must not touch these. ``handle``: set if the target is a
    door or drawer.
    """

    box: PlacedShape
    model: ObjectModel | None = None
    frame_from_object: Pose | None = None
    cloud: PointCloud | None = None
    viewpoints: NDArray[np.float64] | None = None
    surroundings: NDArray[np.float64] | None = None
    handle: Handle | None = None

    @classmethod
    def of_model(cls, model: ObjectModel, frame_from_object: Pose) -> GraspTarget:
        """Return a known object at an estimated pose."""
        lower, upper = model.bounds()
        x, y, z = (float(extent) for extent in upper - lower)
        box = PlacedShape(Box((x, y, z)), frame_from_object @ Pose((lower + upper) / 2))
        return cls(box, model, frame_from_object)

    @classmethod
    def of_cluster(cls, cluster: Cluster) -> GraspTarget:
        """Return an unknown object: its measured bounding box and points."""
        return cls(cluster.bounding_box, cloud=PointCloud(cluster.points, cluster.colors))


@dataclass(frozen=True, eq=False)
class GraspCandidate:
    """One way to grasp the object; poses are frame_from_tool (z points out of the hand, y is the closing direction).

    ``pre_grasp``: on the approach line, in front of the object. ``lift``: above the grasp. ``width``: metres between
    the fingers at contact. ``opening``: finger opening before the approach, metres. ``quality``: 0 to 1. ``approach``:
    ``top``, ``side`` or ``handle``; for a handle, ``lift`` is its pose after opening by 5 cm. ``clearance``: metres
    between the open hand at the grasp and the nearest known obstacle.
    """

    grasp: Pose
    pre_grasp: Pose
    lift: Pose
    width: float
    opening: float
    quality: float
    approach: str
    clearance: float = math.inf


class GraspPlanner(ABC):
    """Proposes grasps; the caller checks reachability and collisions with other objects."""

    @abstractmethod
    def plan(self, target: GraspTarget, gripper: GripperModel, support_height: float) -> tuple[GraspCandidate, ...]:
        """Return all suitable grasps, best first; empty if the gripper cannot grasp the object.

        ``support_height``: z of the surface under the object, metres, in the frame of the target.
        """
