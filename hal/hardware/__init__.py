"""Real robots: one clock, one stop, one watchdog and one set of limits over the controllers of several vendors."""

from hal.hardware.clock import LatencyMonitor, RealTimeClock, RemoteTime, StampOrder, SynchronisedTime
from hal.hardware.connection import Connection
from hal.hardware.control_loop import ControlLoop
from hal.hardware.controller_facts import ArmFacts, Identity
from hal.hardware.isolated_robot import IsolatedRobot
from hal.hardware.robot import HardwareRobot
from hal.hardware.sensors import (
    HardwareBattery,
    HardwareCamera,
    HardwareForceTorque,
    HardwareImu,
    HardwareLidar,
    HardwareSensor,
)

__all__ = [
    "ArmFacts",
    "Connection",
    "ControlLoop",
    "HardwareBattery",
    "HardwareCamera",
    "HardwareForceTorque",
    "HardwareImu",
    "HardwareLidar",
    "HardwareRobot",
    "HardwareSensor",
    "Identity",
    "IsolatedRobot",
    "LatencyMonitor",
    "RealTimeClock",
    "RemoteTime",
    "StampOrder",
    "SynchronisedTime",
]
