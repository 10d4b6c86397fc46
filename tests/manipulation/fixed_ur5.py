"""A UR5 on a fixed base, from the package example-robot-data."""

from __future__ import annotations

from importlib.metadata import distribution
from pathlib import Path

import numpy as np

from bestman_bt.robot_model.model import RobotModel
from tests.robot_models import arm_model


def fixed_ur5() -> RobotModel:
    package = distribution("example-robot-data")
    file = next(file for file in package.files or [] if file.name == "ur5_robot.urdf")
    path = Path(str(package.locate_file(file)))
    arm = arm_model(
        (
            "shoulder_pan_joint",
            "shoulder_lift_joint",
            "elbow_joint",
            "wrist_1_joint",
            "wrist_2_joint",
            "wrist_3_joint",
        ),
        base_frame="base_link",
        tool_frame="tool0",
        lower=np.array([-2.0, -2.0, -1.0, -2.0, -2.0, -2.0]) * np.pi,
        upper=np.array([2.0, 2.0, 1.0, 2.0, 2.0, 2.0]) * np.pi,
        velocity=np.array([3.15] * 3 + [3.2] * 3),
        acceleration=np.full(6, 8.0),
        effort=np.array([150.0] * 3 + [28.0] * 3),
    )
    return RobotModel(name="fixed_ur5", urdf=path.read_text(), base_frame="base_link", parts={"arm": arm})
