"""Furniture made from options and chance: shelves, chests, fridges and the like, with doors, drawers and handles."""

from bestman_bt.scene.furniture_generator.cupboard import CupboardOptions
from bestman_bt.scene.furniture_generator.dishwasher import DishwasherOptions
from bestman_bt.scene.furniture_generator.drawer_chest import DrawerChestOptions
from bestman_bt.scene.furniture_generator.fridge import FridgeOptions
from bestman_bt.scene.furniture_generator.generate import FURNITURE_KINDS, generate_furniture, options_of
from bestman_bt.scene.furniture_generator.handle_design import HandleOptions
from bestman_bt.scene.furniture_generator.microwave import MicrowaveOptions
from bestman_bt.scene.furniture_generator.option_error import FurnitureOptionError
from bestman_bt.scene.furniture_generator.panel import FinishOptions
from bestman_bt.scene.furniture_generator.room_door import RoomDoorOptions
from bestman_bt.scene.furniture_generator.shelf import ShelfOptions

__all__ = [
    "FURNITURE_KINDS",
    "CupboardOptions",
    "DishwasherOptions",
    "DrawerChestOptions",
    "FinishOptions",
    "FridgeOptions",
    "FurnitureOptionError",
    "HandleOptions",
    "MicrowaveOptions",
    "RoomDoorOptions",
    "ShelfOptions",
    "generate_furniture",
    "options_of",
]
