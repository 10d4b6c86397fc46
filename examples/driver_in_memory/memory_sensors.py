"""Sensors in memory: they see always the same, a flat wall and a round room, and stamp it with the robot's clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bestman_bt.messages import LaserScan, RGBDImage, Wrench
from bestman_bt.robot_model.sensor_parts import (
    BatteryPart,
    CameraPart,
    ImuPart,
    LidarPart,
    MountedBumper,
    MountedForceTorque,
    TactilePart,
)
from hal.api import (
    Battery,
    BatteryReading,
    Bumper,
    BumperReading,
    BumperZone,
    Camera,
    ForceTorque,
    Imu,
    ImuReading,
    Lidar,
    NotConnectedError,
    Tactile,
    TactileReading,
)

if TYPE_CHECKING:
    from memory_robot import MemoryRobot

DISTANCE = 2.0


def stamp_of(robot: MemoryRobot, sensor: str) -> float:
    """Now; a robot that is not connected sees nothing."""
    if not robot.connected:
        raise NotConnectedError(f"{sensor} was used while the robot is not connected")
    return robot.clock.now()


class FlatCamera(Camera):
    """Looks at a grey wall, straight."""

    def __init__(self, name: str, model: CameraPart, robot: MemoryRobot) -> None:
        super().__init__(name)
        self.intrinsics, self.optical_frame, self._robot = model.intrinsics, model.optical_frame, robot

    def capture(self) -> RGBDImage:
        """Grey, and two metres away."""
        size = (self.intrinsics.height, self.intrinsics.width)
        rgb, depth = np.full((*size, 3), 128, np.uint8), np.full(size, DISTANCE, np.float32)
        return RGBDImage(rgb, depth, self.intrinsics, stamp_of(self._robot, self.name))


class RoundRoom(Lidar):
    """Stands in the middle of a round room."""

    def __init__(self, name: str, model: LidarPart, robot: MemoryRobot) -> None:
        super().__init__(name)
        self.frame, self._model, self._robot = model.frame, model, robot

    def scan(self) -> LaserScan:
        """The same distance everywhere."""
        model, stamp = self._model, stamp_of(self._robot, self.name)
        increment = (model.angle_max - model.angle_min) / model.beams
        ranges = np.full(model.beams, DISTANCE)
        return LaserScan(ranges, model.angle_min, increment, model.range_min, model.range_max, stamp)


class QuietWrist(ForceTorque):
    """Feels nothing."""

    def __init__(self, name: str, model: MountedForceTorque, robot: MemoryRobot) -> None:
        super().__init__(name)
        self.frame, self._robot = model.part.frame, robot

    def wrench(self) -> Wrench:
        """No force, no torque."""
        return Wrench(np.zeros(3), np.zeros(3), stamp_of(self._robot, self.name))


class StillImu(Imu):
    """Never moves; feels its weight."""

    def __init__(self, name: str, model: ImuPart, robot: MemoryRobot) -> None:
        super().__init__(name)
        self.frame, self._robot = model.frame, robot

    def read(self) -> ImuReading:
        """Upright, at rest."""
        return ImuReading(np.zeros(3), np.array([0.0, 0.0, 9.81]), stamp_of(self._robot, self.name))


class UntouchedPad(Tactile):
    """Touches nothing."""

    def __init__(self, name: str, model: TactilePart, robot: MemoryRobot) -> None:
        super().__init__(name)
        self.frame, self._model, self._robot = model.frame, model, robot

    def read(self) -> TactileReading:
        """No force on any taxel."""
        taxels = (self._model.rows, self._model.columns)
        return TactileReading(np.zeros(taxels), np.zeros((*taxels, 2)), np.zeros(2), stamp_of(self._robot, self.name))


class FullBattery(Battery):
    """Never runs down."""

    def __init__(self, name: str, model: BatteryPart, robot: MemoryRobot) -> None:
        super().__init__(name)
        self._model, self._robot = model, robot

    def read(self) -> BatteryReading:
        """Full."""
        stamp = stamp_of(self._robot, self.name)
        return BatteryReading(charge=1.0, voltage=self._model.voltage_full, current=0.0, charging=False, stamp=stamp)


class UntouchedBumper(Bumper):
    """Nothing presses on it."""

    def __init__(self, name: str, model: MountedBumper, robot: MemoryRobot) -> None:
        super().__init__(name)
        self._robot = robot
        self.zones = tuple(BumperZone(start, end) for start, end in model.zones)

    def read(self) -> BumperReading:
        """No zone."""
        return BumperReading(pressed=(), stamp=stamp_of(self._robot, self.name))
