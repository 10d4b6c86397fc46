"""Furniture made from options and chance: shelves, chests, fridges and the like, with doors, drawers and handles."""
