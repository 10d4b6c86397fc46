"""PyBullet as an engine of the simulated robot: honest physics, no resets, no glue."""

from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.pictures import render_object
from hal.pybullet.robot import PyBulletRobot

__all__ = ["PhysicsParameters", "PyBulletRobot", "render_object"]
