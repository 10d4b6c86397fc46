"""Robot arms."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

from numpy.typing import ArrayLike

from bestman_bt.messages import JointTrajectory
from hal.api.joint_group import JointGroup
from hal.api.motion import Motion

if TYPE_CHECKING:
    from bestman_bt.robot_model import ArmModel


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

    @abstractmethod
    def servo(self, positions: ArrayLike) -> None:
        """Stream one position set-point (n,); refused if it asks for more than the velocity limits allow."""
