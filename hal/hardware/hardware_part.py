"""What a connection needs of its parts."""

from __future__ import annotations

from abc import abstractmethod

from hal.api import Part
from hal.hardware.fault import Fault


class HardwarePart(Part):
    """A part behind a controller."""

    @abstractmethod
    def attach(self) -> None:
        """The controller has connected, or has recovered: hold where the part is."""

    @abstractmethod
    def detach(self) -> None:
        """The controller is about to disconnect: motions fail, the part brakes, commands are refused; idempotent."""

    @property
    @abstractmethod
    def resting(self) -> bool:
        """Whether nothing of it is commanded to move any more."""

    @abstractmethod
    def fail(self, fault: Fault) -> None:
        """The controller has a fault: the motion under way has failed, the part comes to rest."""
