"""The twins of a UR and of its gripper in a process of their own, and the robot that the clients reach through them.

A UR takes one client at a time: a module of tests uses ``shared_robot`` or ``isolated_robot``, not both.
"""

from __future__ import annotations

from pathlib import Path

from tests.hal.twinned import fixtures_of

ROBOT = Path(__file__).parent / "ur5e_on_a_base.yaml"

twin, twin_model, make_robot, shared_robot, isolated_robot, robot = fixtures_of(
    ROBOT,
    "rtde_control",
    "ur",
    {"arm_controller": ("restore", "released"), "hand_controller": ("restore", "gripper_free")},
)
