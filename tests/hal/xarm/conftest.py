"""An xArm's twin in a process of its own, and the robot that the vendor's SDK reaches through it."""

from __future__ import annotations

from pathlib import Path

from tests.hal.twinned import fixtures_of

ROBOT = Path(__file__).parent / "xarm6_on_a_base.yaml"

twin, twin_model, make_robot, shared_robot, isolated_robot, robot = fixtures_of(
    ROBOT, "xarm", "xarm", {"arm_controller": ("restore", "released", "gripper_free")}
)
