"""Grasps from above across the sides of the bounding box: for things without a model."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from bestman_bt.messages import Box
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspPlanner, GraspTarget
from bestman_bt.perception.grasp_pose.hand_placement import HandPlacementParameters
from bestman_bt.robot_model import GripperModel


@dataclass(frozen=True)
class BoundingBoxParameters:
    """``longer_side``: also across the longer side where that fits. ``quality``: of the best grasp, 0 to 1."""

    longer_side: bool = True
    quality: float = 0.6
    hand: HandPlacementParameters = field(default_factory=HandPlacementParameters)


class BoundingBox(GraspPlanner):
    """Closes across the smaller side of the target's box first, both ways round."""

    def __init__(self, parameters: BoundingBoxParameters | None = None) -> None:
        self.parameters = parameters or BoundingBoxParameters()

    def plan(self, target: GraspTarget, gripper: GripperModel, support_height: float) -> tuple[GraspCandidate, ...]:
        """See GraspPlanner."""
        shape, pose = target.box.shape, target.box.pose
        if not isinstance(shape, Box):
            raise PerceptionError(f"GraspTarget box should be a Box but is {type(shape).__name__}")
        hand = self.parameters.hand
        axes = pose.rotation.T
        upwards = np.abs(axes[:, 2]) * shape.size
        top = float(pose.position[2] + upwards.sum() / 2)
        height = hand.top_height(top, support_height, gripper)
        if height is None:
            return ()
        vertical = int(np.argmax(np.abs(axes[:, 2])))
        level = sorted((axis for axis in range(3) if axis != vertical), key=lambda axis: shape.size[axis])
        candidates = []
        for rank, axis in enumerate(level if self.parameters.longer_side else level[:1]):
            width = shape.size[axis]
            if not hand.fits(width, gripper):
                continue
            yaw = math.atan2(axes[axis, 1], axes[axis, 0])
            for turn in (0.0, math.pi):
                closing = np.array([math.cos(yaw + turn), math.sin(yaw + turn), 0.0])
                position = np.array([pose.position[0], pose.position[1], height])
                quality = self.parameters.quality * (1.0 - 0.3 * rank)
                down = np.array([0.0, 0.0, -1.0])
                candidates.append(hand.candidate(position, down, closing, width, quality, "top", gripper))
        return tuple(candidates)
