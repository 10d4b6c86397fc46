"""Scenes from YAML and the worlds that a seed draws from them."""

from bestman_bt.scene.draw import SceneError, draw_world
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.moving_door import MovingDoor
from bestman_bt.scene.object_file import read_object
from bestman_bt.scene.placing import planar_radius
from bestman_bt.scene.scene import (
    LATCH_TRAVEL,
    Articulation,
    FurnitureModel,
    PlacedFurniture,
    PlacedObject,
    Surface,
    Wall,
    World,
    wall_box,
)
from bestman_bt.scene.scene_config import SceneConfig
from bestman_bt.scene.walker import Walker

__all__ = [
    "LATCH_TRAVEL",
    "Articulation",
    "FurnitureModel",
    "MovingDoor",
    "PlacedFurniture",
    "PlacedObject",
    "SceneConfig",
    "SceneError",
    "Surface",
    "Walker",
    "Wall",
    "World",
    "draw_world",
    "load_scene",
    "planar_radius",
    "read_furniture",
    "read_object",
    "semantic_map",
    "wall_box",
]
