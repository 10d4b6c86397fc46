"""Kinematics: frames of the whole robot, inverse kinematics, paths of the tool, reachability, where to stand."""
