"""ROS messages as rosbridge writes them in JSON: JSON has no infinities, and bytes are base64."""

from __future__ import annotations

import base64
import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, LaserScan, Pose2D, RGBDImage, Twist2D, Wrench
from hal.api import BatteryReading, ImuReading

JPEG_QUALITY = 95
INVERSE_DEPTH = 0
CHARGING, DISCHARGING = 1, 2
Message = dict[str, Any]


@dataclass(frozen=True)
class RosVersion:
    """The ROS version, which determines the format of times."""

    number: int

    def time(self, seconds: float) -> Message:
        """Return a time or duration."""
        whole = math.floor(seconds)
        names = ("secs", "nsecs") if self.number == 1 else ("sec", "nanosec")
        return dict(zip(names, (whole, int((seconds - whole) * 1e9)), strict=True))

    def header(self, frame: str, seconds: float) -> Message:
        """Return a ``std_msgs/Header``."""
        return {"stamp": self.time(seconds), "frame_id": frame}


def odometry(header: Message, child: str, pose: Pose2D, velocity: Twist2D) -> Message:
    """Return a ``nav_msgs/Odometry``."""
    at = {"position": {"x": pose.x, "y": pose.y, "z": 0.0}, "orientation": _yaw(pose.theta)}
    twist = {
        "linear": {"x": velocity.vx, "y": velocity.vy, "z": 0.0},
        "angular": {"x": 0.0, "y": 0.0, "z": velocity.wz},
    }
    unknown = [0.0] * 36
    return {
        "header": header,
        "child_frame_id": child,
        "pose": {"pose": at, "covariance": unknown},
        "twist": {"twist": twist, "covariance": unknown},
    }


def transform(header: Message, child: str, pose: Pose2D) -> Message:
    """Return a ``tf2_msgs/TFMessage`` with one transform."""
    moved = {"translation": {"x": pose.x, "y": pose.y, "z": 0.0}, "rotation": _yaw(pose.theta)}
    return {"transforms": [{"header": header, "child_frame_id": child, "transform": moved}]}


def laser_scan(header: Message, scan: LaserScan) -> Message:
    """Return a ``sensor_msgs/LaserScan``."""
    count = len(scan.ranges)
    return {
        "header": header,
        "angle_min": scan.angle_min,
        "angle_max": scan.angle_min + scan.angle_increment * (count - 1),
        "angle_increment": scan.angle_increment,
        "time_increment": scan.time_increment,
        "scan_time": scan.time_increment * count,
        "range_min": scan.range_min,
        "range_max": scan.range_max,
        "ranges": [value if math.isfinite(value) else None for value in scan.ranges.tolist()],
        "intensities": [],
    }


def wrench(header: Message, reading: Wrench) -> Message:
    """Return a ``geometry_msgs/WrenchStamped``."""
    both = {"force": reading.force, "torque": reading.torque}
    return {"header": header, "wrench": {n: dict(zip("xyz", v.tolist(), strict=True)) for n, v in both.items()}}


def imu(header: Message, reading: ImuReading) -> Message:
    """Return a ``sensor_msgs/Imu`` without orientation."""
    unknown = [-1.0] + [0.0] * 8
    return {
        "header": header,
        "orientation": _yaw(0.0),
        "orientation_covariance": unknown,
        "angular_velocity": dict(zip("xyz", reading.angular_velocity.tolist(), strict=True)),
        "angular_velocity_covariance": [0.0] * 9,
        "linear_acceleration": dict(zip("xyz", reading.linear_acceleration.tolist(), strict=True)),
        "linear_acceleration_covariance": [0.0] * 9,
    }


def battery(header: Message, reading: BatteryReading) -> Message:
    """Return a ``sensor_msgs/BatteryState``: current is negative when discharging; unmeasured values are null."""
    unknown = dict.fromkeys(("temperature", "charge", "capacity", "design_capacity"))
    return {
        "header": header,
        **unknown,
        "percentage": reading.charge,
        "voltage": reading.voltage,
        "current": -reading.current,
        "power_supply_status": CHARGING if reading.charging else DISCHARGING,
        "present": True,
    }


def joint_states(header: Message, names: Sequence[str], columns: Sequence[Sequence[float]]) -> Message:
    """Return a ``sensor_msgs/JointState``; ``columns``: positions, velocities, efforts."""
    position, velocity, effort = (list(column) for column in columns)
    return {"header": header, "name": list(names), "position": position, "velocity": velocity, "effort": effort}


def camera_info(header: Message, k: CameraIntrinsics, version: RosVersion) -> Message:
    """Return a ``sensor_msgs/CameraInfo``; ROS 1 names its matrices in capitals."""
    matrix = [k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0]
    projection = [k.fx, 0.0, k.cx, 0.0, 0.0, k.fy, k.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    values = {
        "d": list(k.distortion) or [0.0] * 5,
        "k": matrix,
        "r": [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0],
        "p": projection,
    }
    if version.number == 1:
        values = {name.upper(): value for name, value in values.items()}
    return {"header": header, "height": k.height, "width": k.width, "distortion_model": "plumb_bob", **values}


def image_messages(image: RGBDImage) -> tuple[Message, Message]:
    """Return colour and depth as ``sensor_msgs/CompressedImage`` without headers."""
    return color_image(image), depth_image(image)


def color_image(image: RGBDImage) -> Message:
    """Return a ``sensor_msgs/CompressedImage``: JPEG."""
    packed = _packed(".jpg", image.rgb[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return {"format": "rgb8; jpeg compressed bgr8", "data": packed}


def depth_image(image: RGBDImage) -> Message:
    """Return a ``sensor_msgs/CompressedImage`` as from compressed_depth_image_transport: a header, then millimetres as
    PNG.
    """
    millimetres = np.clip(np.round(image.depth * 1000.0), 0, 65535).astype(np.uint16)
    before = struct.pack("<iff", INVERSE_DEPTH, 0.0, 0.0)
    packed = _packed(".png", millimetres, [cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE], before)
    return {"format": "16UC1; compressedDepth png", "data": packed}


def _packed(kind: str, pixels: NDArray[Any], settings: list[int], before: bytes = b"") -> str:
    _, data = cv2.imencode(kind, np.ascontiguousarray(pixels), settings)
    return base64.b64encode(before + data.tobytes()).decode("ascii")


def _yaw(angle: float) -> Message:
    return {"x": 0.0, "y": 0.0, "z": math.sin(angle / 2.0), "w": math.cos(angle / 2.0)}
