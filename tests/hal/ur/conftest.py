"""The twins of a UR and of its gripper in a process of their own, and the robot that the clients reach through them.

A UR takes one client at a time: a module of tests uses ``shared_robot`` or ``isolated_robot``, not both.
"""

from __future__ import annotations

from tests.rigs.twinned_robots import UR5E, fixtures_of

twinned, twin, twin_model, make_robot, shared_robot, isolated_robot, robot = fixtures_of(UR5E)
