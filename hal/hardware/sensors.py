"""Sensors behind a controller: the robot model describes them, a connection brings what they read."""

from __future__ import annotations

from collections.abc import Callable

from bestman_bt.messages import CameraIntrinsics, LaserScan, RGBDImage, Wrench
from bestman_bt.robot_model import BatteryPart, CameraPart, ForceTorquePart, ImuPart, LidarPart
from hal.api import Battery, BatteryReading, Camera, Failure, ForceTorque, Imu, ImuReading, Lidar
from hal.parts import ControlledPart, PartConnection, StopLatch


class HardwareSensor(ControlledPart):
    """A sensor behind a controller; nothing of it moves, and nothing is read of a controller that was lost."""

    def __init__(self, name: str, latch: StopLatch) -> None:
        super().__init__(name)
        self._connection = PartConnection(name, latch)

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


class HardwareCamera(HardwareSensor, Camera):
    """``take``: brings an image that was taken after it was asked for; it may wait, and raises NoDataError."""

    def __init__(self, name: str, model: CameraPart, latch: StopLatch, take: Callable[[], RGBDImage]) -> None:
        super().__init__(name, latch)
        self._model, self._take = model, take

    @property
    def intrinsics(self) -> CameraIntrinsics:
        """Those of the robot model."""
        return self._model.intrinsics

    @property
    def optical_frame(self) -> str:
        """The frame of the images."""
        return self._model.optical_frame

    def capture(self) -> RGBDImage:
        """Take one image now."""
        self._connection.check_reading()
        return self._take()


class HardwareLidar(HardwareSensor, Lidar):
    """``read``: the latest scan; NoDataError where there is none."""

    def __init__(self, name: str, model: LidarPart, latch: StopLatch, read: Callable[[], LaserScan]) -> None:
        super().__init__(name, latch)
        self._model, self._read = model, read

    @property
    def frame(self) -> str:
        """The frame of the scans."""
        return self._model.frame

    def scan(self) -> LaserScan:
        """The latest scan."""
        self._connection.check_reading()
        return self._read()


class HardwareForceTorque(HardwareSensor, ForceTorque):
    """``read``: the latest wrench; NoDataError where there is none."""

    def __init__(self, name: str, model: ForceTorquePart, latch: StopLatch, read: Callable[[], Wrench]) -> None:
        super().__init__(name, latch)
        self._model, self._read = model, read

    @property
    def frame(self) -> str:
        """The frame of the wrenches."""
        return self._model.frame

    def wrench(self) -> Wrench:
        """The latest wrench."""
        self._connection.check_reading()
        return self._read()


class HardwareImu(HardwareSensor, Imu):
    """``read``: the latest reading; NoDataError where there is none."""

    def __init__(self, name: str, model: ImuPart, latch: StopLatch, read: Callable[[], ImuReading]) -> None:
        super().__init__(name, latch)
        self._model, self._read = model, read

    @property
    def frame(self) -> str:
        """The frame of the readings."""
        return self._model.frame

    def read(self) -> ImuReading:
        """The latest reading."""
        self._connection.check_reading()
        return self._read()


class HardwareBattery(HardwareSensor, Battery):
    """``read``: the latest reading; NoDataError where there is none."""

    def __init__(self, name: str, model: BatteryPart, latch: StopLatch, read: Callable[[], BatteryReading]) -> None:
        super().__init__(name, latch)
        self._model, self._read = model, read

    def read(self) -> BatteryReading:
        """The latest reading."""
        self._connection.check_reading()
        return self._read()
