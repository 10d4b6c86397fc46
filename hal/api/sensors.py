"""Sensors: parts that only measure."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, LaserScan, RGBDImage, Wrench
from hal.api.part import Sensor


class Camera(Sensor):
    """An RGB-D camera; its pose follows from encoders and forward kinematics, never from the driver."""

    kind: ClassVar[str] = "camera"
    intrinsics: CameraIntrinsics
    """The camera model: a pinhole, with the lens distortion, if any."""
    optical_frame: str
    """The frame of the images in the robot model (x right, y down, z forward)."""

    @abstractmethod
    def capture(self) -> RGBDImage:
        """Take one image now. Raises NoDataError if the camera does not deliver one."""

    def read(self) -> RGBDImage:
        """Take one image, like ``capture``."""
        return self.capture()


class Lidar(Sensor):
    """A planar lidar."""

    kind: ClassVar[str] = "lidar"
    frame: str
    """The frame of the scans in the robot model."""

    @abstractmethod
    def scan(self) -> LaserScan:
        """Return the latest scan. Raises NoDataError if the lidar is silent."""

    def read(self) -> LaserScan:
        """Return the latest scan, like ``scan``."""
        return self.scan()


class ForceTorque(Sensor):
    """A six-axis force-torque sensor."""

    kind: ClassVar[str] = "force_torque"
    frame: str
    """The frame of the wrenches in the robot model."""

    @abstractmethod
    def wrench(self) -> Wrench:
        """Return the latest wrench. Raises NoDataError if the sensor is silent."""

    def read(self) -> Wrench:
        """Return the latest wrench, like ``wrench``."""
        return self.wrench()


@dataclass(frozen=True, eq=False)
class ImuReading:
    """An IMU reading: ``angular_velocity`` (3,) rad/s and ``linear_acceleration`` (3,) m/s², in the sensor's frame.

    The acceleration is the specific force: at rest it is 9.81 m/s² upwards.
    """

    angular_velocity: NDArray[np.float64]
    linear_acceleration: NDArray[np.float64]
    stamp: float


class Imu(Sensor):
    """An inertial measurement unit."""

    kind: ClassVar[str] = "imu"
    frame: str
    """The frame of the readings in the robot model."""

    @abstractmethod
    def read(self) -> ImuReading:
        """Return the latest reading. Raises NoDataError if the unit is silent."""


@dataclass(frozen=True, eq=False)
class TactileReading:
    """The reading of a tactile pad; x of its frame runs along a row, y along a column, z out of the pad.

    ``pressure``: normal force on each taxel, (rows, columns) newtons. ``shear``: force on each taxel along x and y,
    (rows, columns, 2) newtons. ``sliding``: speed of the touching object over the pad, (2,) m/s along x and y, as from
    the optical flow of a DIGIT sensor; 0 without contact. Forces act from the environment on the pad.
    """

    pressure: NDArray[np.float64]
    shear: NDArray[np.float64]
    sliding: NDArray[np.float64]
    stamp: float


class Tactile(Sensor):
    """A pad of pressure elements (taxels) on a finger."""

    kind: ClassVar[str] = "tactile"
    frame: str
    """The frame of the pad in the robot model: in its middle, z out of it."""

    @abstractmethod
    def read(self) -> TactileReading:
        """Return the latest reading. Raises NoDataError if the pad is silent."""


@dataclass(frozen=True)
class BumperZone:
    """A strip with a binary contact; ``start``, ``end``: (x, y) metres in the base frame, counter-clockwise."""

    start: tuple[float, float]
    end: tuple[float, float]

    @property
    def middle(self) -> tuple[float, float]:
        """The middle (x, y), metres, in the base frame."""
        return (self.start[0] + self.end[0]) / 2.0, (self.start[1] + self.end[1]) / 2.0


@dataclass(frozen=True)
class BumperReading:
    """A bumper reading. ``pressed``: indices of the pressed zones; ``stamp``: seconds."""

    pressed: tuple[int, ...]
    stamp: float


class Bumper(Sensor):
    """A ring of contact strips around the chassis of a base."""

    kind: ClassVar[str] = "bumper"
    zones: tuple[BumperZone, ...]
    """The strips, counter-clockwise from the front right corner."""

    @abstractmethod
    def read(self) -> BumperReading:
        """Return the latest reading. Raises NoDataError if the bumper is silent."""


@dataclass(frozen=True)
class BatteryReading:
    """A battery reading: ``charge`` from 0 to 1, ``voltage`` in volts, ``current`` in amperes, positive when
    discharging.
    """

    charge: float
    voltage: float
    current: float
    charging: bool
    stamp: float


class Battery(Sensor):
    """A battery with charge and current measurement."""

    kind: ClassVar[str] = "battery"

    @abstractmethod
    def read(self) -> BatteryReading:
        """Return the latest reading. Raises NoDataError if the battery is silent."""
