"""Scenes from YAML and the worlds that a seed draws from them."""

from bestman_bt.scene.scene import (
    FurnitureModel,
    PlacedFurniture,
    PlacedObject,
    Surface,
    Wall,
    World,
    wall_box,
)

__all__ = [
    "FurnitureModel",
    "PlacedFurniture",
    "PlacedObject",
    "Surface",
    "Wall",
    "World",
    "wall_box",
]
