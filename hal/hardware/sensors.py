"""Sensors behind a controller: the robot model describes them, a connection brings what they read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from bestman_bt.messages import LaserScan, RGBDImage, Wrench
from bestman_bt.robot_model import CameraPart, ForceTorquePart, ImuPart, LidarPart, PartConfig
from hal.api import Battery, BatteryReading, Camera, Failure, ForceTorque, Imu, ImuReading, Lidar
from hal.parts import ControlledPart, PartConnection, StopLatch

Reading = TypeVar("Reading")


class HardwareSensor(ControlledPart, Generic[Reading]):
    """A sensor behind a controller; nothing of it moves, and nothing is read of a controller that was lost.

    ``read``: brings the latest reading, or an image that was taken after it was asked for; it may wait, and raises
    NoDataError where there is none.
    """

    def __init__(self, name: str, model: PartConfig, latch: StopLatch, read: Callable[[], Reading]) -> None:
        super().__init__(name)
        self.model = model
        self._connection, self._read = PartConnection(name, latch), read

    def read(self) -> Reading:
        """The latest reading."""
        self._connection.check_reading()
        return self._read()

    def attach(self) -> None:
        """The controller has connected."""
        self._connection.open()

    def detach(self) -> None:
        """The controller disconnects."""
        self._connection.close()

    @property
    def resting(self) -> bool:
        """Always."""
        return True

    def fail(self, fault: Failure) -> None:
        """There is no motion to fail; readings do."""
        self._connection.fail_motion(fault)

    def stop(self) -> None:
        """A sensor has nothing to stop."""


class HardwareCamera(HardwareSensor[RGBDImage], Camera):
    """A camera."""

    def __init__(self, name: str, model: CameraPart, latch: StopLatch, read: Callable[[], RGBDImage]) -> None:
        super().__init__(name, model, latch, read)
        self.intrinsics, self.optical_frame = model.intrinsics, model.optical_frame

    def capture(self) -> RGBDImage:
        """Take one image now."""
        return self.read()


class HardwareLidar(HardwareSensor[LaserScan], Lidar):
    """A planar lidar."""

    def __init__(self, name: str, model: LidarPart, latch: StopLatch, read: Callable[[], LaserScan]) -> None:
        super().__init__(name, model, latch, read)
        self.frame = model.frame

    def scan(self) -> LaserScan:
        """The latest scan."""
        return self.read()


class HardwareForceTorque(HardwareSensor[Wrench], ForceTorque):
    """A force-torque sensor."""

    def __init__(self, name: str, model: ForceTorquePart, latch: StopLatch, read: Callable[[], Wrench]) -> None:
        super().__init__(name, model, latch, read)
        self.frame = model.frame

    def wrench(self) -> Wrench:
        """The latest wrench."""
        return self.read()


class HardwareImu(HardwareSensor[ImuReading], Imu):
    """An inertial unit."""

    def __init__(self, name: str, model: ImuPart, latch: StopLatch, read: Callable[[], ImuReading]) -> None:
        super().__init__(name, model, latch, read)
        self.frame = model.frame


class HardwareBattery(HardwareSensor[BatteryReading], Battery):
    """A battery."""
