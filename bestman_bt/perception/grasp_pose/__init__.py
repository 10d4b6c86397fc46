"""Grasps for parallel grippers."""

from bestman_bt.perception.grasp_pose.antipodal_cloud import AntipodalCloud
from bestman_bt.perception.grasp_pose.anygrasp import AnyGraspAdapter
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspPlanner, GraspTarget
from bestman_bt.perception.grasp_pose.hand_poses import handle_motion
from bestman_bt.perception.grasp_pose.hand_shape import HandPlacement, HandShape, HandSize
from bestman_bt.perception.grasp_pose.handle_grasp import HandleGrasp
from bestman_bt.perception.grasp_pose.model_based import AntipodalModel, ModelBased
from bestman_bt.perception.grasp_pose.ranking import GraspRanking, RankedGrasp

__all__ = [
    "AntipodalCloud",
    "AntipodalModel",
    "AnyGraspAdapter",
    "GraspCandidate",
    "GraspPlanner",
    "GraspRanking",
    "GraspTarget",
    "HandPlacement",
    "HandShape",
    "HandSize",
    "HandleGrasp",
    "ModelBased",
    "RankedGrasp",
    "handle_motion",
]
