"""Apartments made from options and chance: rooms, walls with doorways, and furniture that leaves a way everywhere."""
