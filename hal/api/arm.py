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


# Groups of joints: legs, hands, torsos, pan-tilts; arms are joint groups too.


class JointGroup(Part):
    """Joints that are commanded together; arrays are (n,), in the order of ``joint_names``."""

    kind: ClassVar[str] = "joint_group"
    model: JointedModel
    """Names and limits of the n joints."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints."""
        return self.model.joint_names

    @abstractmethod
    def positions(self) -> NDArray[np.float64]:
        """Measured positions, radians or metres."""

    @abstractmethod
    def velocities(self) -> NDArray[np.float64]:
        """Measured velocities, rad/s or m/s."""

    @abstractmethod
    def efforts(self) -> NDArray[np.float64]:
        """Measured efforts, N m or N."""

    @abstractmethod
    def command(
        self,
        positions: ArrayLike | None = None,
        velocities: ArrayLike | None = None,
        efforts: ArrayLike | None = None,
    ) -> None:
        """Set one kind of set-point, held until the next command; velocities lapse after 0.25 s without one.

        Raises CommandRefusedError unless exactly one is given, of shape (n,), finite and within the limits.
        """

    @abstractmethod
    def move_to(self, positions: ArrayLike, speed_scale: float = 1.0) -> Motion[None]:
        """Move point to point, synchronised, within ``speed_scale`` (0, 1] of the limits; no collision check."""


class Arm(JointGroup):
    """A joint group that follows trajectories and streams set-points."""

    kind: ClassVar[str] = "arm"
    model: ArmModel
    """Names and limits of the n joints, frames."""
    latency: float = 0.02
    """Seconds by which its encoders follow what it is commanded, when nothing disturbs it."""

    @abstractmethod
    def follow(self, trajectory: JointTrajectory) -> Motion[None]:
        """Follow a trajectory from its start.

        Raises CommandRefusedError if its joints are not this arm's, a sample is beyond a limit, or it does not start
        where the arm is (within 0.05 rad).
        """

    def trajectory_time(self) -> float | None:
        """How far the trajectory under way had been commanded when the joints were last read, seconds of it.

        None: as far as the clock says. A real arm may run a trajectory more slowly: to keep its tool below a speed, or
        because its controller is late.
        """
        return None

    def carry(self, mass: float, centre: ArrayLike) -> None:
        """Tell the controller what the hand holds from now on, 0 kg for nothing; it counts on the hand by itself.

        ``mass``: kg. ``centre``: (3,) metres, of mass, in the arm's ``tool_frame``.
        """

    @abstractmethod
    def servo(self, positions: ArrayLike) -> None:
        """Stream one position set-point (n,); refused if it asks for more than the velocity limits allow."""
