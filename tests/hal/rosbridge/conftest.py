"""The twin of a ROS robot in a process of its own, and the robot that the clients reach through rosbridge."""

from __future__ import annotations

from tests.rigs.twinned_robots import ROS, fixtures_of

twinned, twin, twin_model, make_robot, shared_robot, isolated_robot, robot = fixtures_of(ROS)
