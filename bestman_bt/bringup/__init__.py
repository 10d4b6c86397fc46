"""Bring-up of a real robot: steps that pass or fail with measurements, signed in a file beside the robot's."""
