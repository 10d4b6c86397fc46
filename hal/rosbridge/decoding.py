"""Decodes ROS messages from rosbridge's JSON; malformed ones raise KeyError, TypeError or ValueError."""

from __future__ import annotations

import base64
import math
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, LaserScan, Pose2D, Twist2D, Wrench
from hal.api import BatteryReading, ImuReading
from hal.parts.channels import BaseReading

Message = Mapping[str, Any]
DEPTH_HEADER = struct.Struct("<iff")
"""Header before the PNG of compressed_depth_image_transport: a format and two quantisation parameters."""
_IMU_FIELDS = "angular_velocity", "linear_acceleration"
CHARGING = 1
"""Value of the power supply state for charging."""
MILLIMETRES, METRES = "16UC1", "32FC1"


def stamp(header: Message) -> float:
    """Return seconds of ROS time, of either version; 0 without a stamp."""
    at = header["stamp"]
    if "sec" in at:
        return float(at["sec"]) + 1e-9 * float(at["nanosec"])
    return float(at["secs"]) + 1e-9 * float(at["nsecs"])


def pose(position: Message, orientation: Message) -> Pose2D:
    """Return the planar part of a pose."""
    x, y, z, w = (float(orientation[axis]) for axis in "xyzw")
    heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return Pose2D(float(position["x"]), float(position["y"]), heading)


def odometry(message: Message) -> BaseReading:
    """Decode ``nav_msgs/Odometry``; its twist is in the base frame."""
    at, twist = message["pose"]["pose"], message["twist"]["twist"]
    velocity = Twist2D(float(twist["linear"]["x"]), float(twist["linear"]["y"]), float(twist["angular"]["z"]))
    return BaseReading(pose(at["position"], at["orientation"]), velocity)


def transform(message: Message, parent: str, child: str) -> tuple[float, Pose2D] | None:
    """Return stamp and pose of ``child`` in ``parent`` in a ``tf2_msgs/TFMessage``, or None if it is not in it."""
    for entry in message["transforms"]:
        names = (entry["header"]["frame_id"].lstrip("/"), entry["child_frame_id"].lstrip("/"))
        if names == (parent, child):
            moved = entry["transform"]
            return stamp(entry["header"]), pose(moved["translation"], moved["rotation"])
    return None


def laser_scan(message: Message, at: float) -> LaserScan:
    """Decode ``sensor_msgs/LaserScan``; non-finite ranges arrive as null, ranges outside the limits count as no hit."""
    ranges = np.array([math.inf if value is None else value for value in message["ranges"]], dtype=float)
    lower, upper = float(message["range_min"]), float(message["range_max"])
    ranges[~((ranges >= lower) & (ranges <= upper))] = np.inf
    beams = float(message["angle_min"]), float(message["angle_increment"])
    return LaserScan(ranges, *beams, lower, upper, at, float(message["time_increment"]))


def wrench(message: Message, at: float) -> Wrench:
    """Decode ``geometry_msgs/WrenchStamped``."""
    force, torque = ([float(message["wrench"][what][axis]) for axis in "xyz"] for what in ("force", "torque"))
    return Wrench(np.array(force), np.array(torque), at)


def imu(message: Message, at: float) -> ImuReading:
    """Decode ``sensor_msgs/Imu``."""
    turning, pushing = ([float(message[what][axis]) for axis in "xyz"] for what in _IMU_FIELDS)
    return ImuReading(np.array(turning), np.array(pushing), at)


def battery(message: Message, at: float) -> BatteryReading:
    """Decode ``sensor_msgs/BatteryState``, whose current is negative when discharging; unmeasured values are null."""
    charge, voltage, current = (message[what] for what in ("percentage", "voltage", "current"))
    if charge is None or voltage is None:
        raise ValueError("a battery should report its charge and voltage")
    charging = int(message["power_supply_status"]) == CHARGING
    return BatteryReading(float(charge), float(voltage), -float(current or 0.0), charging, at)


def joints(message: Message, names: Sequence[str]) -> tuple[list[float], list[float], list[float]] | None:
    """Return positions, velocities and efforts of ``names`` in a ``sensor_msgs/JointState``, or None if one is not in
    it.

    Missing values count as 0.
    """
    order = {name: index for index, name in enumerate(message["name"])}
    if any(name not in order for name in names):
        return None
    columns = []
    for what in ("position", "velocity", "effort"):
        values = message[what]
        columns.append([float(values[order[name]] or 0.0) if values else 0.0 for name in names])
    return columns[0], columns[1], columns[2]


def intrinsics(message: Message) -> CameraIntrinsics:
    """Decode ``sensor_msgs/CameraInfo``; ROS 1 names its matrices in capitals."""
    k = message["k"] if "k" in message else message["K"]
    return CameraIntrinsics(
        int(message["width"]), int(message["height"]), float(k[0]), float(k[4]), float(k[2]), float(k[5])
    )


def color_image(message: Message) -> NDArray[np.uint8]:
    """Decode ``sensor_msgs/CompressedImage`` (JPEG or PNG): (H, W, 3) uint8, RGB."""
    image = _unpacked(base64.b64decode(message["data"]), cv2.IMREAD_COLOR, message["format"])
    return np.ascontiguousarray(image[:, :, ::-1])


def depth_image(message: Message) -> NDArray[np.float32]:
    """Decode ``sensor_msgs/CompressedImage`` of compressed_depth_image_transport: (H, W) float32 metres, 0 where
    unknown.

    16UC1 holds millimetres; 32FC1 holds ``a / depth + b``, with a and b in the header.
    """
    form, data = str(message["format"]), base64.b64decode(message["data"])
    kind = form.partition(";")[0].strip()
    if kind not in (MILLIMETRES, METRES) or "rvl" in form.lower():
        raise ValueError(f"depth should be {MILLIMETRES} or {METRES} as PNG, but is {form!r}")
    _, a, b = DEPTH_HEADER.unpack_from(data)
    raw = _unpacked(data[DEPTH_HEADER.size :], cv2.IMREAD_UNCHANGED, form)
    if kind == MILLIMETRES:
        return (raw * np.float32(0.001)).astype(np.float32)
    known = raw > 0
    depth = np.zeros(raw.shape, np.float32)
    depth[known] = a / (raw[known].astype(np.float32) - b)
    return depth


def _unpacked(data: bytes, flags: int, form: object) -> NDArray[Any]:
    image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    if image is None:
        raise ValueError(f"an image of the format {form!r} cannot be unpacked")
    return image
