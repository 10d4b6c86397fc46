"""Sensing: readings of a robot's sensors, put into the base frame by encoders and kinematics."""
