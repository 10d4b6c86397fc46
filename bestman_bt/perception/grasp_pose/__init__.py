"""Grasps for parallel grippers."""

from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspPlanner, GraspTarget

__all__ = ["GraspCandidate", "GraspPlanner", "GraspTarget"]
