"""The twin of a ROS robot in a process of its own, and the robot that the clients reach through rosbridge."""

from __future__ import annotations

from pathlib import Path

from tests.hal.twinned import fixtures_of

ROBOT = Path(__file__).parent / "ros_robot.yaml"

twin, twin_model, make_robot, shared_robot, isolated_robot, robot = fixtures_of(
    ROBOT, "roslibpy", "rosbridge", {"platform": ("restore", "fresh_odometry", "free", "sighted", "clock_right")}
)
