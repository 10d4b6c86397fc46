"""Where an arm with its hand, and what it holds, is in space: for whoever drives it past something."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from itertools import product

import numpy as np
import pinocchio
from numpy.typing import NDArray

from bestman_bt.manipulation.kinematics.link_hulls import link_hulls
from bestman_bt.manipulation.kinematics.pinocchio_model import build_model, configuration, frame_index, to_pose
from bestman_bt.messages import Pose
from bestman_bt.robot_model import ArmModel, RobotModel, joints_above
from bestman_bt.world_model import HeldObject


class ArmBodies:
    """All links that move with ``arm``; the robot's geometry is loaded at the first question."""

    def __init__(self, robot: RobotModel, arm: str = "arm") -> None:
        self._robot, self._arm = robot, robot.of(ArmModel)[arm]

    def at(self, positions: Mapping[str, float], held: HeldObject | None = None) -> list[NDArray[np.float64]]:
        """Corners of the convex hull of each body, (N, 3) metres in the base frame.

        ``positions``: of all joints, by name; those that are missing stand at zero. ``held``: what is in the hand, as
        the box around it.
        """
        model = self._model
        data = model.createData()
        pinocchio.framesForwardKinematics(model, data, configuration(model, positions))
        base_from_root = data.oMf[frame_index(model, self._robot.base_frame)].inverse()

        def pose(frame: str) -> Pose:
            return to_pose(base_from_root * data.oMf[frame_index(model, frame)])

        bodies = [pose(link).apply(hull) for link, hulls in self._hulls.items() for hull in hulls]
        if held is not None:
            low, high = held.model.bounds()
            corners = np.array(list(product(*zip(low, high, strict=True))))
            bodies.append((pose(self._arm.tool_frame) @ held.tool_from_object).apply(corners))
        return bodies

    @cached_property
    def _model(self) -> pinocchio.Model:
        return build_model(self._robot)

    @cached_property
    def _hulls(self) -> dict[str, tuple[NDArray[np.float64], ...]]:
        moving = set(self._arm.joint_names)
        hulls = link_hulls(self._robot).items()
        return {link: corners for link, corners in hulls if moving & joints_above(self._robot, link)}
