"""Calibration of a robot's cameras: recorded or simulated datasets, and results for robot files."""
