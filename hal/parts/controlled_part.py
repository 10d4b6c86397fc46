"""Parts that are controlled over a connection: what the connection needs of them, and how they come to rest."""

from __future__ import annotations

from abc import abstractmethod

from hal.api import Failure, Part
from hal.parts.part_connection import PartConnection
from hal.parts.stop_latch import StopLatch


class ControlledPart(Part):
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
    def fail(self, fault: Failure) -> None:
        """The controller has a fault: the motion under way has failed, the part comes to rest."""


class StoppablePart(ControlledPart):
    """A part with one motion at a time, which ``brake`` brings to rest."""

    def __init__(self, name: str, latch: StopLatch) -> None:
        super().__init__(name)
        self._connection = PartConnection(name, latch)

    @abstractmethod
    def brake(self) -> None:
        """Come to rest within half a second."""

    def stop(self) -> None:
        """Come to rest, ending the motion under way."""
        with self._connection.lock:
            if self._connection.connected:
                self.brake()
                self._connection.stop_motion()

    def detach(self) -> None:
        """The controller disconnects: come to rest."""
        with self._connection.lock:
            self.brake()
            self._connection.close()
