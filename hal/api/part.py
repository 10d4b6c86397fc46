"""Base of all parts of a robot: a name and a model that can be read before connecting."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar


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
