"""An xArm's twin in a process of its own, and the robot that the vendor's SDK reaches through it."""

from __future__ import annotations

from tests.rigs.twinned_robots import XARM6, fixtures_of

twinned, twin, twin_model, make_robot, shared_robot, isolated_robot, robot = fixtures_of(XARM6)
