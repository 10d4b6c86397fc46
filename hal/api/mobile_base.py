"""Mobile bases."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from bestman_bt.messages import Pose2D, Twist2D
from hal.api.motion import Motion
from hal.api.part import Part


@dataclass(frozen=True)
class BaseDescription:
    """Limits of a base: m/s, rad/s, m/s², rad/s²; ``max_vy`` is 0 for a base that cannot move sideways.

    ``max_jerk``, ``max_angular_jerk``: m/s³ and rad/s³ that whoever plans motions should keep; drivers do not check it.

    ``command_timeout``: seconds after which ``set_velocity`` lapses (dead-man). ``footprint``: corners (x, y) in
    metres in the base frame, counter-clockwise. ``turning_drift``: metres that the base frame may wander while it turns
    on the spot; more than nothing where wheels are dragged over the floor.
    """

    max_vx: float
    max_vy: float
    max_wz: float
    max_acceleration: float
    max_angular_acceleration: float
    command_timeout: float
    footprint: tuple[tuple[float, float], ...]
    max_jerk: float = 2.0
    max_angular_jerk: float = 10.0
    turning_drift: float = 0.0


class MobileBase(Part):
    """A base that drives on the floor; wheel kinematics live in its driver."""

    kind: ClassVar[str] = "mobile_base"

    @property
    @abstractmethod
    def description(self) -> BaseDescription:
        """Limits and footprint; readable before connecting."""

    @abstractmethod
    def odometry(self) -> Pose2D:
        """Pose in the ``odom`` frame, from encoders: it drifts. No method gives the true pose."""

    @abstractmethod
    def velocity(self) -> Twist2D:
        """Measured velocity in the base frame, from encoders."""

    @abstractmethod
    def set_velocity(self, vx: float, vy: float, wz: float) -> None:
        """Drive at a velocity (base frame) until the next command or ``command_timeout``.

        Raises CommandRefusedError when it is not finite, beyond a limit, or the robot is stopped.
        """

    @abstractmethod
    def move_forward(self, distance: float) -> Motion:
        """Drive ``distance`` metres (> 0) straight ahead."""

    @abstractmethod
    def move_backward(self, distance: float) -> Motion:
        """Drive ``distance`` metres (> 0) straight back."""

    @abstractmethod
    def rotate(self, angle: float) -> Motion:
        """Turn on the spot by ``angle`` radians, counter-clockwise positive."""
