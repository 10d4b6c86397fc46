"""Calibration of a robot's cameras: datasets, recorded or simulated, and what is written for robot files."""
