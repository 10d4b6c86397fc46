"""ROS messages become ours: units, frames, times, and what JSON cannot say."""

from __future__ import annotations

import base64
import dataclasses
import math
import struct

import cv2
import numpy as np
import pytest

from bestman_bt.messages import CameraIntrinsics, LaserScan, Pose2D, RGBDImage, Twist2D
from hal.api import BatteryReading, ImuReading
from hal.rosbridge import decoding
from hal.rosbridge.connection import TransformOdometry
from hal.twins import ros_messages
from hal.twins.ros_messages import RosVersion


@pytest.mark.parametrize("version", [1, 2])
def test_stamps_of_both_versions_of_ros_are_read(version: int) -> None:
    header = RosVersion(version).header("map", 12.25)
    assert decoding.stamp(header) == pytest.approx(12.25)


def test_odometry_comes_through() -> None:
    message = ros_messages.odometry({}, "base_link", Pose2D(1.0, -2.0, 2.5), Twist2D(0.3, 0.1, -0.4))
    reading = decoding.odometry(message)
    assert (reading.odometry.x, reading.odometry.y, reading.odometry.theta) == pytest.approx((1.0, -2.0, 2.5))
    assert (reading.velocity.vx, reading.velocity.vy, reading.velocity.wz) == pytest.approx((0.3, 0.1, -0.4))


def test_a_scan_without_hits_is_infinite_where_json_says_null() -> None:
    scan = LaserScan(np.array([1.0, np.inf, 2.5, 0.1]), -1.0, 0.5, 0.2, 8.0, 0.0)
    read = decoding.laser_scan(ros_messages.laser_scan({}, scan), 3.0)
    assert read.ranges.tolist() == [1.0, math.inf, 2.5, math.inf]  # the last one is nearer than it can measure
    assert (read.angle_min, read.angle_increment, read.stamp) == (-1.0, 0.5, 3.0)


def picture() -> RGBDImage:
    rgb = np.zeros((40, 60, 3), np.uint8)
    rgb[:, :30] = (200, 30, 10)
    depth = np.linspace(0.4, 3.0, 2400, dtype=np.float32).reshape(40, 60)
    depth[0, 0] = 0.0
    return RGBDImage(rgb, depth, CameraIntrinsics(60, 40, 50.0, 50.0, 29.5, 19.5), 0.0)


def test_colours_keep_their_order_through_jpeg() -> None:
    rgb = decoding.color_image(ros_messages.color_image(picture()))
    assert rgb.shape == (40, 60, 3)
    assert np.max(np.abs(rgb[20, 5].astype(int) - (200, 30, 10))) < 12


def test_depth_in_millimetres_has_a_header_of_twelve_bytes() -> None:
    message = ros_messages.depth_image(picture())
    assert base64.b64decode(message["data"])[12:16] == b"\x89PNG"
    depth = decoding.depth_image(message)
    assert depth.dtype == np.float32
    assert np.max(np.abs(depth - picture().depth)) <= 0.00051
    assert depth[0, 0] == 0.0


def test_depth_in_metres_is_quantised_as_inverse_depth() -> None:
    """As compressed_depth_image_transport does it: (a / depth + b) as 16 bits, a and b in the header."""
    a, b, depth = 4000.0, -100.0, picture().depth
    raw = np.zeros(depth.shape, np.uint16)
    known = depth > 0
    raw[known] = np.round(a / depth[known] + b)
    _, png = cv2.imencode(".png", raw)
    data = struct.pack("<iff", 0, a, b) + png.tobytes()
    read = decoding.depth_image({"format": "32FC1; compressedDepth", "data": base64.b64encode(data).decode()})
    assert np.max(np.abs(read[known] / depth[known] - 1.0)) < 1e-3
    assert read[0, 0] == 0.0


def test_a_depth_image_in_another_packing_is_refused_in_words() -> None:
    message = ros_messages.depth_image(picture()) | {"format": "16UC1; compressedDepth rvl"}
    with pytest.raises(ValueError, match="16UC1; compressedDepth rvl"):
        decoding.depth_image(message)


def test_joints_are_found_by_name_among_others() -> None:
    message = ros_messages.joint_states({}, ["wheel", "tilt", "pan"], [[9.0, 0.5, 0.1], [8.0, 0.2, 0.3], [0, 0, 0]])
    assert decoding.joints(message, ["pan", "tilt"]) == ([0.1, 0.5], [0.3, 0.2], [0.0, 0.0])
    assert decoding.joints(message, ["pan", "lift"]) is None


def test_odometry_by_transforms_has_velocities_in_the_base_frame() -> None:
    source, version = TransformOdometry("odom", "base_link"), RosVersion(2)
    for at, pose in ((5.0, Pose2D(1.0, 1.0, math.pi / 2)), (5.1, Pose2D(1.0, 1.03, math.pi / 2 + 0.02))):
        message = ros_messages.transform(version.header("odom", at), "base_link", pose)
        reading = source.decode(message, at)
    assert reading is not None
    assert reading.velocity.vx == pytest.approx(0.3)
    assert reading.velocity.vy == pytest.approx(0.0, abs=1e-9)
    assert reading.velocity.wz == pytest.approx(0.2)
    other = ros_messages.transform(version.header("base_link", 5.2), "camera", Pose2D(0, 0, 0))
    assert source.decode(other, 5.2) is None


def test_odometry_by_transforms_begins_anew_where_the_time_of_ros_goes_back() -> None:
    """As after a restart of the robot's computer, or of a simulation."""
    source, version = TransformOdometry("odom", "base_link"), RosVersion(2)
    velocities = []
    for at, x in ((50.0, 1.0), (50.1, 1.05), (2.0, 0.0), (2.1, -0.02)):
        reading = source.decode(ros_messages.transform(version.header("odom", at), "base_link", Pose2D(x, 0, 0)), at)
        assert reading is not None
        velocities.append(reading.velocity.vx)
    assert velocities == pytest.approx([0.0, 0.5, 0.0, -0.2])


def test_a_battery_reports_what_is_drawn_and_whether_it_charges() -> None:
    told = BatteryReading(0.8, 25.2, 3.5, False, 0.0)
    message = ros_messages.battery({}, told)
    assert message["current"] == -3.5
    assert decoding.battery(message, 0.0) == told
    assert decoding.battery(ros_messages.battery({}, dataclasses.replace(told, charging=True)), 0.0).charging
    with pytest.raises(ValueError, match="charge"):
        decoding.battery({**message, "percentage": None}, 0.0)


def test_an_imu_keeps_its_axes() -> None:
    told = ImuReading(np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 9.81]), 0.0)
    read = decoding.imu(ros_messages.imu({}, told), 4.0)
    assert read.angular_velocity.tolist() == [0.1, 0.2, 0.3]
    assert read.linear_acceleration.tolist() == [1.0, 2.0, 9.81]
    assert read.stamp == 4.0
