"""Groups of joints: legs, hands, torsos, pan-tilts; arms are joint groups too."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hal.api.motion import Motion
from hal.api.part import Part

if TYPE_CHECKING:
    from bestman_bt.robot_model import JointedModel


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
        """Set one kind of set-point, held until the next command.

        Raises CommandRefusedError unless exactly one is given, of shape (n,), finite and within the limits.
        """

    @abstractmethod
    def move_to(self, positions: ArrayLike, speed_scale: float = 1.0) -> Motion[None]:
        """Move point to point, synchronised, within ``speed_scale`` (0, 1] of the limits; no collision check."""
