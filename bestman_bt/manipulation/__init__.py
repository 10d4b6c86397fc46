"""Manipulation algorithms: kinematics, collision worlds, motion planning and trajectories, all in the base frame."""
