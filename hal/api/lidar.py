"""Planar lidars."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from bestman_bt.messages import LaserScan
from hal.api.part import Sensor


class Lidar(Sensor):
    """A planar lidar."""

    kind: ClassVar[str] = "lidar"

    @property
    @abstractmethod
    def frame(self) -> str:
        """The frame of the scans in the robot model."""

    @abstractmethod
    def scan(self) -> LaserScan:
        """The latest scan."""
