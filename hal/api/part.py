"""What all parts of a robot share: a name and a model that can be read before connecting."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar


class Part(ABC):
    """A part of a robot. Constructing one does no work; the robot's ``connect()`` does.

    ``name``: in its robot, for example ``arm``. Attributes can be read before connecting.
    ``speed_share``: of its speed, 0 to 1, as an operator has set by ``Robot.set_speed``. Joints, bases and
    grippers run their motions and velocities at it by themselves; who streams set-points by ``Arm.servo`` keeps to it.
    """

    kind: ClassVar[str]
    speed_share = 1.0

    def __init__(self, name: str) -> None:
        self.name = name

    @abstractmethod
    def stop(self) -> None:
        """Bring this part to rest at once; idempotent; sensors do nothing."""


class Sensor(Part):
    """A part that only measures."""

    kind: ClassVar[str] = "sensor"

    def stop(self) -> None:
        """A sensor has nothing to stop."""
