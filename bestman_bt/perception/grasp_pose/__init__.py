"""Grasps for parallel grippers."""
