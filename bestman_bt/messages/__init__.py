"""Value types that travel between floors: frozen dataclasses over numpy arrays, SI units, quaternions xyzw."""

from bestman_bt.messages.image import CameraIntrinsics, RGBDImage
from bestman_bt.messages.joint_trajectory import JointTrajectory
from bestman_bt.messages.laser_scan import LaserScan
from bestman_bt.messages.object_model import ObjectModel
from bestman_bt.messages.occupancy_grid import OccupancyGrid
from bestman_bt.messages.path import Path2D
from bestman_bt.messages.point_cloud import PointCloud
from bestman_bt.messages.pose import Pose, Pose2D, wrap_angle
from bestman_bt.messages.shapes import Box, Cylinder, Mesh, PlacedShape, Shape, Sphere
from bestman_bt.messages.twist import Twist2D
from bestman_bt.messages.wrench import Wrench

__all__ = [
    "Box",
    "CameraIntrinsics",
    "Cylinder",
    "JointTrajectory",
    "LaserScan",
    "Mesh",
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
    "Wrench",
    "wrap_angle",
]
