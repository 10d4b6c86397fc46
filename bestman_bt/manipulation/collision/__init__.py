"""Collision worlds, built from the world model; they never touch a simulator."""

from bestman_bt.manipulation.collision.base import CollisionModel, CollisionWorld
from bestman_bt.manipulation.collision.planning_scene import AttachedObject, PlanningScene, SceneObstacle

__all__ = ["AttachedObject", "CollisionModel", "CollisionWorld", "PlanningScene", "SceneObstacle"]
