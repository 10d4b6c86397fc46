"""Grasps for parallel grippers."""

from bestman_bt.perception.grasp_pose.antipodal_cloud import AntipodalCloud, AntipodalCloudParameters
from bestman_bt.perception.grasp_pose.antipodal_model import AntipodalModelParameters, antipodal_grasps
from bestman_bt.perception.grasp_pose.anygrasp import AnyGraspAdapter, AnyGraspAdapterParameters
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspPlanner, GraspTarget
from bestman_bt.perception.grasp_pose.bounding_box import BoundingBox, BoundingBoxParameters
from bestman_bt.perception.grasp_pose.hand_placement import HandPlacementParameters
from bestman_bt.perception.grasp_pose.hand_shape import HandShape, HandShapeParameters
from bestman_bt.perception.grasp_pose.handle_grasp import HandleGrasp, HandleGraspParameters
from bestman_bt.perception.grasp_pose.handle_motion import handle_motion
from bestman_bt.perception.grasp_pose.model_based import ModelBased, ModelBasedParameters
from bestman_bt.perception.grasp_pose.ranking import GraspRankingParameters, RankedGrasp, rank_grasps

__all__ = [
    "AntipodalCloud",
    "AntipodalCloudParameters",
    "AntipodalModelParameters",
    "AnyGraspAdapter",
    "AnyGraspAdapterParameters",
    "BoundingBox",
    "BoundingBoxParameters",
    "GraspCandidate",
    "GraspPlanner",
    "GraspRankingParameters",
    "GraspTarget",
    "HandPlacementParameters",
    "HandShape",
    "HandShapeParameters",
    "HandleGrasp",
    "HandleGraspParameters",
    "ModelBased",
    "ModelBasedParameters",
    "RankedGrasp",
    "antipodal_grasps",
    "handle_motion",
    "rank_grasps",
]
