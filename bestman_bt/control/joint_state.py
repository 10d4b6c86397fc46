"""The positions of all joints of a robot, by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from bestman_bt.perception.errors import PerceptionError
from hal.api import Gripper, JointGroup, MotionErrorCode, NoDataError, NotConnectedError, Part, PartError, RobotError

if TYPE_CHECKING:
    from bestman_bt.robot_model import RobotModel


class JointStateError(PartError, PerceptionError):
    """The encoders of a part deliver nothing: its controller is not connected, or no longer."""

    code = MotionErrorCode.DISCONNECTED


READING_ERRORS = (NotConnectedError, NoDataError, JointStateError)
"""What reading a robot may raise: a controller is gone, or a sensor is silent; ``code`` tells which."""


class JointStateSensor:
    """Reads the encoders of arms, other joint groups and grippers; wheels are left out, nothing depends on them.

    A gripper tells its width only; the robot model knows how its joints then stand.
    """

    def __init__(self, parts: Mapping[str, Part], model: RobotModel) -> None:
        from bestman_bt.robot_model import GripperModel

        self._parts, self._grippers = parts, model.of(GripperModel)

    def positions(self) -> Mapping[str, float]:
        """Joint name → measured position, radians or metres; JointStateError where a part tells none."""
        positions: dict[str, float] = {}
        for name, part in self._parts.items():
            try:
                if isinstance(part, JointGroup):
                    positions.update(zip(part.joint_names, part.positions().tolist(), strict=True))
                elif isinstance(part, Gripper) and name in self._grippers:
                    positions.update(self._grippers[name].joint_positions(part.width()))
            except RobotError as error:
                vendor_code = error.failure.vendor_code if isinstance(error, PartError) else ""
                raise JointStateError(str(error), name, vendor_code) from error
        return MappingProxyType(positions)
