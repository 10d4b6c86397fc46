"""The parts of a robot: joint groups, arms, grippers, mobile bases. Names and models can be read before connecting."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages import JointTrajectory, Pose2D, Twist2D
from hal.api.motion import Motion

if TYPE_CHECKING:
    from bestman_bt.robot_model.model import ArmModel, BaseModel, GripperModel, JointedModel


class Part(ABC):
    """A part of a robot. The constructor does no work; the robot's ``connect()`` does.

    ``name``: name in its robot, for example ``arm``. Attributes can be read before connecting. ``speed_share``: scale
    of its speed, 0 to 1, as set by ``Robot.set_speed``. Joints, bases and grippers apply it to their motions and
    velocities; a caller that streams set-points by ``Arm.servo`` has to apply it itself.
    """

    kind: ClassVar[str]
    speed_share = 1.0

    def __init__(self, name: str) -> None:
        self.name = name

    @abstractmethod
    def stop(self) -> None:
        """Stop this part immediately; idempotent; no effect on sensors."""


class Sensor(Part):
    """A part that only measures."""

    kind: ClassVar[str] = "sensor"

    @abstractmethod
    def read(self) -> Any:
        """Return the latest reading. Raises NoDataError if the sensor is silent."""

    def stop(self) -> None:
        """Do nothing: a sensor does not move."""


class JointGroup(Part):
    """Joints that are commanded together; arrays are (n,), in the order of ``joint_names``."""

    kind: ClassVar[str] = "joint_group"
    model: JointedModel
    """Names and limits of the n joints."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the n joints."""
        return self.model.joint_names

    @abstractmethod
    def positions(self) -> NDArray[np.float64]:
        """Return the measured positions (n,), radians or metres."""

    @abstractmethod
    def velocities(self) -> NDArray[np.float64]:
        """Return the measured velocities (n,), rad/s or m/s."""

    @abstractmethod
    def efforts(self) -> NDArray[np.float64]:
        """Return the measured efforts (n,), N m or N."""

    @abstractmethod
    def command(
        self,
        positions: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        efforts: ArrayLike | None = None,
    ) -> None:
        """Set one kind of set-point, held until the next command; velocities expire after 0.25 s without a new command.

        Raises CommandRefusedError unless exactly one kind is given, of shape (n,), finite and within the limits.
        """

    @abstractmethod
    def move_to(self, positions: ArrayLike, speed_scale: float = 1.0) -> Motion[None]:
        """Start a synchronised point-to-point motion to ``positions`` (n,), radians or metres, without collision
        checks.

        ``speed_scale``: fraction of the limits, (0, 1]. Raises CommandRefusedError for targets beyond a limit.
        """


class Arm(JointGroup):
    """A joint group that follows trajectories and streams set-points."""

    kind: ClassVar[str] = "arm"
    model: ArmModel
    """Names and limits of the n joints, frames."""
    latency: float = 0.02
    """Delay from command to encoder reading without disturbances, seconds."""

    @abstractmethod
    def follow(self, trajectory: JointTrajectory) -> Motion[None]:
        """Follow a trajectory from its start.

        Raises CommandRefusedError if its joints are not this arm's, a sample is beyond a limit, or it does not start at
        the measured positions (within 0.05 rad).
        """

    def trajectory_time(self) -> float | None:
        """Return the trajectory time commanded at the latest joint reading, seconds, or None if it equals the clock's
        time.

        A real arm may run a trajectory more slowly: to keep its tool below a speed, or because its controller is late.
        """
        return None

    def carry(self, mass: float, centre: ArrayLike) -> None:
        """Set the payload in the hand for the controller, 0 kg for none; the hand itself is already included.

        ``mass``: kg. ``centre``: (3,) metres, centre of mass in the arm's ``tool_frame``.
        """

    @abstractmethod
    def servo(self, positions: ArrayLike) -> None:
        """Stream one position set-point (n,), radians. Raises CommandRefusedError if it exceeds the velocity limits."""


@dataclass(frozen=True)
class GripperState:
    """The state according to the gripper's own encoder and motor.

    ``at_target``: the commanded width is reached. ``object_held``: a closing motion was blocked before its target and
    still presses. ``empty``: it closed to its target without an object.
    """

    moving: bool
    at_target: bool
    object_held: bool
    empty: bool


class Gripper(Part):
    """A gripper with a parallel opening."""

    kind: ClassVar[str] = "gripper"
    model: GripperModel
    """Ranges of width, speed and force (``model.part``), and the hand."""

    @abstractmethod
    def width(self) -> float:
        """Return the measured opening between the fingers, metres."""

    @abstractmethod
    def state(self) -> GripperState:
        """Return the current state."""

    @abstractmethod
    def move(self, width: float, force: float | None = None, speed: float | None = None) -> Motion[None]:
        """Open or close to ``width`` metres with at most ``force`` N at ``speed`` m/s; being blocked by an object is
        success.
        """

    def open(self) -> Motion[None]:
        """Open the gripper fully."""
        return self.move(self.model.max_width)

    def close(self, force: float | None = None) -> Motion[None]:
        """Close until blocked or until the fingers meet, with at most ``force`` N."""
        return self.move(self.model.part.min_width, force)


class MobileBase(Part):
    """A base that drives on the floor; wheel kinematics belong to its driver."""

    kind: ClassVar[str] = "mobile_base"
    model: BaseModel
    """Limits (``model.part``) and footprint."""
    command_timeout: float = 0.25
    """Seconds after which ``set_velocity`` expires (command timeout)."""

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
