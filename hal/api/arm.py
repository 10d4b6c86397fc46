"""Robot arms."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages import JointTrajectory
from hal.api.motion import Motion
from hal.api.part import Part

if TYPE_CHECKING:
    from bestman_bt.robot_model.model import ArmModel, JointedModel


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
        """Set one kind of set-point, held until the next command; velocities lapse after 0.25 s without a new command.

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
