"""Bring-up of a real robot: steps that pass or fail with figures, signed into a file beside the robot's."""
