"""Kinematics: forward and inverse kinematics, tool paths, reachability, base placement."""
