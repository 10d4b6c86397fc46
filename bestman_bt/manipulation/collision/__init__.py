"""Collision worlds, built from the world model; they never touch a simulator."""

from bestman_bt.manipulation.collision.base import CollisionModel, CollisionWorld
from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel, CoalCollisionWorld
from bestman_bt.manipulation.collision.planning_scene import (
    AttachedObject,
    PlanningScene,
    SceneObstacle,
    VoxelObstacle,
)
from bestman_bt.manipulation.collision.scene_from_world_model import (
    SceneMargins,
    finger_contacts,
    hand_links,
    held_object,
    planning_scene_from_world_model,
)
from bestman_bt.manipulation.collision.swept_way import SweptWay

__all__ = [
    "AttachedObject",
    "CoalCollisionModel",
    "CoalCollisionWorld",
    "CollisionModel",
    "CollisionWorld",
    "PlanningScene",
    "SceneMargins",
    "SceneObstacle",
    "SweptWay",
    "VoxelObstacle",
    "finger_contacts",
    "hand_links",
    "held_object",
    "planning_scene_from_world_model",
]
