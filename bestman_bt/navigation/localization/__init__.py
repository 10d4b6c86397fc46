"""Localization: the base's pose on the map."""
