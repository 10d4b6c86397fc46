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
    """What the gripper's own encoder and motor say.

    ``at_target``: the commanded width is reached. ``object_held``: a closing motion was blocked before its target
    and still presses. ``empty``: it closed to its target and met nothing.
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
        """Measured opening between the fingers, metres."""

    @abstractmethod
    def state(self) -> GripperState:
        """The present state."""

    @abstractmethod
    def move(self, width: float, force: float | None = None, speed: float | None = None) -> Motion[None]:
        """Open or close to ``width`` metres with at most ``force`` N; being blocked by an object is success."""

    def open(self) -> Motion[None]:
        """Open fully."""
        return self.move(self.model.max_width)

    def close(self, force: float | None = None) -> Motion[None]:
        """Close until something blocks or the fingers meet."""
        return self.move(self.model.part.min_width, force)
