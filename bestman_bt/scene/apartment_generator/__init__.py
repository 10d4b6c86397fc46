"""Apartments made from options and chance: rooms, walls with doorways, and furniture that leaves a way everywhere."""

from bestman_bt.scene.apartment_generator.floor_plan import Doorway, Room
from bestman_bt.scene.apartment_generator.generate import Apartment, ApartmentError, generate_apartment
from bestman_bt.scene.apartment_generator.options import ApartmentOptions

__all__ = ["Apartment", "ApartmentError", "ApartmentOptions", "Doorway", "Room", "generate_apartment"]
