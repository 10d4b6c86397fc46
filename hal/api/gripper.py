"""Grippers."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from hal.api.motion import Motion
from hal.api.part import Part

if TYPE_CHECKING:
    from bestman_bt.robot_model.model import GripperModel


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
