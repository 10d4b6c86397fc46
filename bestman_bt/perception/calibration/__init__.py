"""Calibration of lenses, depth and camera poses from views of a board."""
