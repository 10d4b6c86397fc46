"""Value types shared by all packages: frozen dataclasses over numpy arrays, SI units, quaternions xyzw."""

from bestman_bt.messages.failure import Failure, MotionErrorCode, MotionObstacle, MotionStage
from bestman_bt.messages.grids import VOXEL_FREE, VOXEL_OCCUPIED, VOXEL_UNKNOWN, OccupancyGrid, VoxelGrid
from bestman_bt.messages.handle import Handle, HandleKind, HingeSide, JointKind
from bestman_bt.messages.joint_trajectory import JointTrajectory, Path2D, joint_motion
from bestman_bt.messages.object_model import ObjectGrasp, ObjectModel, YawSet
from bestman_bt.messages.pose import Goals, Pose, Pose2D, Twist2D, wrap_angle
from bestman_bt.messages.sensor_readings import GRAVITY, CameraIntrinsics, LaserScan, PointCloud, RGBDImage, Wrench
from bestman_bt.messages.shapes import Box, Cylinder, Mesh, PlacedShape, Shape, Sphere, distance_to_shape

__all__ = [
    "GRAVITY",
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
    "MotionObstacle",
    "MotionStage",
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
