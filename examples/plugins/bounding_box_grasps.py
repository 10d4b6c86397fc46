"""Grasps from above across the sides of the bounding box: for things without a model and with few points.

Chosen by ``algorithms: {unknown_grasp_pose: {algorithm: "examples/plugins/bounding_box_grasps.py:BoundingBox"}}``;
``docs/perception.md`` has its figures.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from bestman_bt.messages import Box, Pose
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspPlanner, GraspTarget
from bestman_bt.perception.grasp_pose.hand_shape import HandPlacement, HandShape, HandSize
from bestman_bt.perception.grasp_pose.ranking import clear_candidates, surroundings_of
from bestman_bt.robot_model.model import GripperModel


@dataclass(frozen=True)
class BoundingBox(GraspPlanner):
    """Closes across the smaller side of the target's box first, both ways round.

    ``longer_side``: also across the longer side where that fits. ``quality``: of the best grasp, 0 to 1.

    ``surroundings_clearance``: metres between open hand and ``GraspTarget.surroundings``, at least. ``beside``: places
    tried to both sides of the middle, as shares of half the free length, for where something stands in the way there.
    """

    longer_side: bool = True
    quality: float = 0.6
    surroundings_clearance: Annotated[float, "m"] = 0.004
    beside: float = 0.5
    hand: HandPlacement = field(default_factory=HandPlacement)
    shape: HandSize = field(default_factory=HandSize)

    def plan(self, target: GraspTarget, gripper: GripperModel, support_height: float) -> tuple[GraspCandidate, ...]:
        """See GraspPlanner."""
        shape, pose = target.box.shape, target.box.pose
        if not isinstance(shape, Box):
            raise PerceptionError(f"GraspTarget box should be a Box but is {type(shape).__name__}")
        if not np.all(np.isfinite(shape.size)) or min(shape.size) <= 0.0:
            raise PerceptionError(f"GraspTarget box should have a finite size above 0 but has {shape.size}")
        hand = HandShape(gripper, self.shape)
        others = surroundings_of(target, support_height, hand.reach + max(shape.size))
        for shares in ((0.0,), (-self.beside, self.beside)):
            candidates = self._across(shape, pose, shares, gripper, support_height)
            clear = clear_candidates(candidates, hand, others, support_height, self.surroundings_clearance)
            if clear:
                return tuple(clear)
        return ()

    def _across(
        self, box: Box, pose: Pose, shares: tuple[float, ...], gripper: GripperModel, support_height: float
    ) -> list[GraspCandidate]:
        """Grasps at the middle, and at ``shares`` of the way from there to where the pads would stand over."""
        hand = self.hand
        axes = pose.rotation.T
        upwards = np.abs(axes[:, 2]) * box.size
        top = float(pose.position[2] + upwards.sum() / 2)
        height = hand.top_height(top, support_height, gripper)
        if height is None:
            return []
        vertical = int(np.argmax(np.abs(axes[:, 2])))
        level = sorted((axis for axis in range(3) if axis != vertical), key=lambda axis: box.size[axis])
        candidates = []
        for rank, axis in enumerate(level if self.longer_side else level[:1]):
            width = box.size[axis]
            if not hand.fits(width, gripper):
                continue
            yaw = math.atan2(axes[axis, 1], axes[axis, 0])
            free = max(0.0, (box.size[level[1 - rank]] - gripper.part.pad_size[0]) / 2)
            for share, turn in itertools.product(shares, (0.0, math.pi)):
                closing = np.array([math.cos(yaw + turn), math.sin(yaw + turn), 0.0])
                along = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
                position = np.array([*pose.position[:2], height]) + share * free * along
                quality = self.quality * (1.0 - 0.3 * rank) * (1.0 - 0.4 * abs(share))
                down = np.array([0.0, 0.0, -1.0])
                candidates.append(hand.candidate(position, down, closing, width, quality, "top", gripper))
        return candidates
