"""Forward kinematics: the pose of any link of the robot from joint positions by name."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import pinocchio

from bestman_bt.manipulation.kinematics.pinocchio_model import build_model, configuration, frame_index, to_pose
from bestman_bt.messages import Pose
from bestman_bt.robot_model import RobotModel


class ForwardKinematics:
    """Frames of the whole robot; the model is built at the first question."""

    def __init__(self, robot: RobotModel) -> None:
        self.robot = robot

    @cached_property
    def _model(self) -> pinocchio.Model:
        return build_model(self.robot)

    @cached_property
    def _data(self) -> pinocchio.Data:
        return self._model.createData()

    def pose(self, frame: str, positions: Mapping[str, float], reference: str | None = None) -> Pose:
        """The pose of the link ``frame`` in the link ``reference`` (default: the robot's base frame).

        ``positions``: joint name → radians or metres; joints that are missing stand at zero.
        Raises ManipulationError for an unknown link or joint, or a position that is not finite.
        """
        model, data = self._model, self._data
        frame_id = frame_index(model, frame)
        reference_id = frame_index(model, reference or self.robot.base_frame)
        pinocchio.forwardKinematics(model, data, configuration(model, positions))
        root_from_frame = pinocchio.updateFramePlacement(model, data, frame_id).copy()
        root_from_reference = pinocchio.updateFramePlacement(model, data, reference_id)
        return to_pose(root_from_reference.actInv(root_from_frame))
