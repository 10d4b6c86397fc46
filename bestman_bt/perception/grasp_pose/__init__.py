"""Grasps for parallel grippers."""

from bestman_bt.perception.grasp_pose.antipodal_cloud import AntipodalCloud, AntipodalCloudParameters
from bestman_bt.perception.grasp_pose.antipodal_model import AntipodalModelParameters, antipodal_grasps
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspPlanner, GraspTarget
from bestman_bt.perception.grasp_pose.bounding_box import BoundingBox, BoundingBoxParameters
from bestman_bt.perception.grasp_pose.hand_placement import HandPlacementParameters
from bestman_bt.perception.grasp_pose.model_based import ModelBased, ModelBasedParameters

__all__ = [
    "AntipodalCloud",
    "AntipodalCloudParameters",
    "AntipodalModelParameters",
    "BoundingBox",
    "BoundingBoxParameters",
    "GraspCandidate",
    "GraspPlanner",
    "GraspTarget",
    "HandPlacementParameters",
    "ModelBased",
    "ModelBasedParameters",
    "antipodal_grasps",
]
