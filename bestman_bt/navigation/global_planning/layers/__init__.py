"""Layers of costmaps."""

from bestman_bt.navigation.global_planning.layers.base import CostmapLayer
from bestman_bt.navigation.global_planning.layers.cell_layer import CellLayer
from bestman_bt.navigation.global_planning.layers.furniture_layer import FurnitureLayer
from bestman_bt.navigation.global_planning.layers.shape_layer import ShapeLayer
from bestman_bt.navigation.global_planning.layers.static_layer import StaticLayer

__all__ = ["CellLayer", "CostmapLayer", "FurnitureLayer", "ShapeLayer", "StaticLayer"]
