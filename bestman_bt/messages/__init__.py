"""Value types that travel between floors: frozen dataclasses over numpy arrays, SI units, quaternions xyzw."""

from bestman_bt.messages.failure import Failure, MotionErrorCode
from bestman_bt.messages.goals import Goals
from bestman_bt.messages.handle import Handle, HandleKind, HingeSide, JointKind
from bestman_bt.messages.image import CameraIntrinsics, RGBDImage
from bestman_bt.messages.joint_motion import joint_motion
from bestman_bt.messages.joint_trajectory import JointTrajectory
from bestman_bt.messages.laser_scan import LaserScan
from bestman_bt.messages.object_model import ObjectGrasp, ObjectModel
from bestman_bt.messages.occupancy_grid import OccupancyGrid
from bestman_bt.messages.path import Path2D
from bestman_bt.messages.point_cloud import PointCloud
from bestman_bt.messages.pose import Pose, Pose2D, wrap_angle
from bestman_bt.messages.shape_distance import distance_to_shape
from bestman_bt.messages.shapes import Box, Cylinder, Mesh, PlacedShape, Shape, Sphere
from bestman_bt.messages.twist import Twist2D
from bestman_bt.messages.voxel_grid import VOXEL_FREE, VOXEL_OCCUPIED, VOXEL_UNKNOWN, VoxelGrid
from bestman_bt.messages.wrench import Wrench
from bestman_bt.messages.yaw_set import YawSet

__all__ = [
    "VOXEL_FREE",
    "VOXEL_OCCUPIED",
    "VOXEL_UNKNOWN",
    "Box",
    "CameraIntrinsics",
    "Cylinder",
    "Failure",
    "Goals",
    "Handle",
    "HandleKind",
    "HingeSide",
    "JointKind",
    "JointTrajectory",
    "LaserScan",
    "Mesh",
    "MotionErrorCode",
    "ObjectGrasp",
    "ObjectModel",
    "OccupancyGrid",
    "Path2D",
    "PlacedShape",
    "PointCloud",
    "Pose",
    "Pose2D",
    "RGBDImage",
    "Shape",
    "Sphere",
    "Twist2D",
    "VoxelGrid",
    "Wrench",
    "YawSet",
    "distance_to_shape",
    "joint_motion",
    "wrap_angle",
]
