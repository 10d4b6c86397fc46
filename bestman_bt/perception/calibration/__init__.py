"""Calibration: lenses, depth, and where cameras sit, from views of a board."""
