"""Mobile bases."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

from bestman_bt.messages import Pose2D, Twist2D
from hal.api.motion import Motion
from hal.api.part import Part

if TYPE_CHECKING:
    from bestman_bt.robot_model.model import BaseModel


class MobileBase(Part):
    """A base that drives on the floor; wheel kinematics belong to its driver."""

    kind: ClassVar[str] = "mobile_base"
    model: BaseModel
    """Limits (``model.part``) and footprint."""
    command_timeout: float = 0.25
    """Seconds after which ``set_velocity`` lapses (dead-man)."""

    @abstractmethod
    def odometry(self) -> Pose2D:
        """Return the pose in the ``odom`` frame from encoders, which drifts. No method returns the true pose."""

    @abstractmethod
    def velocity(self) -> Twist2D:
        """Return the measured velocity in the base frame, from encoders."""

    @abstractmethod
    def set_velocity(self, vx: float, vy: float, wz: float) -> None:
        """Drive at a velocity (m/s, rad/s, base frame) until the next command or ``command_timeout``.

        Raises CommandRefusedError if it is not finite, beyond a limit, or the robot is stopped.
        """

    @abstractmethod
    def move_forward(self, distance: float) -> Motion[None]:
        """Drive ``distance`` metres (> 0) straight ahead. Raises CommandRefusedError for other distances."""

    @abstractmethod
    def move_backward(self, distance: float) -> Motion[None]:
        """Drive ``distance`` metres (> 0) straight back. Raises CommandRefusedError for other distances."""

    @abstractmethod
    def rotate(self, angle: float) -> Motion[None]:
        """Turn in place by ``angle`` radians, counter-clockwise positive. Raises CommandRefusedError if it is not
        finite.
        """
