"""Whether the rig gets to a grasp: within the gantry's travel, and clear of the table and of other things."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from benchmarks.grasp_rig import GraspRig, rig_model, wrist_positions
from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.planning_scene import PlanningScene, SceneObstacle
from bestman_bt.messages import PlacedShape, Pose
from bestman_bt.robot_model.model import ArmModel

APPROACH = (0.0, 0.05, 0.10)
"""Metres before the grasp at which the hand is checked, the last where the straight approach begins."""


class HandReach:
    """Answers ``GraspRanking``: 1 where hand and wrist camera find room at a grasp and on the way to it, else 0.

    ``table``: what was measured of it; ``things``: boxes around all else that was seen. Fingers may be near other
    things: how near, the grasp planner has decided on their points.
    """

    def __init__(self, rig: GraspRig, table: PlacedShape, things: Sequence[PlacedShape]) -> None:
        model = _collision_model()
        fingers = rig.gripper.part.finger_links
        opened = dict.fromkeys(rig.gripper.part.joints, rig.gripper.max_width / len(rig.gripper.part.joints))
        obstacles = [
            SceneObstacle("table", (table,)),
            *(SceneObstacle(f"thing {i}", (s,)) for i, s in enumerate(things)),
        ]
        allowed = {frozenset((finger, obstacle.name)) for finger in fingers for obstacle in obstacles[1:]}
        scene = PlanningScene(opened, tuple(obstacles), allowed_pairs=frozenset(allowed), padding=0.003)
        self._world = model.world(scene)
        self._limits = rig.model.of(ArmModel)["arm"]

    def __call__(self, grasp: Pose) -> float:
        """``grasp``: map_from_tool."""
        for back in APPROACH:
            positions = wrist_positions(grasp @ Pose(np.array([0.0, 0.0, -back])), self._limits)
            if positions is None or not self._world.is_free(positions):
                return 0.0
        return 1.0


@cache
def _collision_model() -> CoalCollisionModel:
    return CoalCollisionModel(rig_model(Pose(np.array([-0.2, 0.0, 1.65]))))
