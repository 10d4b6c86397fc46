"""The Robotics API over PyBullet: honest physics, no resets, no glue."""

from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.robot import PyBulletRobot

__all__ = ["PhysicsParameters", "PyBulletRobot"]
