"""Grasp poses: where a parallel gripper can take an object."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose
from bestman_bt.perception.segmentation.base import Cluster
from bestman_bt.robot_model import GripperModel


@dataclass(frozen=True, eq=False)
class GraspTarget:
    """What is to be grasped: a box around it, and the model where it is known.

    ``box``: in the frame of the support surface's height, z up. ``model`` and ``frame_from_object``: both or neither.
    """

    box: PlacedShape
    model: ObjectModel | None = None
    frame_from_object: Pose | None = None

    @classmethod
    def of_model(cls, model: ObjectModel, frame_from_object: Pose) -> GraspTarget:
        """A known object at an estimated pose."""
        lower, upper = model.bounds()
        x, y, z = (float(extent) for extent in upper - lower)
        box = PlacedShape(Box((x, y, z)), frame_from_object @ Pose((lower + upper) / 2))
        return cls(box, model, frame_from_object)

    @classmethod
    def of_cluster(cls, cluster: Cluster) -> GraspTarget:
        """An unknown object: its measured bounding box."""
        return cls(cluster.bounding_box)


@dataclass(frozen=True, eq=False)
class GraspCandidate:
    """One way to take the object; poses are frame_from_tool (z leaves the hand, y closes).

    ``pre_grasp``: on the approach line, before the object. ``lift``: above the grasp. ``width``: metres between the
    fingers where they touch. ``opening``: metres to open to before the approach. ``quality``: 0 to 1.
    ``approach``: ``top`` or ``side``.
    """

    grasp: Pose
    pre_grasp: Pose
    lift: Pose
    width: float
    opening: float
    quality: float
    approach: str


class GraspPlanner(ABC):
    """Proposes grasps; reachability and collisions with other things are for the caller to check."""

    @abstractmethod
    def plan(self, target: GraspTarget, gripper: GripperModel, support_height: float) -> tuple[GraspCandidate, ...]:
        """All sensible candidates, best first; empty where the gripper cannot take the object.

        ``support_height``: z of the surface under the object, metres, in the frame of the target.
        """
